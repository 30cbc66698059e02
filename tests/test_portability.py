"""`make portability` tells what passed, what failed and what could not run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from file_halves import is_in_half

TOOL = Path(__file__).parents[1] / "tools/portability"


@pytest.fixture(autouse=True)
def _its_modules(monkeypatch):
    """They are no package: Python finds them as where the folder is run."""
    monkeypatch.syspath_prepend(TOOL)


@pytest.fixture
def place(tmp_path):
    """A working folder for its rows."""
    from place import Place

    return Place(tmp_path, ["make", "test"])


def test_a_table_has_a_line_for_each_outcome(capsys, tmp_path):
    """Passed with its counts, failed with the signal, not run with the reason."""
    from commands import counted, run
    from table import CannotRun, attempt, told

    def shell(line):
        return run(["sh", "-c", line], cwd=tmp_path)

    def lacks():
        raise CannotRun("no emulator here")

    outcomes = [
        attempt("good", "tests", lambda: counted(shell("echo 3 passed in 0.1s"))),
        attempt("bad", "tests", lambda: shell("echo 1 failed, 2 passed in 1s; exit 1")),
        attempt("died", "tests", lambda: shell("kill -ILL $$")),
        attempt("missing", "tests", lacks),
    ]
    assert "1 failed, 2 passed in 1s" in capsys.readouterr().out
    lines = told(outcomes).splitlines()[1:]
    assert [line.split()[:2] for line in lines[:3]] == [
        ["good", "passed"],
        ["bad", "failed"],
        ["died", "failed"],
    ]
    assert lines[0].endswith("3 passed")
    assert lines[1].endswith("exit 1, 1 failed, 2 passed")
    assert "SIGILL" in lines[2]
    assert lines[3].split()[:3] == ["missing", "not", "run"]
    assert lines[3].endswith("no emulator here")


def test_bubblewrap_is_hidden_and_nothing_else(place, tmp_path, monkeypatch):
    """Whatever else lies in its folder is still found."""
    from walls import hidden

    programs = tmp_path / "programs"
    programs.mkdir()
    for name in ("bwrap", "another"):
        (programs / name).write_text("#!/bin/sh\n")
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    path = hidden(place)["PATH"]
    assert shutil.which("bwrap") is not None
    assert shutil.which("bwrap", path=path) is None
    assert shutil.which("another", path=path) is not None


def test_a_commit_draws_one_row_of_those_that_ci_does_not_run_anyway():
    """Always the same for one commit, and each sooner or later."""
    from rows import ROWS, drawn

    seen = {drawn(str(number)) for number in range(300)}
    assert seen == {name for name in ROWS if ROWS[name].drawn}
    assert drawn("a commit") == drawn("a commit")


def test_an_unknown_row_is_refused():
    """Before anything is done, with the names that there are."""
    words = [sys.executable, TOOL, "lowset"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "no row 'lowset'; there are temporary," in done.stderr


def test_a_seed_draws_half_of_the_files():
    """About half of them, the same ones again, and all tests of a file or none."""
    files = [f"tests/test_{number}.py" for number in range(400)]

    def half(seed):
        return [file for file in files if is_in_half(seed, f"{file}::test_x")]

    assert 160 < len(half("a commit")) < 240
    assert half("a commit") == half("a commit") != half("b")
    ids = f"{files[0]}::test_x", f"{files[0]}::TestX::test_y[case]"
    assert len({is_in_half("a commit", each) for each in ids}) == 1
