"""Promises of the batched TDAC-EPuck-v0 beyond those of every batch."""

import math

import numpy as np
import pymunk
import pytest
from world_texts import text

import tdac_envs
from tdac_envs import read_world
from tdac_envs.epuck.vector import EPuckVectorEnv

STEP = 6.28 * 0.02 * 0.032


def engine_with(box):
    """A physics engine with a robot and, as its obstacle, a box (x0, y0, x1, y1)."""
    space = pymunk.Space()
    space.collision_slop, space.collision_bias = 1e-6, 0.0
    robot = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    x0, y0, x1, y1 = box
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    space.add(robot, pymunk.Circle(robot, 0.037))
    space.add(pymunk.Poly(space.static_body, corners))
    return space, robot


def engine_step(space, robot, left, right):
    """One step with the chord velocity of the arc of two wheels."""
    forward, turn = 0.5 * (left + right) * STEP, (right - left) * STEP / 0.057
    half = 0.5 * turn
    chord = forward * (math.sin(half) / half if half else 1.0)
    middle = robot.angle + half
    robot.velocity = (
        chord / 0.032 * math.cos(middle),
        chord / 0.032 * math.sin(middle),
    )
    robot.angular_velocity = turn / 0.032
    space.step(0.032)


@pytest.mark.slow
def test_it_moves_as_a_physics_engine_does():
    """Poses within 1e-6 m over 1,000 steps without a contact."""
    floor = "RectangleArena { floorSize 60 60 }"
    world = read_world(text("E-puck { }", floor), goal=(20.0, 20.0))
    batch = EPuckVectorEnv(6, world=world)
    batch.reset(seed=0)
    engines = [engine_with((40, 40, 41, 41)) for _ in range(6)]
    random = np.random.default_rng(2)
    for k in range(1000):
        if k % 50 == 0:
            speeds = random.uniform(-1, 1, (6, 2)).astype(np.float32)
        *_, infos = batch.step(speeds)
        assert not infos["collision"].any()
        for (space, robot), (left, right) in zip(engines, speeds.tolist(), strict=True):
            engine_step(space, robot, left, right)
    for pose, (_, robot) in zip(batch.pose(), engines, strict=True):
        assert pose[:2] == pytest.approx(tuple(robot.position), abs=1e-6)
        assert math.remainder(pose[2] - robot.angle, 2 * math.pi) == pytest.approx(
            0.0, abs=1e-6
        )
    assert np.ptp(batch.pose()[:, 0]) > 0.1


def test_it_ends_at_the_step_in_which_a_physics_engine_finds_a_contact():
    """Curves of many kinds into a box, and a stop within 1 mm of it."""
    box = "SolidBox { translation 0.4 0 0.05 size 0.2 1.2 0.1 }"
    world = read_world(text("E-puck { }", box), goal=(-0.6, 0.0))
    random = np.random.default_rng(4)
    count = 40
    speeds = random.uniform(0.5, 1.0, (count, 1)) * np.ones((1, 2))
    speeds += random.uniform(-0.02, 0.02, (count, 2))
    speeds = np.clip(speeds, -1, 1).astype(np.float32)
    batch = EPuckVectorEnv(count, world=world, autoreset_mode="Disabled")
    batch.reset(seed=0)
    engines = [engine_with((0.3, -0.6, 0.5, 0.6)) for _ in range(count)]
    left = np.ones(count, bool)
    for _ in range(400):
        _, _, terminated, _, infos = batch.step(speeds)
        for i in np.flatnonzero(left):
            space, robot = engines[i]
            engine_step(space, robot, *speeds[i].tolist())
            near = space.shape_query(next(iter(robot.shapes)))
            assert bool(near) == terminated[i] == infos["collision"][i]
            if terminated[i]:
                assert 0.037 <= infos["clearance"][i] < 0.038
        left &= ~terminated
        if terminated.any():
            speeds[terminated] = 0.0
            start = {"start": (-0.3, 0.0, 0.0), "reset_mask": terminated}
            batch.reset(options=start)
        if not left.any():
            break
    assert not left.any()


def test_the_goal_ends_an_episode():
    """As it does for a robot alone."""
    world = read_world(text("E-puck { }"), goal=(0.2, 0.0))
    batch = EPuckVectorEnv(2, world=world, autoreset_mode="SameStep")
    batch.reset(seed=0)
    for _ in range(100):
        _, rewards, terminated, _, infos = batch.step([[1, 1], [0, 0]])
        if terminated.any():
            break
    assert terminated.tolist() == [True, False]
    assert infos["final_info"]["is_success"].tolist() == [True, False]
    assert rewards[0] > 9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"world": "crates", "on_collision": "block"}, "a batch cannot push objects"),
        ({"num_envs": 0}, "num_envs to be a whole number from 1"),
        ({"render_mode": "human"}, "expected render_mode None"),
        ({"each": [{"gps": True}, {}]}, "the same sensors"),
        ({"each": [{"delay": 1}, {}]}, "the same"),
        ({"world": "mase"}, "mase"),
    ],
)
def test_wrong_arguments_are_named(options, message):
    with pytest.raises(tdac_envs.TdacError, match=message):
        EPuckVectorEnv(**{"num_envs": 2, **options})
