"""An exported package gives the same commands with the Pythons of ROS 2."""

import dataclasses
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from replayed_drive import commands_of

from tdac_agent.ros2.export import core_settings
from tdac_agent.ros2.package.core import Core
from tdac_agent.ros2.package.worker import Worker

SCRIPT = Path(__file__).with_name("replayed_drive.py")
PYTHONS = {"python3.10": "1.21.5", "python3.12": "1.26.4"}
"""The Python and numpy of Humble and of Jazzy."""


@pytest.fixture
def recorded(tmp_path, package, settings, robot, here):
    """A file with what a robot saw in a drive, and the commands to it."""
    worker = Worker(package / "controller", settings["controller_sha256"])
    core = Core(core_settings(settings, dead_man=0.3), worker)
    steps, commands = [], []
    while not robot.over and len(steps) < 400:
        reading = robot.read()
        ranges = [r if math.isfinite(r) else None for r in reading.ranges.tolist()]
        steps.append([robot.time, reading.pose.tolist(), ranges])
        commands += commands_of(core, robot.layout, steps[-1:])
        robot.obey(*commands[-1][:2])
        robot.step()
    assert robot.reached
    layout = list(dataclasses.astuple(robot.layout))
    drive = {"dead_man": 0.3, "layout": layout, "steps": steps}
    (tmp_path / "drive.json").write_text(json.dumps(drive))
    return tmp_path / "drive.json", commands


def assert_same(python, package, recorded):
    """Another Python drives as this one does."""
    file, commands = recorded
    # Nothing of the tests' own environment.
    done = subprocess.run(
        [python, "-I", SCRIPT, package, "tdac_floor", file],
        capture_output=True, text=True, check=False, cwd=file.parent,
        env={"PATH": os.environ["PATH"], "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [each[2] for each in found] == [each[2] for each in commands]
    own = [each[:2] for each in commands]
    assert np.allclose([each[:2] for each in found], own, atol=1e-5)


def test_without_tdac(package, recorded):
    """The core and the controller need Python and numpy alone."""
    assert_same(sys.executable, package, recorded)


@pytest.mark.slow
@pytest.mark.parametrize("name", PYTHONS)
def test_with_the_pythons_of_ros(tmp_path, package, recorded, name):
    """Humble has Python 3.10 with numpy 1.21, Jazzy 3.12 with 1.26."""
    python = shutil.which(name)
    made = [python, "-m", "venv", tmp_path / "venv"]
    # The name may be that of a shim of pyenv whose Python is not chosen.
    if python is None or subprocess.run(made, check=False).returncode:
        pytest.skip(f"no {name} that makes virtual environments")
    own = tmp_path / "venv" / "bin" / "python"
    words = "-m", "pip", "install", "--quiet", f"numpy=={PYTHONS[name]}"
    if subprocess.run([own, *words], capture_output=True, check=False).returncode:
        pytest.skip(f"numpy {PYTHONS[name]} cannot be installed")
    assert_same(own, package, recorded)
