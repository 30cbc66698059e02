"""Promises of the batched TDAC-EPuck-v0: it is many single ones, only faster."""

import math
import pickle

import gymnasium as gym
import numpy as np
import pymunk
import pytest
from batches import actions, assert_same
from world_texts import text

import tdac_envs
from tdac_envs import read_world
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.vector import EPuckVectorEnv

NAME = "TDAC-EPuck-v0"
NOISY = {"sensor_noise": 1.0, "wheel_slip": 0.1, "motor_lag": 0.1, "delay": 2}
SENSORS = {"ground_sensors": True, "gps": True, "compass": True}
CASES = {
    "defaults": {"horizon": 55},
    "walls": {"world": "maze"},
    "noisy": {"world": "maze", "variation": "random", "horizon": 40, **NOISY},
    "sensors": {"variation": "jitter", "horizon": 25, "sensor_noise": 0.5, **SENSORS},
    "block": {"world": "room", "on_collision": "block", "horizon": 33, **SENSORS},
}
STEP = 6.28 * 0.02 * 0.032


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_it_does_what_single_environments_do(case, mode):
    """Observations, rewards, ends and infos are Gymnasium's own, to the last bit."""
    count, kwargs, options = 5, {"autoreset_mode": mode}, CASES[case]
    many = gym.make_vec(NAME, count, "sync", vector_kwargs=kwargs, **options)
    batch = gym.make_vec(NAME, count, "vector_entry_point", **kwargs, **options)
    assert batch.single_observation_space == many.single_observation_space
    assert batch.observation_space == many.observation_space
    for one, two in zip(many.reset(seed=3), batch.reset(seed=3), strict=True):
        assert_same(one, two)
    ends = 0
    for action in actions(count, 120):
        expected, result = many.step(action), batch.step(action)
        for one, two in zip(expected, result, strict=True):
            assert_same(one, two)
        assert result[0] in batch.observation_space
        over = result[2] | result[3]
        ends += over.sum()
        if mode == "Disabled" and over.any():
            again = [env.reset(options={"reset_mask": over}) for env in (many, batch)]
            for one, two in zip(*again, strict=True):
                assert_same(one, two)
    assert ends >= 2


def test_threads_change_nothing():
    """Every robot is stepped by one thread, so no result depends on how many."""
    one, two = (EPuckVectorEnv(300, threads=k, variation="jitter") for k in (1, 3))
    for a, b in zip(one.reset(seed=5), two.reset(seed=5), strict=True):
        assert_same(a, b)
    for action in actions(300, 40):
        for a, b in zip(one.step(action), two.step(action), strict=True):
            assert_same(a, b)
    two.close()


def test_each_robot_may_have_its_own_world():
    """Robot i has the arguments of entry i, which begin anew after the last."""
    each = [{"world": "maze"}, {"world": "yard", "dt": 0.016}, {"world": "clutter"}]
    batch = EPuckVectorEnv(4, each=each, horizon=30)
    singles = [EPuckEnv(**each[i % 3], horizon=30) for i in range(4)]
    batch.reset(seed=0)
    for env in singles:
        env.reset(seed=0)
    for action in 0.2 * actions(4, 25):
        observations, rewards, *_ = batch.step(action)
        assert observations in batch.observation_space
        for i, env in enumerate(singles):
            single, reward, terminated, *_ = env.step(action[i])
            assert_same(single, {key: value[i] for key, value in observations.items()})
            assert rewards[i] == reward
            assert not terminated
    assert len({id(setup.nominal.ground) for setup in batch.setups}) == 3


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
    forward, turn = 0.5 * (left + right) * STEP, (right - left) * STEP / 0.052
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


def test_a_pickle_goes_on_where_the_batch_was():
    """Poses, tasks and random streams are kept."""
    batch = EPuckVectorEnv(3, variation="jitter", **NOISY)
    batch.reset(seed=2)
    script = actions(3, 40)
    for action in script[:20]:
        batch.step(action)
    twin = pickle.loads(pickle.dumps(batch))
    for action in script[20:]:
        for a, b in zip(batch.step(action), twin.step(action), strict=True):
            assert_same(a, b)


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
