"""Promises that both robots keep: ends, infos, actions, noise and variations."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from simple_policies import drive
from world_texts import text

from tdac_envs import read_world
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.map2d.env import Map2DEnv

FULL = np.ones(2, np.float32)


def open_map(**more):
    """A map of free pixels."""
    given = {"start": (50, 150, 0), "goal": (250, 150), **more}
    return Map2DEnv(np.zeros((300, 300), bool), **given)


def walled_map(**more):
    """A wall from top to bottom at x = 150 .. 152, but for a gap at the top."""
    cells = np.zeros((300, 300), bool)
    cells[60:, 150:153] = True
    return Map2DEnv(cells, **{"start": (50, 200, 0), "goal": (250, 200), **more})


def open_world(*nodes, **more):
    """A plain without walls, but for some nodes."""
    given = {"start": (0.0, 0.0, 0.0), "goal": (1.0, 0.0), **more}
    return EPuckEnv(read_world(text("E-puck { }", *nodes)), **given)


def walled_world(**more):
    """A thin wall across the way, open at its ends."""
    wall = "Wall { translation 0.3 0 0 size 0.002 0.4 0.1 }"
    return open_world(wall, **{"goal": (0.6, 0.0), **more})


class Case(NamedTuple):
    """A robot and its worlds.

    Attributes:
        open: Makes an env without obstacles; the goal is straight ahead.
        walled: Makes one with a wall straight ahead.
        roomy: Makes one for random starts.
        radius: Of the body.
        speed: Of a full wheel; in lengths per s.
        dt: s.
        wall: Where the wall is, x.
        touch: Where the centre is when the body touches the wall, x.
        hidden: Arguments of a goal near the wall, on its other side.
        facts: Distance, path length (at least) and clearance at the start, walled.
        more: Keys of `info` that the other robot lacks.
    """

    open: Callable[..., Any]
    walled: Callable[..., Any]
    roomy: Callable[..., Any]
    radius: float
    speed: float
    dt: float
    wall: float
    touch: float
    hidden: dict[str, Any]
    facts: tuple[float, float, float]
    more: dict[str, type]


def room(**more):
    """A bundled world with rooms."""
    return EPuckEnv("room", **more)


CASES = {
    "map2d": Case(
        open_map, walled_map, walled_map, 15.0, 75.59, 0.05, 151.0, 134.5,
        {"goal": (169, 200), "goal_tolerance": 40}, (200.0, 300.0, 50.5),
        {"contact": str},
    ),
    "epuck": Case(
        open_world, walled_world, room, 0.037, 6.28 * 0.02, 0.032, 0.3, 0.262,
        {"goal": (0.35, 0.0), "goal_tolerance": 0.2}, (0.6, 0.72, 0.299), {},
    ),
}  # fmt: skip
each_robot = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


@each_robot
class TestEnds:
    def test_the_goal_ends_the_episode(self, case):
        env = case.open()
        env.reset(seed=0)
        _, reward, terminated, truncated, info = drive(env, FULL)
        assert (terminated, truncated, info["is_success"]) == (True, False, True)
        assert info["distance_to_goal"] <= env.task.goal_tolerance
        assert reward > 9

    def test_a_goal_behind_a_wall_is_not_reached(self, case):
        env = case.walled(**case.hidden, on_collision="block")
        env.reset(seed=0)
        _, _, terminated, _, info = drive(env, FULL, 300)
        assert not terminated
        assert not info["is_success"]
        assert info["distance_to_goal"] < env.task.goal_tolerance
        assert info["collisions"] > 50

    def test_a_collision_costs_and_ends_the_episode(self, case):
        env = case.walled()
        env.reset(seed=0)
        _, reward, terminated, truncated, info = drive(env, FULL)
        assert (terminated, truncated) == (True, False)
        assert (info["collision"], info["collisions"]) == (True, 1)
        assert not info["is_success"]
        assert reward < -9
        # An e-puck stops up to 1 mm before it touches.
        assert 0.0 <= case.touch - env.pose()[0] + 1e-6 < 1e-3

    def test_blocked_at_a_wall_it_stays_out_and_may_leave(self, case):
        env = case.walled(on_collision="block")
        env.reset(seed=0)
        for _ in range(300):
            _, _, terminated, _, info = env.step(FULL)
            assert not terminated
        assert 0.0 <= case.touch - env.pose()[0] + 1e-6 < 1e-5
        assert 200 < info["collisions"] < 300
        for _ in range(20):
            assert not env.step(-FULL)[4]["collision"]
        way = 20 * case.dt * case.speed
        assert env.pose()[0] == pytest.approx(case.touch - way, abs=1e-4 * case.radius)

    def test_the_default_horizon(self, case):
        dt = case.dt / 8
        env = case.walled(dt=dt)
        formula = math.ceil(6 * env.task.shortest / (case.speed * dt))
        assert env.task.horizon == formula > 2500
        assert case.walled().task.horizon == 2500

    def test_a_full_step_towards_the_goal_is_one_unit_of_progress(self, case):
        env = case.open()
        env.reset(seed=0)
        rewards = [env.step(FULL)[1] for _ in range(40)]
        assert np.mean(rewards) == pytest.approx(0.1 - 0.01, abs=2e-3)


@each_robot
class TestInfo:
    def test_keys_and_types(self, case):
        expected = {
            "is_success": bool,
            "collision": bool,
            "collisions": int,
            "clipped": int,
            "distance_to_goal": float,
            "path_distance": float,
            "clearance": float,
            **case.more,
        }
        env = case.walled()
        begun, moved = env.reset(seed=0)[1], env.step(FULL)[4]
        ended = drive(env, FULL)[4]
        assert {key: type(value) for key, value in ended.items()} == expected
        none = dict.fromkeys(case.more, type(None))
        for info in (begun, moved):
            types = {key: type(value) for key, value in info.items()}
            assert types == {**expected, **none}

    def test_values_at_the_start(self, case):
        _, info = case.walled().reset(seed=0)
        distance, path, clearance = case.facts
        assert info["distance_to_goal"] == pytest.approx(distance)
        assert info["path_distance"] > path
        assert info["clearance"] == pytest.approx(clearance)

    def test_types_of_a_step(self, case):
        env = case.open()
        env.reset(seed=0)
        observation, reward, terminated, truncated, _ = env.step(FULL)
        assert [type(v) for v in (reward, terminated, truncated)] == [float, bool, bool]
        assert {v.dtype for v in observation.values()} == {np.dtype(np.float32)}


@each_robot
class TestActions:
    @pytest.mark.parametrize("given", [(3.0, -9.0), np.array([2, -2]), (1e300, -1e300)])
    def test_too_much_is_clipped_and_counted(self, case, given):
        env = case.open()
        env.reset(seed=0)
        observation, _, _, _, info = env.step(given)
        np.testing.assert_array_equal(observation["wheel_speeds"], [1, -1])
        assert info["clipped"] == 1
        assert env.step(FULL)[4]["clipped"] == 1
        assert env.reset()[1]["clipped"] == 0

    @pytest.mark.parametrize(
        "given",
        [
            None,
            0.5,
            (0.5,),
            (0.5, 0.5, 0.5),
            "ab",
            ("a", "b"),
            (math.nan, 0.0),
            (0.0, math.inf),
            np.zeros((2, 1)),
            np.zeros((2, 2), np.float32),
            {"left": 1, "right": 1},
            (1j, 0),
        ],
    )
    def test_anything_else_is_refused_and_changes_nothing(self, case, given):
        env = case.open()
        env.reset(seed=0)
        before = env.pose()
        with pytest.raises(ValueError, match="expected an action of two finite"):
            env.step(given)
        np.testing.assert_array_equal(env.pose(), before)


@each_robot
class TestNoise:
    def test_it_is_off_by_default(self, case):
        seen = []
        for seed in (1, 2):
            env = case.walled()
            rows = [env.reset(seed=seed)[0], *(env.step(FULL)[0] for _ in range(15))]
            seen.append([np.concatenate(list(row.values())) for row in rows])
        np.testing.assert_array_equal(*seen)

    def test_a_delay_holds_actions_back(self, case):
        env = case.open(delay=2)
        env.reset(seed=0)
        speeds = [env.step(FULL)[0]["wheel_speeds"][0] for _ in range(4)]
        assert speeds == [0, 0, 1, 1]

    def test_a_lag_follows_an_exponential(self, case):
        env = case.open(motor_lag=0.1)
        env.reset(seed=0)
        speeds = [env.step(FULL)[0]["wheel_speeds"][1] for _ in range(5)]
        expected = 1 - np.exp(-10.0 * case.dt * np.arange(1, 6))
        np.testing.assert_allclose(speeds, expected, rtol=1e-5)

    def test_slip_moves_the_robot_but_not_the_wheel_speeds(self, case):
        env = case.open(wheel_slip=0.2)
        env.reset(seed=0)
        observation, *_ = env.step(0.5 * FULL)
        np.testing.assert_array_equal(observation["wheel_speeds"], [0.5, 0.5])
        assert env.pose()[2] != 0.0


@each_robot
class TestVariations:
    def test_nominal_is_always_the_same(self, case):
        env = case.walled()
        poses = [env.reset(seed=s)[0]["pose"] for s in range(3)]
        np.testing.assert_array_equal(poses, [poses[0]] * 3)
        np.testing.assert_allclose(poses[0], env.nominal.start, rtol=1e-6)

    def test_jitter_starts_near_and_differs(self, case):
        env = case.walled(variation="jitter")
        start = env.nominal.start
        poses = np.array([env.reset(seed=s)[0]["pose"] for s in range(50)])
        off = np.hypot(poses[:, 0] - start.x, poses[:, 1] - start.y)
        assert off.max() <= case.radius * (1 + 1e-5)
        assert np.abs(poses[:, 2] - start.heading).max() <= 0.5 + 1e-6
        assert len(np.unique(poses[:, 0])) == 50
        np.testing.assert_array_equal(env.reset(seed=7)[0]["pose"], poses[7])

    def test_mixed_starts_near_or_far_and_keeps_the_goal(self, case):
        env = case.roomy(variation="mixed")
        poses = []
        for seed in range(60):
            observation, info = env.reset(seed=seed)
            poses.append(observation["pose"])
            assert observation in env.observation_space
            assert 0.0 < info["path_distance"] < math.inf
            assert info["clearance"] >= case.radius
            assert env.task.goal == env.nominal.goal
            assert env.task.horizon == env.nominal.horizon
        x, y, heading = np.array(poses).T
        space = env.observation_space["goal"]
        assert (np.ptp([x, y], axis=1) > (space.high - space.low)[:2] / 2).all()
        assert np.ptp(heading) > 6.0
        start = env.nominal.start
        near = np.hypot(x - start.x, y - start.y) <= case.radius
        assert 15 < near.sum() < 45
        np.testing.assert_array_equal(env.reset(seed=7)[0]["pose"], poses[7])

    def test_random_draws_start_and_goal_with_their_own_horizon(self, case):
        dt = case.dt / 8
        env = case.roomy(variation="random", dt=dt)
        for seed in range(20):
            observation, info = env.reset(seed=seed)
            assert observation in env.observation_space
            assert 0.0 < info["path_distance"] < math.inf
            assert info["clearance"] >= case.radius
            formula = math.ceil(6 * info["path_distance"] / (case.speed * dt))
            assert env.task.horizon == max(2500, formula)
            np.testing.assert_allclose(observation["goal"], env.task.goal, rtol=1e-6)
            # The goal has room for the body as well.
            start, goal = env.task.start, env.task.goal
            env.reset(options={"start": goal, "goal": start[:2]})
        assert env.nominal.goal != goal

    def test_random_keeps_a_horizon_that_was_given(self, case):
        env = case.roomy(variation="random", horizon=99)
        env.reset(seed=0)
        assert env.task.horizon == 99

    def test_options_set_start_and_goal_for_one_episode(self, case):
        env = case.open(variation="jitter")
        (x, y), (u, v) = env.nominal.start[:2], env.nominal.goal
        near, far = (x + case.radius, y, 7.0), [u, v + case.radius]
        observation, _ = env.reset(seed=0, options={"start": near, "goal": far})
        expected = [*near[:2], 7.0 - 2 * math.pi]
        np.testing.assert_allclose(observation["pose"], expected, rtol=1e-6)
        np.testing.assert_allclose(observation["goal"], far, rtol=1e-6)
        observation, _ = env.reset(options={"start": near[:2]})
        expected = [*near[:2], env.nominal.start.heading]
        np.testing.assert_allclose(observation["pose"], expected, rtol=1e-6)
        np.testing.assert_allclose(observation["goal"], (u, v), rtol=1e-6)

    def test_options_that_cannot_be_used_are_named(self, case):
        env = case.walled()
        y = env.nominal.goal[1]
        for options, message in (
            ({"pose": (1, 2)}, r"unknown reset options \['pose'\]; expected 'start'"),
            ({"start": (1e3, 1e3)}, "start .* lies outside the"),
            ({"start": (case.wall, y, 0)}, "start .* lies in an obstacle"),
            ({"goal": (case.touch + case.radius / 3, y)}, "too near"),
            ({"goal": env.nominal.start[:2]}, "already at the goal"),
            ({"start": (50,)}, "expected start to be 3 finite numbers"),
        ):
            with pytest.raises(TaskError, match=message):
                env.reset(options=options)
