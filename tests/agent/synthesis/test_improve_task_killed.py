"""Searches on a task whose process is killed with -9 at random moments end the same."""

import json
import os
import random
import signal
import subprocess
import sys

import pytest
from small import write_small_task

KILLS = 10


def command(folder, out):
    words = ["synth", "--task", "task", "--improve", "32", "--seed", "5", "--out", out]
    return subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def ended(folder, out):
    with command(folder, out) as process:
        said, _ = process.communicate()
    assert process.returncode == 0, said
    return json.loads((folder / out / "run.json").read_text())["seconds"]


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
    seconds = ended(tmp_path, "undisturbed")
    chance, killed = random.Random(4), 0
    for _ in range(KILLS):
        with command(tmp_path, "killed") as process:
            try:
                # Later kills hit later steps, since what is on record is not repeated.
                process.communicate(timeout=chance.uniform(1.0, 3.0 + seconds / 3))
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
                killed += 1
    assert killed > KILLS // 3
    ended(tmp_path, "killed")
    assert state(tmp_path / "killed") == state(tmp_path / "undisturbed")
