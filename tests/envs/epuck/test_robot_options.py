"""Promises of named robots in worlds."""

import gymnasium as gym
import numpy as np
import pytest
import yaml

from tdac_envs import load_robot
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.worlds.world import AXLE_LENGTH


def file_with(folder, **changes):
    """A robot file: that of the e-puck, with other values."""
    own = load_robot("e-puck").model_dump(by_alias=True, exclude_unset=True)
    own["name"] = "own"
    for key, value in changes.items():
        part, _, inner = key.partition("__")
        own[part] = {**own.get(part, {}), inner: value} if inner else value
        if key != "version":
            own["sources"][key.replace("__", ".")] = "measured"
    file = folder / "robot.yaml"
    file.write_text(yaml.safe_dump(own))
    return file


@pytest.mark.parametrize(
    ("name", "version", "mass", "speed", "gap"),
    [("e-puck", "1", 0.16, 6.28, 0.004), ("e-puck2", "2", 0.14, 7.536, 0.005)],
)
def test_a_name_gives_the_values_of_its_version(name, version, mass, speed, gap):
    """Mass, axle, full speed and stopping distance, also in batches."""
    env = gym.make("TDAC-EPuck-v0", world="crates", robot=name).unwrapped
    robot = env.nominal.ground.world.robot
    assert (robot.version, robot.mass) == (version, mass)
    assert env.nominal.axle_length == AXLE_LENGTH
    assert env.nominal.max_wheel_speed == speed
    assert env.required_gap == gap
    batch = gym.make_vec("TDAC-EPuck-v0", 2, "vector_entry_point", robot=name)
    batch.reset(seed=0)
    assert batch.unwrapped.tasks[1].max_wheel_speed == speed


def test_the_robot_of_the_default_worlds_is_version_1():
    """Step by step, to the last bit; other arguments override the robot's."""
    action = np.array([1.0, 0.7], np.float32)
    seen = []
    for options in ({}, {"robot": "e-puck", "disturbed": True}):
        env = EPuckEnv("maze", **options)
        env.reset(seed=0)
        seen.append([env.step(action)[0]["pose"].tolist() for _ in range(20)])
    assert seen[0] == seen[1]
    own = EPuckEnv("maze", robot="e-puck2", max_wheel_speed=3, stopping_distance=0)
    assert own.nominal.max_wheel_speed == 3
    assert own.required_gap == EPuckEnv("maze").required_gap


def test_its_errors_are_on_if_it_is_disturbed(tmp_path):
    """Where no other argument says otherwise."""
    file = file_with(tmp_path, wheels__slip=0.05, wheels__radius_error=0.02)
    assert EPuckEnv("maze", robot=file).disturbances.wheel_slip == 0.0
    found = EPuckEnv("maze", robot=file, disturbed=True).disturbances
    assert (found.wheel_slip, found.wheel_radius_error) == (0.05, 0.02)
    env = EPuckEnv("maze", robot=file, disturbed=True, wheel_slip=0.0)
    assert env.disturbances.wheel_slip == 0.0


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"radius": 0.05}, "own has radius 0.05; an e-puck of version 1 has 0.037"),
        ({"axle_length": 0.052}, "own has axle_length 0.052; .* has 0.057"),
        ({"version": "2"}, "max_wheel_speed 0.1256; an e-puck of version 2 has 0.1507"),
        ({"pose__noise": 0.01}, "own has pose.noise, which only robots on maps have"),
        ({"limits__max_speed": 0.1}, "own has limits.max_speed, which only robots on"),
    ],
)
def test_what_is_no_e_puck_is_refused(tmp_path, changes, reason):
    """In one line, with the figure."""
    with pytest.raises(TaskError, match=reason):
        EPuckEnv("maze", robot=file_with(tmp_path, **changes))


@pytest.mark.parametrize("name", ["jackal", "paper-disc"])
def test_a_robot_on_maps_is_refused(name):
    """The line says where it drives."""
    with pytest.raises(TaskError, match=f"{name} drives on maps, not in Webots worlds"):
        EPuckEnv("maze", robot=name)
