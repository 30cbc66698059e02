"""Searches on a task whose process is killed with -9 at random moments end the same."""

import json

import pytest
from killed_synthesis import finish, kill_again_and_again
from small import write_small_task

KILLS = 10
WORDS = ("--task", "task", "--improve", "32", "--seed", "5")


def without_clocks(file):
    """A report but for what the clock has a say in."""
    report = json.loads(file.read_text())
    for name in ("seconds", "child_cpu_seconds"):
        del report[name]
    for episode in report["episodes"]:
        for name in ("call_ms_mean", "call_ms_p99"):
            del episode[name]
    return report


def state(folder):
    """All that a run says of its result, without what the clock has a say in."""
    run = json.loads((folder / "run.json").read_text())
    for name in ("started", "seconds", "id", "mark"):
        del run[name]
    files = {
        str(path.relative_to(folder)): path.read_bytes()
        for pattern in ("controller.*", "*.prompt.md", "trajectories/*.npz")
        for path in folder.rglob(pattern)
    }
    own = (folder / "improvement.json").read_text()
    return run, own, without_clocks(folder / "report.json"), files


@pytest.mark.slow
def test_a_search_on_a_task_that_is_killed_ten_times_ends_the_same(tmp_path):
    write_small_task(tmp_path / "task", profile="policy")
    finish(tmp_path, WORDS, "undisturbed")
    seconds = json.loads((tmp_path / "undisturbed" / "run.json").read_text())["seconds"]
    most = 3.0 + seconds / 3
    killed = kill_again_and_again(tmp_path, WORDS, "killed", KILLS, most)
    assert killed > KILLS // 3
    finish(tmp_path, WORDS, "killed")
    assert state(tmp_path / "killed") == state(tmp_path / "undisturbed")
