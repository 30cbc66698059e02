"""What a controller returns costs the judge little, and never more than its time."""

import contextlib
import json
import select
import signal
import time

import numpy as np
import pytest

from tdac_agent.sandbox import ControllerFault
from tdac_agent.storage.plain import MAX_VALUE, shown
from tdac_agent.tasks.task import write_workdir
from tdac_agent.verification.judge.judge import Judge
from tdac_agent.verification.judge.plugin import MOST_CALLS, JudgePlugin, run_tests
from tdac_agent.verification.judge.time_limit import CPU, WALL, time_limit

SUITE = """
import pytest


def endless():
    while True:
        str(list(range(1000)))


@pytest.fixture
def prepared():
    endless()


def test_says_much():
    endless()


def test_catches_everything():
    for _ in range(2):
        try:
            endless()
        except Exception:
            continue
    endless()


def test_prepares_much(prepared):
    pass
"""
DEEP = """
def test_recursion():
    def call(n):
        return call(n + 1)

    call(0)
"""


def endless():
    while True:
        str([])


def caught_twice():
    for _ in range(2):
        with contextlib.suppress(ControllerFault):
            endless()
    endless()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("clock", [WALL, CPU])
@pytest.mark.parametrize("action", [endless, caught_twice])
def test_the_main_thread_is_stopped_in_the_middle(action, clock):
    """At the deadline, and again where the error is caught; nothing of it stays."""
    before = signal.getsignal(clock.signal)
    with (
        pytest.raises(ControllerFault, match="too long"),
        time_limit(clock.time() + 0.1, "too long", clock),
    ):
        action()
    assert signal.getsignal(clock.signal) == before
    assert signal.getitimer(clock.timer) == (0.0, 0.0)


def test_waiting_uses_none_of_the_time_of_the_processor():
    """Static tests, which only compute, cannot fail because of other processes."""
    with time_limit(CPU.time() + 0.2, "too long", CPU):
        began = time.monotonic()
        select.select([], [], [], 0.3)
    assert time.monotonic() - began >= 0.3


def test_nothing_begins_after_the_deadline():
    """Where it is over, that is said at once."""
    with pytest.raises(ControllerFault, match="over"), time_limit(0.0, "over"):
        endless()


@pytest.fixture
def judged(small_task, good_source, tmp_path, monkeypatch):
    """What is on record of the failing tests of a suite of one file."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")

    def judged(text, **options):
        # pytest imports a file of the same name once.
        (tmp_path / "suite").mkdir()
        (tmp_path / "suite" / f"test_{tmp_path.name}.py").write_text(text)
        work, log = tmp_path / "work", tmp_path / "log.jsonl"
        write_workdir(work, small_task)
        judge = Judge(small_task, good_source.encode(), work, **options)
        try:
            plugin = JudgePlugin(judge, profile="policy", paper=True)
            run_tests([tmp_path / "suite"], log, plugin)
        finally:
            judge.close()
        records = [json.loads(line) for line in log.read_text().splitlines()]
        assert records[-1]["exitstatus"] == 1
        return [r for r in records if r.get("outcome") == "failed"]

    return judged


@pytest.mark.slow
def test_no_test_outlives_the_verification(judged):
    """Whatever a test does is ended, and it has failed for that reason."""
    failed = judged(SUITE, wall_seconds=1.0)
    assert [record["nodeid"].partition("::")[2] for record in failed] == [
        "test_says_much",
        "test_catches_everything",
        "test_prepares_much",
    ]
    for record in failed:
        told = record["longrepr"]["reprcrash"]["message"]
        assert told.endswith("the verification took longer than 1 s")


def test_a_deep_traceback_is_cut(judged):
    """Of a thousand calls the first are in the log; what went wrong is as it was."""
    (failed,) = judged(DEEP)
    entries = failed["longrepr"]["reprtraceback"]["reprentries"]
    assert len(entries) <= MOST_CALLS + 1
    assert "RecursionError" in failed["longrepr"]["reprcrash"]["message"]


def nested(depth):
    value = [1]
    for _ in range(depth):
        value = [value] * 3
    return value


@pytest.mark.parametrize(
    "value",
    [
        [np.zeros((4,) * 8, np.bool_)] * 100_000,
        np.zeros((4,) * 8),
        "x" * 10**8,
        b"x" * 10**8,
        nested(30),
        {(n,): np.zeros(99) for n in range(9999)},
        1 << 8000,
    ],
    ids=["arrays", "array", "text", "bytes", "lists", "dict", "int"],
)
def test_no_value_is_described_at_length(value):
    """Whole, some of these would take minutes, and hundreds of megabytes."""
    assert 10 < len(shown(value)) <= MAX_VALUE


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ((1, 2.5), "(1, 2.5)"),
        ("occupancy.png", "'occupancy.png'"),
        (np.array([1.5, 2.0]), "array([1.5, 2. ])"),
        (np.zeros((3, 40)), "array of shape (3, 40) and type float64"),
        (np.int64(3), "np.int64(3)"),
        ({"a": [1, 2]}, "{'a': [1, 2]}"),
        (None, "None"),
    ],
)
def test_a_small_value_is_told_whole(value, expected):
    """As Python writes it; of a large array what it is."""
    assert shown(value) == expected
