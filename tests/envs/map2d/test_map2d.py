"""Promises of TDAC-Map2D-v0 beyond those of every registered env."""

import json
import math

import brute_force
import gymnasium as gym
import numpy as np
import pytest

from tdac_envs.core.errors import MapError, TaskError
from tdac_envs.drive.rewards import RewardWeights, step_reward
from tdac_envs.map2d.env import Map2DEnv

FULL = np.ones(2, np.float32)
LEFT_TURN = np.array([-1.0, 1.0], np.float32)


def open_env(side=300, start=(50, 150, 0), goal=(250, 150), **more):
    return Map2DEnv(np.zeros((side, side), bool), start, goal, **more)


def walled_env(**more):
    """A wall from top to bottom at x = 150 .. 152, but for a gap at the top."""
    cells = np.zeros((300, 300), bool)
    cells[60:, 150:153] = True
    return Map2DEnv(cells, (50, 200, 0), (250, 200), **more)


class TestPicture:
    def test_a_left_turn_is_to_the_left_of_a_person_who_looks_along(self):
        """At heading 0 the robot looks right; a left turn leads up: y falls."""
        env = open_env()
        env.reset(seed=0)
        for _ in range(10):
            observation, *_ = env.step(np.array([0.5, 1.0], np.float32))
        assert observation["pose"][1] < 150
        assert observation["pose"][2] < 0

    def test_the_first_range_is_the_leftmost(self):
        """A block above the robot on the picture shortens ranges[0] only."""
        cells = np.zeros((300, 300), bool)
        cells[90:100, 100:200] = True
        env = Map2DEnv(cells, (150, 150, 0), (290, 280), robot_radius=5)
        ranges = env.reset(seed=0)[0]["ranges"]
        assert ranges[0] < 70
        assert ranges[-1] > 100

    def test_the_wheels_are_left_and_right(self):
        env = open_env()
        env.reset(seed=0)
        observation, *_ = env.step(np.array([0.25, 0.75], np.float32))
        np.testing.assert_array_equal(observation["wheel_speeds"], [0.25, 0.75])


