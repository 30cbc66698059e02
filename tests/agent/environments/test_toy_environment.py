"""A third environment is an entry point: nothing of ours has to know it."""

import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from tdac_agent import load_task
from tdac_agent.tasks.registry import environment
from tdac_agent.verification.verify import verify
from tdac_envs.core.errors import TaskError

POLICY = """\
import math


def policy(obs):
    x, y, heading = (float(v) for v in obs["pose"])
    to_x, to_y = (float(v) for v in obs["goal"])
    off = math.remainder(math.atan2(to_y - y, to_x - x) - heading, 2 * math.pi)
    turn = max(-1.0, min(1.0, 2.0 * off))
    left, right = (turn, -turn) if abs(off) > 0.3 else (1.0 + turn, 1.0 - turn)
    return WHEELS
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The toy environment, as if it were installed."""
    package = Path(shutil.copytree(Path(__file__).with_name("toy"), tmp_path / "site"))
    info = package / "toy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    points = "Toy-Crossed-v0 = toy:CROSSED\nToy-Torn-v0 = toy:NONE\n"
    (info / "entry_points.txt").write_text(f"[tdac.environments]\n{points}")
    monkeypatch.syspath_prepend(package)
    already = os.environ.get("PYTHONPATH")
    path = os.pathsep.join([str(package), *([already] if already else [])])
    monkeypatch.setenv("PYTHONPATH", path)
    yield tmp_path
    environment.cache_clear()
    sys.modules.pop("toy", None)


def write_task(folder, env):
    np.save(folder / "map.npy", np.zeros((60, 90), np.bool_))
    file = folder / "task.yaml"
    file.write_text(
        f"env: {env}\nmap: map.npy\nstart: [15, 15]\ngoal: [70, 45]\n"
        "robot: {radius: 5}\nprofile: policy\n"
    )
    return file


@pytest.mark.slow
def test_controllers_are_verified_in_an_environment_of_others(toy):
    """The entry's own tests and its own robot decide, in the judge's process too."""
    task = load_task(write_task(toy, "Toy-Crossed-v0"))
    crossed = verify(POLICY.replace("WHEELS", "right, left"), task)
    plain = verify(POLICY.replace("WHEELS", "left, right"), task)
    assert crossed.passed
    assert list(crossed.tests) == ["test_drive.py::test_reaches_the_goal"]
    assert not plain.passed
    assert crossed.episodes[0].outcome == "reached"


def test_an_environment_that_cannot_be_used_is_named(toy):
    """One line says what is known, or what went wrong."""
    with pytest.raises(
        TaskError, match=r"unknown environment 'Toy-Cross-v0' .*known: "
    ):
        load_task(write_task(toy, "Toy-Cross-v0"))
    with pytest.raises(TaskError, match=r"'Toy-Torn-v0' \(toy:NONE\) cannot be loaded"):
        load_task(write_task(toy, "Toy-Torn-v0"))
