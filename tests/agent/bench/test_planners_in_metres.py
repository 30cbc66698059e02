"""Planners on sets in metres: they drive as those in pixels do in the same place."""

import json

import numpy as np
import pytest
from small import room_with_blocks

from tdac_agent.planners.names import planner_names
from tdac_agent.planners.planner import planner_on, source_of, source_on
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs import load_set
from tdac_envs.ladder.observed import SetView
from tdac_envs.ladder.set_file import find_set_file
from tdac_envs.ladder.task_sets import TaskSet

BINARY = 1 / 32
"""A resolution with which conversions are exact, m."""
STEPS = 25
SEEN = {
    "start": {"frame": "start", "map": False},
    "map": {"frame": "map", "map": True},
    "odometry": {"frame": "start", "map": False},
}


@pytest.fixture
def task(tmp_path):
    """A task in a room with two blocks, on a robot with an uneven fan of rays."""
    return room_with_blocks(tmp_path, (60, 52, 0.4), 60, (-5, 3))


def as_set(task, seen, resolution):
    """A task set with the robot of a task; its worlds do not matter."""
    keys = ("odometry",) if seen == "odometry" else ("pose",)
    own = {"observed": (*keys, "goal", "wheel_speeds", "ranges"), **SEEN[seen]}
    robot = task.nominal.robot
    own |= {"name": "room", "robot": robot, "resolution": resolution}
    return TaskSet(find_set_file("unknown").model_copy(update=own))


class Driver:
    """A planner in a folder of its own, and what it observes."""

    def __init__(self, source, tasks, task, folder, monkeypatch):
        folder.mkdir()
        (folder / "params.json").write_text(json.dumps(level_params(tasks.file)))
        np.save(folder / "occupancy.npy", task.nominal.terrain.grid.cells)
        monkeypatch.chdir(folder)
        self.names = {}
        exec(compile(source, "controller.py", "exec"), self.names)
        self.view = SetView(tasks.file, 170.0, privileged=False)
        self.anchor = self.view.anchor(task.nominal)

    def sees(self, whole, pose):
        return self.view.seen(whole, pose, self.anchor)


@pytest.mark.slow_after(4)
@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize("name", planner_names())
def test_the_unit_makes_no_difference(name, seen, task, tmp_path, monkeypatch):
    """Wherever it drives, it chooses the same wheel speeds in metres as in pixels."""
    both = [as_set(task, seen, resolution) for resolution in (None, BINARY)]
    pixels, metres = (
        Driver(source_on(name, own), own, task, tmp_path / str(i), monkeypatch)
        for i, own in enumerate(both)
    )
    env = task.setting.make_env(odometry=True)
    whole, _ = env.reset(seed=0)
    for each in (pixels, metres):
        each.names["reset"](each.sees(whole, env.unwrapped.pose()))
    for _ in range(STEPS):
        obs, shown = (
            each.sees(whole, env.unwrapped.pose()) for each in (pixels, metres)
        )
        converted = metres.names["seen"](shown)
        assert converted.keys() == obs.keys()
        for key, value in obs.items():
            assert converted[key] == pytest.approx(value, abs=1e-4)
        first, second = pixels.names["policy"](obs), metres.names["policy"](shown)
        assert second == pytest.approx(first, abs=1e-3 if seen == "map" else 1e-12)
        whole, _, over, _, _ = env.step(np.clip(np.array(first, np.float32), -1, 1))
        if over:
            break


@pytest.mark.parametrize("resolution", [0.025, 0.05, 1.5])
def test_what_is_told_is_in_pixels(resolution, task, tmp_path, monkeypatch):
    """The parameters are those of the set in pixels, whatever its resolution."""
    pixels, metres = (as_set(task, "start", unit) for unit in (None, resolution))
    source = source_on("go-to-goal", metres)
    driver = Driver(source, metres, task, tmp_path / "own", monkeypatch)
    told, expected = driver.names["PARAMS"], level_params(pixels.file)
    assert told["goal_tolerance"] == pytest.approx(expected["goal_tolerance"])
    assert told["robot"].keys() == expected["robot"].keys()
    for key, value in expected["robot"].items():
        assert told["robot"][key] == pytest.approx(value)


def test_a_range_that_is_too_short_is_a_near_obstacle(task, tmp_path, monkeypatch):
    """A reading of 0 stands for the smallest range, not for a hit in the scanner."""
    tasks = load_set("floor")
    source = source_on("follow-the-gap", tasks)
    driver = Driver(source, tasks, task, tmp_path / "own", monkeypatch)
    seen = {"goal": np.ones(2), "ranges": np.array([0.0, 0.3, 3.5])}
    assert driver.names["seen"](seen)["ranges"] == pytest.approx([4.8, 12.0, 140.0])


def test_levels_of_sets_in_metres(task):
    """Those like no level in metres are like one in pixels."""
    on_floor, on_map = (as_set(task, seen, 0.05) for seen in ("start", "map"))
    assert planner_on("dwa", on_floor).source == source_on("dwa", load_set("floor"))
    tuned = planner_on("dwa", load_set("known")).source
    changed = planner_on("dwa", on_map).source
    assert "\nHEADING = 0.525\n" in tuned
    assert "\nHEADING = 0.525\n" in changed


def test_in_pixels_a_planner_is_its_file_alone():
    """Sets in pixels get a file that knows nothing of metres."""
    for name in planner_names():
        assert source_on(name, load_set("unknown")) == source_of(name)
