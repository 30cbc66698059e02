"""Searches whose process is killed with -9 at random moments end the same."""

import json
import os
import random
import signal
import subprocess
import sys

import pytest
from few_worlds import write_set

KILLS = 20


def command(folder, out):
    words = ["synth", "--set", "few.yaml", "--episodes", "4", "--feedback-episodes"]
    words += ["2", "--improve", "32", "--seed", "5", "--out", out]
    return subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def state(folder):
    """All that a run says of its result, without what the clock has a say in."""
    run = json.loads((folder / "run.json").read_text())
    for name in ("started", "seconds", "id", "mark"):
        del run[name]
    sources = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("controller.*")
    }
    return run, (folder / "report.json").read_text(), sources


@pytest.mark.slow
def test_a_search_that_is_killed_twenty_times_ends_the_same(tmp_path):
    write_set(tmp_path / "few.yaml")
    with command(tmp_path, "undisturbed") as process:
        said, _ = process.communicate()
    assert process.returncode == 0, said
    chance = random.Random(4)
    for _ in range(KILLS):
        with command(tmp_path, "killed") as process:
            try:
                process.communicate(timeout=chance.uniform(1.0, 12.0))
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
    with command(tmp_path, "killed") as process:
        said, _ = process.communicate()
    assert process.returncode == 0, said
    assert state(tmp_path / "killed") == state(tmp_path / "undisturbed")