class TestMotion:
    def test_full_speed_is_the_wheel_limit(self):
        env = open_env()
        env.reset(seed=0)
        observation, *_ = env.step(FULL)
        assert observation["pose"][0] == pytest.approx(50 + 75.59 * 0.05)

    def test_turning_in_place(self):
        env = open_env()
        env.reset(seed=0)
        for k in range(1, 60):
            observation, *_ = env.step(LEFT_TURN)
            expected = math.remainder(-k * 2 * 75.59 * 0.05 / 30, 2 * math.pi)
            assert observation["pose"][2] == pytest.approx(expected, abs=1e-5)
            np.testing.assert_array_equal(observation["pose"][:2], [50, 150])

    def wander(self, hold):
        """Way driven and farthest place of 2,000 steps of actions held so long."""
        env = open_env(1600, (800, 800, 0), (1500, 1500), on_collision="block")
        env.reset(seed=0)
        env.action_space.seed(1)
        places = [env.pose()[:2]]
        actions = [env.action_space.sample() for _ in range(2000 // hold)]
        for action in np.repeat(actions, hold, axis=0):
            env.step(action)
            places.append(env.pose()[:2])
        way = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
        return way, np.linalg.norm(np.array(places) - places[0], axis=1).max()

    def test_random_actions_move_the_robot(self):
        assert self.wander(hold=1)[0] > 2000

    def test_random_actions_that_are_held_lead_far_away(self):
        assert self.wander(hold=50)[1] > 300

    def test_a_wide_range_of_speeds_never_leaves_the_map(self):
        env = open_env(max_wheel_speed=4000.0, on_collision="block", horizon=500)
        env.reset(seed=0)
        env.action_space.seed(0)
        for _ in range(500):
            observation, _, terminated, *_ = env.step(env.action_space.sample())
            assert observation in env.observation_space
            assert (
                brute_force.distance(np.zeros((300, 300), bool), *env.pose()[:2]) > 14
            )
            if terminated:
                env.reset()


class TestEnds:
    def test_the_horizon_cuts_off(self):
        env = open_env(horizon=7)
        env.reset(seed=0)
        ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(7)]
        assert ends == [(False, False)] * 6 + [(False, True)]

    def test_the_goal_in_the_last_step_is_no_cut_off(self):
        env = open_env(start=(227, 150, 0), goal_tolerance=20, horizon=1)
        env.reset(seed=0)
        assert env.step(FULL)[2:4] == (True, False)


class TestActions:
    @pytest.mark.parametrize(
        "given", [(0.5, -0.25), [0.5, -0.25], np.array([0.5, -0.25])]
    )
    def test_two_numbers_of_any_kind(self, given):
        env = open_env()
        env.reset(seed=0)
        observation, *_ = env.step(given)
        np.testing.assert_array_equal(observation["wheel_speeds"], [0.5, -0.25])


class TestReward:
    def test_the_terms_add_up(self):
        weights = RewardWeights(progress=0.5, goal=8.0, collision=3.0, time=0.25)
        assert step_reward(weights, 0.0, False, False) == -0.25
        assert step_reward(weights, 1.0, False, False) == 0.25
        assert step_reward(weights, -1.0, False, True) == -3.75
        assert step_reward(weights, 0.5, True, False) == 8.0

    def test_weights_that_are_given_differ_and_the_others_stay(self):
        rewards = []
        for weights in (None, {"collision": 2.0, "time": 0.5}):
            env = walled_env(on_collision="block", reward_weights=weights)
            env.reset(seed=0)
            steps = [env.step(FULL) for _ in range(60)]
            rewards.append([step[1] for step in steps])
        hits = np.array([step[4]["collision"] for step in steps])
        assert 0 < hits.sum() < 60
        differ = np.subtract(*rewards[::-1])
        np.testing.assert_allclose(differ, 8.0 * hits - 0.49, atol=1e-9)

    def test_progress_sums_to_the_way_that_was_driven(self):
        env = walled_env(on_collision="block")
        _, info = env.reset(seed=0)
        env.action_space.seed(3)
        total, began = 0.0, info["path_distance"]
        for _ in range(200):
            _, reward, _, _, info = env.step(env.action_space.sample())
            total += reward + 0.01 + 10.0 * info["collision"]
        gained = (began - info["path_distance"]) / (75.59 * 0.05)
        assert total == pytest.approx(0.1 * gained, abs=1e-6)


class TestInfo:
    def test_observations_are_the_callers_own(self):
        env = open_env()
        first, _ = env.reset(seed=0)
        kept = {key: value.copy() for key, value in first.items()}
        second, *_ = env.step(FULL)
        for key, value in first.items():
            np.testing.assert_array_equal(value, kept[key])
            value[:] = 0
        assert env.step(FULL)[0]["goal"][0] == 250
        assert second["goal"][0] == 250


class TestNoise:
    def test_range_noise_is_relative_and_keeps_to_the_space(self):
        env = walled_env(range_noise=0.1)
        noisy = np.array([env.reset(seed=s)[0]["ranges"] for s in range(200)])
        exact = walled_env().reset(seed=0)[0]["ranges"]
        near = exact < 150
        spread = (noisy[:, near] / exact[near]).std()
        assert spread == pytest.approx(0.1, abs=0.02)
        assert noisy.max() <= np.float32(220.0)


class TestArguments:
    @pytest.mark.parametrize(
        ("given", "error", "message"),
        [
            ({"map": "spirel"}, MapError, "did you mean 'spiral'"),
            ({"start": (-5, 20)}, TaskError, "outside the map"),
            ({"start": (0, 0)}, TaskError, "outside of the closed wall around goal"),
            ({"start": (math.nan, 3)}, TaskError, "expected start to be 2 finite"),
            ({"on_collision": "stop"}, TaskError, "on_collision to be one of 'termin"),
            ({"variation": "wild"}, TaskError, "variation to be one of 'nominal', 'j"),
            ({"reward_weights": {"wall": 1}}, TaskError, "one of 'progress', 'goal'"),
            ({"reward_weights": {"time": -1}}, TaskError, "'time'] of at least 0"),
            ({"render_mode": "ansi"}, TaskError, "render_mode to be one of None, 'rg"),
            ({"n_rays": 0}, TaskError, "expected n_rays to be a whole number from 1"),
            ({"n_rays": 2.5}, TaskError, "expected n_rays to be a whole number from 1"),
            ({"n_rays": 10**6}, TaskError, "n_rays 1000000: .* less than or equal"),
            ({"field_of_view": 361}, TaskError, "field_of_view 361.0: .* 360"),
            ({"range_max": math.inf}, TaskError, "expected range_max to be"),
            ({"range_max": -1}, TaskError, "expected range_max above 0, got -1"),
            ({"axle_length": 0}, TaskError, "expected axle_length above 0, got 0"),
            ({"max_wheel_speed": "x"}, TaskError, "expected max_wheel_speed to be"),
            ({"robot_radius": -1}, TaskError, "expected robot_radius above 0"),
            ({"dt": 0}, TaskError, "expected dt above 0, got 0"),
            ({"dt": math.nan}, TaskError, "expected dt to be"),
            ({"goal_tolerance": -1}, TaskError, "expected goal_tolerance above 0"),
            ({"horizon": 0}, TaskError, "expected horizon to be a whole number from 1"),
            ({"heading": math.inf}, TaskError, "expected heading to be"),
            ({"range_noise": -0.1}, TaskError, "expected range_noise of at least 0"),
            ({"wheel_slip": math.nan}, TaskError, "expected wheel_slip to be"),
            ({"motor_lag": math.inf}, TaskError, "expected motor_lag to be"),
            ({"delay": 0.5}, TaskError, "expected delay to be a whole number from 0"),
            ({"delay": -1}, TaskError, "expected delay to be a whole number from 0"),
        ],
    )
    def test_what_cannot_be_used_is_named(self, given, error, message):
        with pytest.raises(error, match=message):
            Map2DEnv(**given)

    def test_numpy_numbers_are_taken(self):
        env = open_env(
            robot_radius=np.float32(10), n_rays=np.int64(3), horizon=np.int32(9)
        )
        assert env.task.robot.radius == 10.0
        assert env.reset(seed=0)[0]["ranges"].shape == (3,)
        assert env.task.horizon == 9

    def test_robot_and_sensor_options_reach_the_env(self):
        env = open_env(
            robot_radius=5,
            axle_length=7,
            max_wheel_speed=20,
            n_rays=4,
            field_of_view=90,
            range_max=33,
            dt=0.1,
        )
        robot = env.task.robot
        assert (robot.radius, robot.axle_length, robot.max_wheel_speed) == (5, 7, 20)
        assert env.reset(seed=0)[0]["ranges"].tolist() == [33.0] * 4
        assert env.metadata["render_fps"] == 10
        assert env.step(FULL)[0]["pose"][0] == 52.0

    def test_a_map_of_nested_lists_survives_json(self):
        cells = np.zeros((60, 90), bool).tolist()
        arguments = {"map": cells, "start": [20, 30], "goal": [70, 30]}
        env = gym.make("TDAC-Map2D-v0", **arguments, robot_radius=5)
        spec = gym.envs.registration.EnvSpec.from_json(env.spec.to_json())
        assert json.loads(json.dumps(spec.kwargs["map"])) == cells
        again = gym.make(spec)
        assert again.unwrapped.nominal.terrain is env.unwrapped.nominal.terrain

    def test_a_map_that_is_made_again_is_shared(self):
        one = gym.make("TDAC-Map2D-v0").unwrapped.nominal
        two = gym.make("TDAC-Map2D-v0", on_collision="block").unwrapped.nominal
        assert one.terrain is two.terrain
        assert one.field is two.field
