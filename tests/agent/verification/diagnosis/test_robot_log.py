"""What drives show of a robot: delay, gains, sizes of a step, order of the readings."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from driving import drive

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.units import METRES, PIXELS
from tdac_agent.verification.diagnosis.robot_log import RobotLog
from tdac_agent.verification.diagnosis.wheel_log import WheelLog, wheel_speeds
from tdac_envs.map2d.env import Map2DEnv

ROBOT = SimpleNamespace(full_step=3.0, axle_length=9.0)


def trajectory(commands, speeds, *, up):
    """A drive whose wheels have given speeds, from the origin."""
    poses = [np.zeros(3)]
    for left, right in speeds:
        x, y, heading = poses[-1]
        arc = (left + right) / 2.0 * ROBOT.full_step
        turn = (left - right) * ROBOT.full_step / ROBOT.axle_length
        turn = -turn if up else turn
        chord = arc * np.sinc(turn / (2.0 * np.pi))
        way = heading + turn / 2.0
        ahead = [x + chord * np.cos(way), y + chord * np.sin(way)]
        poses.append(np.array([*ahead, heading + turn]))
    count = len(commands)
    return Trajectory(
        np.array(poses),
        np.asarray(commands, np.float32),
        np.zeros(count + 1),
        np.zeros((count + 1, 1), np.float32),
        collisions=0,
        dt=0.1,
    )


@pytest.mark.parametrize("up", [False, True])
def test_wheel_speeds_follow_from_the_motion(up):
    """They are those that the wheels had, whichever way headings turn."""
    speeds = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 2))
    found = wheel_speeds(trajectory(speeds, speeds, up=up), ROBOT, up=up)
    assert found == pytest.approx(speeds)


@pytest.mark.parametrize("late", [0, 1, 3])
@pytest.mark.parametrize("units", [PIXELS, METRES], ids=["px", "m"])
def test_wheels(late, units):
    """Delay, gains of each wheel, scatter and the sizes of a step come out again."""
    log = WheelLog()
    random, gains = np.random.default_rng(2), [(0.9, 1.1), (1.1, 0.9), (1.0, 1.0)]
    for gain in gains:
        commands = random.uniform(-0.9, 0.9, (400, 2))
        given = np.vstack([np.zeros((late, 2)), commands])[:400] * gain
        noisy = given * random.normal(1.0, 0.05, given.shape)
        log.add(trajectory(commands, noisy, up=units.up), ROBOT, up=units.up)
    text = "\n".join(log.lines(units))
    when = {0: "in the same step", 1: "1 step late", 3: "3 steps late"}[late]
    assert f"a command acts {when}" in text
    left, right = (
        [float(each) for each in re.search(rf"{side} (\S+) to ([\d.]+)", text).groups()]
        for side in ("left", "right")
    )
    assert [*left, *right] == pytest.approx([0.9, 1.1, 0.9, 1.1], abs=0.02)
    turn = float(re.search(r"heading by ([-+\d.]+)°", text)[1])
    right = np.degrees(2.0 * 3.0 / 9.0)
    assert turn == pytest.approx(-right if units.up else right, rel=0.02)
    step = float(re.search(r"\(1, 1\) drives ([\d.e+]+)", text)[1])
    assert step == pytest.approx(3.0 * units.scale, rel=0.02)  # px or mm


def test_acceleration():
    """Wheels that follow slowly are told from wheels that follow at once."""
    commands = np.repeat([[1.0, 1.0], [-1.0, -1.0]] * 15, 20, axis=0)
    follow = np.zeros_like(commands)
    for step in range(1, len(commands)):
        change = np.clip(commands[step] - follow[step - 1], -0.2, 0.2)
        follow[step] = follow[step - 1] + change
    for speeds, told in ((follow, True), (commands, False)):
        log = WheelLog()
        log.add(trajectory(commands, speeds, up=False), ROBOT, up=False)
        assert ("at most 20 % of full speed" in "\n".join(log.lines(PIXELS))) == told


def test_readings_and_touch():
    """The order of the readings, their origin, and the radius, from drives on a map."""
    log = RobotLog()
    random = np.random.default_rng(3)
    cells = np.zeros((100, 140), np.bool_)
    cells[[0, -1]] = cells[:, [0, -1]] = True
    for _ in range(40):
        start = (*random.uniform((20, 20), (120, 80)), random.uniform(-3.0, 3.0))
        env = Map2DEnv(cells, start, (70.0, 50.0), robot_radius=6.0, goal_tolerance=1.0)
        rollout = drive(env, lambda _: (1.0, 0.95))
        log.add(rollout.trajectory, env.nominal, PIXELS)
    text = "\n".join(log.lines)
    order = re.search(r"\(by its index\): (.*)", text)[1].split(", ")
    rays = [each.split(": ") for each in order]
    angles = np.degrees(env.nominal.robot.angles())
    for ray, place in rays:
        degrees = 0.0 if place == "ahead" else float(place.split("°")[0])
        degrees = -degrees if place.endswith("left") else degrees
        assert degrees == pytest.approx(angles[int(ray)], abs=12.0)
    assert float(re.search(r"centre to that obstacle: ([\d.]+)", text)[1]) == 1.0
    assert float(re.search(r"walls that were ([\d.]+) px", text)[1]) == pytest.approx(
        6.0, abs=0.3
    )


def test_nothing_driven():
    """Before anything was driven, there is nothing to tell."""
    assert RobotLog().lines == []
