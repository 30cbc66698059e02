"""Searches whose process is killed with -9 at random moments end the same."""

import json
import sys

import numpy as np
import pytest
from few_worlds import quick, write_set, write_wide_set
from killed_synthesis import finish, kill_again_and_again
from small import write_small_task

CLOCKS = {"started", "seconds", "id", "mark", "child_cpu_seconds", "cpu_seconds"}
CLOCKS |= {"call_ms_mean", "call_ms_p99"}
ON_TASK = ("--task", "task", "--improve", "32")
ON_SET = ("--set", "few.yaml", "--episodes", "4", "--feedback-episodes", "2")
ON_SET += ("--search", "paper", "--improve", "32")
RACE = ("--set", "wide.yaml", "--episodes", "64", "-K", "7", "-N", "1")
RACE += ("--learner", f"command:{sys.executable} model.py")
MODEL = """
import hashlib, pathlib, sys

number = int(hashlib.sha256(sys.stdin.buffer.read()).hexdigest(), 16)
source = pathlib.Path(__file__).with_name("quick.py").read_text()
gain, half = 0.3 + number % 71 / 100, (None, 0, 1)[number // 71 % 3]
source = source.replace("GAIN = 1.0", f"GAIN = {gain}")
source = source.replace("HALF = None", f"HALF = {half}")
print(f"```python\\n{source}```")
"""
"""A model whose answer follows from the question."""


def without_clocks(values):
    """A record but for what the clock has a say in."""
    if isinstance(values, list):
        return [without_clocks(each) for each in values]
    if not isinstance(values, dict):
        return values
    return {k: without_clocks(v) for k, v in values.items() if k not in CLOCKS}


def content(path):
    """What a file says; in a trajectory, all but how long the calls took."""
    if path.suffix != ".npz":
        return path.read_bytes()
    with np.load(path) as arrays:
        return {name: arrays[name].tobytes() for name in arrays if name != "calls"}


def state(folder):
    """All that a run says of its result, without what the clock has a say in."""
    records = [
        without_clocks(json.loads(path.read_text()))
        for path in sorted(folder.glob("*.json"))
    ]
    files = {
        str(path.relative_to(folder)): content(path)
        for pattern in ("controller.*", "*.prompt.md", "trajectories/*.npz")
        for path in folder.rglob(pattern)
    }
    return records, files


@pytest.mark.slow
@pytest.mark.parametrize(("words", "kills"), [(ON_TASK, 10), (ON_SET, 20), (RACE, 20)])
def test_a_search_that_is_killed_again_and_again_ends_the_same(tmp_path, words, kills):
    """On a task, on a set, and in a race; later kills hit later steps."""
    write_small_task(tmp_path / "task", profile="policy")
    write_set(tmp_path / "few.yaml")
    write_wide_set(tmp_path / "wide.yaml")
    (tmp_path / "quick.py").write_text(quick())
    (tmp_path / "model.py").write_text(MODEL)
    words = (*words, "--seed", "5")
    finish(tmp_path, words, "undisturbed")
    seconds = json.loads((tmp_path / "undisturbed" / "run.json").read_text())["seconds"]
    most = 3.0 + seconds / 3
    killed = kill_again_and_again(tmp_path, words, "killed", kills, most)
    assert killed > kills // 3
    finish(tmp_path, words, "killed")
    assert state(tmp_path / "killed") == state(tmp_path / "undisturbed")
