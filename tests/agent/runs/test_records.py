"""The record of a run: there before and after each call, readable at any time."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from changed_run import journal
from damage import altered_json, torn
from hypothesis import given, settings
from hypothesis import strategies as st
from unconfirmed import synthesize

from tdac_agent.errors import RunError
from tdac_agent.library.listing import resume_command
from tdac_agent.models.budget import Enough
from tdac_agent.models.provider import Reply
from tdac_agent.runs.recorder import difference
from tdac_agent.runs.replay import DEMO
from tdac_agent.runs.run_record import Attempt, Run, load_run
from tdac_agent.storage.files import write_atomic


def test_each_call_is_on_record_before_and_after(
    small_task, good_source, tmp_path, warm
):
    """While a model thinks, the question is on the disk; then the answer is, too."""
    out = tmp_path / "run"
    seen = []

    class Watcher:
        name = "watcher"
        paid = False

        def complete(self, request):
            prompt = out / "iterations" / "k01" / "j0" / "generate.prompt.md"
            assert prompt.read_text() == request.prompt
            seen.append(journal(out)[-1]["event"])
            assert load_run(out).status == "running"
            return Reply(f"```python\n{good_source}```")

    events = []
    synthesize(small_task, Watcher(), out=out, on_event=events.append, judge=warm)
    assert seen == ["call.intent"]
    assert events == journal(out)
    names = [event["event"] for event in events]
    assert names == [
        *("run.start", "call.intent", "call.reply"),
        *("verify.start", "verify.end", "run.end"),
    ]
    seconds = [event["seconds"] for event in events]
    assert seconds == sorted(seconds)


def recorded(folder, **changes):
    """A run whose record has some fields written otherwise."""
    known = json.loads((DEMO / "run.json").read_text())
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({**known, **changes}))
    return load_run(folder)


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("", None),
        (None, None),
        ("--max-cost 0.7", Enough(max_cost=0.7)),
        ("--max-tokens 42000", Enough(max_tokens=42000)),
        ({"max_cost": 0.7}, Enough(max_cost=0.7)),
    ],
    ids=str,
)
def test_a_limit_to_go_on_with(tmp_path, written, read):
    """Old records have it as a text; what is written is read again."""
    run = recorded(tmp_path / "run", enough=written, status="budget")
    assert run.enough == read
    (tmp_path / "run" / "run.json").write_text(run.model_dump_json())
    assert load_run(tmp_path / "run") == run


@pytest.mark.parametrize(
    "written",
    [
        *("--max-cost 1 --tier rlimits", "--max-cost", "--tier rlimits", "; true #"),
        *("--max-cost nan", "--max-cost 1e400", "--max-cost -1", "--max-tokens 0.5"),
        *({"max_cost": 0}, {"max_cost": 1, "max_tokens": 1}, {"max_cost": 1e9}),
        *({"max_tokens": 10**13}, {"tier": "rlimits"}, ["--tier", "rlimits"], 7, True),
    ],
    ids=str,
)
def test_a_limit_is_a_number(tmp_path, written):
    """Nothing else becomes a word of a command line."""
    with pytest.raises(RunError, match=r"run\.json: enough"):
        recorded(tmp_path / "run", enough=written, status="budget")


@pytest.mark.parametrize("name", ["a b", "$(touch x)", "a; b", "a'b", "--tier", "a\nb"])
def test_the_command_that_continues_a_run_is_words(tmp_path, name):
    """Whatever its folder is called, and whichever limit is enough."""
    folder = tmp_path / name
    run = recorded(folder, enough="--max-cost 0.7", status="budget", tau=None)
    words = ["tdac", "synth", "--resume", str(folder), "--max-cost", "0.7"]
    assert shlex.split(resume_command(run)) == words


def test_writing_is_atomic(tmp_path, monkeypatch):
    """A file is replaced as a whole, and a failure leaves the old one and no other."""
    path = tmp_path / "a.json"
    write_atomic(path, "old")
    with pytest.raises(TypeError):
        write_atomic(path, 3)
    full = os.fsync

    def no_space(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", no_space)
    with pytest.raises(OSError, match="No space"):
        write_atomic(path, "new")
    monkeypatch.setattr("os.fsync", full)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


def test_long_sources_are_not_compared():
    """A model's answer cannot keep a run busy with its own record."""
    assert "-a\n+b\n" in difference("a\nc\n", "b\nc\n")
    long = "x = 1\n" * 66_000
    assert difference(long, f"{long}y = 2\n").startswith("(not compared")


@pytest.mark.parametrize(
    "content",
    [
        *(None, b"", b"{", b"[]", b"{}", b'"text"', b'{"schema_version": 2}'),
        *(b"\xff", b"\0", b"[" * 10**5, b"9" * 5000, b'{"folder": "/"}', b"null"),
    ],
)
def test_what_is_no_run(tmp_path, content):
    """A missing, torn or foreign run.json is one clear line."""
    if content is not None:
        (tmp_path / "run.json").write_bytes(content)
    with pytest.raises(RunError, match="is not a run folder") as caught:
        load_run(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_run_that_is_not_there(tmp_path):
    """What is missing is said in words, with the run that may be meant."""
    with pytest.raises(RunError, match=r"run folder: it has no run\.json$"):
        load_run(tmp_path)
    with pytest.raises(RunError, match=r"run folder: there is no such folder$"):
        load_run(tmp_path / "runs" / "maze-1")
    (tmp_path / "maze-1").mkdir()
    (tmp_path / "maze-1" / "run.json").touch()
    with pytest.raises(RunError, match=rf"did you mean {tmp_path / 'maze-1'}\?\)$"):
        load_run(tmp_path / "maz-1")


RUN = Run(
    folder=Path("run"),
    task="maze",
    task_sha256="0" * 64,
    learner="builtin",
    optimizer="builtin",
    iterations=3,
    patience=2,
    seed=0,
    status="not verified",
    attempts=[Attempt(k=1, j=0, valid=True, passed=False, failed_tests=("t.py::a",))],
    started="2026-01-01T00:00:00",
)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(st.data())
def test_a_damaged_run(tmp_path_factory, data):
    """Whatever happened to a run.json: one clear line, or a run of that folder."""
    folder, whole = tmp_path_factory.getbasetemp(), RUN.model_dump_json().encode()
    damaged = altered_json(whole) if data.draw(st.booleans()) else torn(whole)
    (folder / "run.json").write_bytes(data.draw(damaged))
    try:
        run = load_run(folder)
    except RunError as error:
        reason = str(error)
    else:
        assert run.folder == folder
        assert not run.passed
        return
    assert reason.startswith(f"{folder} is not a run folder: ")
    assert "\n" not in reason


def under_way(path):
    return path.exists() and '"verify.start"' in path.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_synth_leaves_a_readable_run(tmp_path, no_traces, number):
    """Exit 130, status `interrupted`, nothing left running."""
    out = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", "synth", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(no_traces)},
    )
    deadline = time.monotonic() + 60
    while not under_way(out / "journal.jsonl") and time.monotonic() < deadline:
        time.sleep(0.02)
        assert process.poll() is None
    process.send_signal(number)
    stdout, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert b"Traceback" not in stdout + stderr
    run = load_run(out)
    assert run.status == "interrupted"
    assert journal(out)[-1]["status"] == "interrupted"
