"""Whatever one word of a command line is, the command ends with 0, 1 or 2, in a line.

In this process a command goes up to its first judged episode: there its job is written.
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import pytest
from hostile_words import JUDGED, READING, furnish, lines
from hypothesis import HealthCheck, given, settings

from tdac_agent.cli.main import main

LEAST_SHARE = 0.5
ENOUGH = 20
"""Examples that say something of a share."""
SECONDS = 120
LONGEST = 1500
JOBS = ("job.json", "results.json", "results-0.json")
CODES = {0, 1, 2}
_WATCHING = []


class FirstEpisode(BaseException):
    """The first job of a judge is written."""


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if not _WATCHING or event != "open" or not isinstance(arguments[0], str):
        return
    if os.path.basename(arguments[0]) in JOBS and "w" in str(arguments[1]):
        raise FirstEpisode


sys.addaudithook(_watch)


@pytest.fixture
def command(monkeypatch, alarm):
    """Gives a line to the command line; exit code (None: judged), stderr."""
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "dumb")
    handlers = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGHUP)}

    def run(words: list[str], here: Path, temporary: Path):
        monkeypatch.chdir(here)
        monkeypatch.setattr("sys.argv", ["tdac", *words])
        monkeypatch.setattr("tempfile.tempdir", str(temporary))
        out, errors = io.StringIO(), io.StringIO()
        alarm(SECONDS)
        _WATCHING.append(True)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
                main()
        except SystemExit as ended:
            return ended.code, errors.getvalue()
        except FirstEpisode:
            return None, errors.getvalue()
        finally:
            _WATCHING.clear()
            alarm(0)
            gc.unfreeze()
        raise AssertionError("the command has not ended")

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def problem_of(code: int | None, errors: str) -> str:
    """What is wrong with how a command ended; empty where nothing is."""
    if code is None:
        return ""
    told = errors.strip().splitlines()
    if code not in CODES or "Traceback" in errors:
        return f"exit {code}: {errors[-1500:]}"
    if code == 2 and not all(line.startswith("error: ") for line in told):
        return f"not one line: {errors[:1500]}"
    if any(len(line) > LONGEST for line in told):
        return f"a long line: {errors[:300]}"
    return ""


def is_usage(code: int | None, errors: str) -> bool:
    """Whether the flags themselves were not understood."""
    return code == 2 and errors.rstrip().endswith("--help")


def check_line(usual: tuple[str, ...], examples: int, command) -> None:
    """Tries so many lines; at least half are understood."""
    seen: Counter[bool] = Counter()

    @settings(
        max_examples=examples,
        suppress_health_check=list(HealthCheck),
        database=None,
        derandomize=examples < 100,
    )
    @given(lines(usual))
    def run(words):
        folder = Path(tempfile.mkdtemp(prefix="generated-", dir="/tmp"))
        here, temporary = folder / "here", folder / "temporary"
        here.mkdir()
        temporary.mkdir()
        furnish(here)
        before = _children()
        try:
            code, errors = command(words, here, temporary)
            seen[not is_usage(code, errors)] += 1
            assert problem_of(code, errors) == ""
            assert sorted(temporary.iterdir()) == []
            assert _gone(_children() - before)
        finally:
            os.chdir("/")
            shutil.rmtree(folder)

    run()
    if examples < ENOUGH:
        return
    share = seen[True] / seen.total()
    assert share >= LEAST_SHARE, f"only {share:.0%} of {seen.total()} are understood"


def _children() -> set[int]:
    """Processes that this one has started and that run."""
    found = set()
    for folder in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):
            found |= {int(pid) for pid in (folder / "children").read_text().split()}
    return found


def _gone(pids: set[int]) -> bool:
    """Whether all of some processes end within five seconds."""
    deadline = time.monotonic() + 5.0
    while pids & _children() and time.monotonic() < deadline:
        time.sleep(0.01)
    return not pids & _children()


@pytest.mark.slow_after(7)
@pytest.mark.parametrize("name", [*READING, *JUDGED])
def test_the_line_that_nobody_changed_is_carried_out(name, command, tmp_path):
    """With exit code 0, or up to its first episode."""
    here, temporary = tmp_path / "here", tmp_path / "temporary"
    here.mkdir()
    temporary.mkdir()
    furnish(here)
    code, errors = command(list((READING | JUDGED)[name]), here, temporary)
    # The run has ended; of the two that judge nothing but drive, one does not arrive.
    wanted = {"play": 1, "resume": 2}.get(name, None if name in JUDGED else 0)
    assert code == wanted, errors


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", READING)
def test_a_hostile_word_is_taken_or_refused_in_one_line(name, command):
    """Of the commands that judge nothing, 300 lines in all."""
    check_line(READING[name], 300 // len(READING) + 1, command)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", JUDGED)
def test_a_hostile_word_of_a_command_that_judges(name, command):
    """A few lines of each, up to the first episode."""
    check_line(JUDGED[name], 5, command)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*READING, *JUDGED])
def test_many_hostile_words(name, command):
    """10,000 lines in all."""
    lines_of = READING | JUDGED
    check_line(lines_of[name], 10_000 // len(lines_of) + 1, command)
