"""A run on a small map in metres, and its ROS 2 package."""

import dataclasses
import json
import os

import pytest
from floor_task import Ready, forward, write_task

from tdac_agent import load_task, synthesize
from tdac_agent.ros2.export import core_settings, export_ros2
from tdac_agent.ros2.package.core import Core
from tdac_agent.ros2.robot import Robot


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """The folder of a run whose controller passed; blind drives would take longer."""
    task = load_task(write_task(tmp_path_factory.mktemp("floor")))
    folder = tmp_path_factory.mktemp("runs") / "floor-1"
    assert synthesize(task, learner="builtin", out=folder, confirm=False).passed
    return folder


@pytest.fixture(scope="session")
def task(run):
    """The task of this run."""
    return load_task(run)


@pytest.fixture(scope="session")
def package(run, tmp_path_factory):
    """Its ROS 2 package."""
    out = tmp_path_factory.mktemp("package") / "floor"
    export_ros2(run, out, unverified=True)
    return out


@pytest.fixture(scope="session")
def settings(package):
    """What the package says of the task."""
    return json.loads((package / "controller" / "settings.json").read_text())


@pytest.fixture(scope="session")
def steps(run):
    """The steps of the verified nominal episode."""
    report = json.loads((run / "report.json").read_text())
    return next(e["steps"] for e in report["episodes"] if e["name"] == "nominal")


@pytest.fixture
def robot(task, settings):
    """A simulated robot at the start, whose timer ends a command after 0.3 s."""
    return Robot(task, settings, dead_man=0.3)


@pytest.fixture
def here():
    """The working folder, which a controller changes."""
    before = os.getcwd()
    yield
    os.chdir(before)


@pytest.fixture
def make_core(settings):
    """A core with a policy that answers at once."""

    def made(policy=forward, **changes):
        own = core_settings(settings, dead_man=0.3)
        return Core(dataclasses.replace(own, **changes), Ready(policy))

    return made
