"""`tdac doctor` says what works, since it has tried it."""

import json
import os
import re
import subprocess
import sys

import pytest

from tdac_agent.cli.doctor import Check, show_checks
from tdac_agent.cli.trials import attempt, describe_signal

DIES = """
import os, signal, sys
if {word!r} in sys.orig_argv:
    os.kill(os.getpid(), signal.SIG{name})
"""


@pytest.fixture
def on_path(tmp_path, monkeypatch):
    """Puts a module before all others in the processes that are started."""

    def put(module, text):
        (tmp_path / f"{module}.py").write_text(text)
        rest = os.environ.get("PYTHONPATH")
        path = os.pathsep.join([str(tmp_path), *([rest] if rest else [])])
        monkeypatch.setenv("PYTHONPATH", path)

    return put


def doctor():
    """Exit code and JSON checks, by name."""
    words = [sys.executable, "-m", "tdac_agent", "doctor", "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    record = json.loads(done.stdout)
    assert "numpy" in record["versions"]
    return done.returncode, {check.pop("name"): check for check in record["checks"]}


@pytest.mark.slow
def test_all_is_tried():
    """Exit 0 where a step, a verification and a film work, each told with how."""
    code, checks = doctor()
    assert code == 0
    assert checks["sandbox in use"]["works"]
    assert checks["compiled step"]["works"]
    assert re.search(r"passes \d+ tests in", checks["verification"]["detail"])
    assert checks["video (.mp4, .gif)"]["detail"].startswith("ffmpeg ")


@pytest.mark.slow
def test_a_broken_package_is_named(on_path):
    """Exit 3, and the doctor itself survives what ends everything else."""
    on_path("cv2", "raise ImportError('libGL.so.1: cannot open shared object file')")
    code, checks = doctor()
    assert code == 3
    for name in ("compiled step", "verification"):
        assert checks[name]["needed"]
        assert not checks[name]["works"]
        detail = checks[name]["detail"]
        assert re.search(r"libGL\.so\.1: .*; .*install tdac", detail), detail


@pytest.mark.parametrize("name", ["ILL", "SEGV"])
def test_a_step_that_kills_its_process_is_told_with_the_signal(on_path, name):
    """So does code that was compiled for another processor."""
    on_path("sitecustomize", DIES.format(word="compiled_step", name=name))
    works, detail = attempt("compiled_step")
    assert not works
    assert re.match(rf"died with SIG{name}: .*install", detail), detail
    assert "NUMBA_CPU_NAME=generic" in detail or name != "ILL"


@pytest.mark.slow
def test_a_judge_that_dies_is_no_verification(on_path):
    """Although all else of it works."""
    on_path(
        "sitecustomize",
        DIES.format(word="tdac_agent.verification.judge.server", name="ILL"),
    )
    works, detail = attempt("verification")
    assert not works
    assert "judge" in detail


@pytest.mark.parametrize(
    ("does", "told"),
    [("echo it lacks an encoder >&2; exit 1", "it lacks an encoder"),
     ("kill -ILL $$", "SIGILL")],
)  # fmt: skip
def test_a_film_that_cannot_be_encoded_is_told(tmp_path, monkeypatch, does, told):
    """With what the program said of itself, or the signal that ended it."""
    program = tmp_path / "ffmpeg"
    program.write_text(f"#!/bin/sh\n{does}\n")
    program.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    works, detail = attempt("video")
    assert not works
    assert f"ffmpeg failed: {told}" in detail


def test_a_signal_without_a_name_has_a_number():
    assert describe_signal(40).startswith("died with signal 40: ")


def test_what_soon_ends_has_no_tick(capsys):
    """Each state of a check has its own mark."""
    show_checks(
        [
            Check("good", True, "-"),
            Check("soon retired", True, "-", warning=True),
            Check("optional", False, "-"),
            Check("broken", False, "-", needed=True),
        ]
    )
    lines = capsys.readouterr().out.splitlines()[:4]
    assert [line.split()[0] for line in lines] == ["✔", "!", "–", "✘"]
