"""Promises of TDAC-Map2D-v0 beyond those of every registered env."""

import json
import math
import pickle

import brute_force
import gymnasium as gym
import numpy as np
import pytest

from tdac_envs.core.errors import MapError, TaskError
from tdac_envs.drive.rewards import RewardWeights, step_reward
from tdac_envs.map2d.env import Map2DEnv

FULL = np.ones(2, np.float32)
LEFT_TURN = np.array([-1.0, 1.0], np.float32)
NOISY = {"range_noise": 0.3, "wheel_slip": 0.4, "motor_lag": 0.1, "delay": 3}


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
    def drive(self, env, action, steps=10_000):
        for _ in range(steps):
            result = env.step(action)
            if result[2] or result[3]:
                break
        return result

    def test_the_goal_ends_the_episode(self):
        env = open_env()
        env.reset(seed=0)
        _, reward, terminated, truncated, info = self.drive(env, FULL)
        assert (terminated, truncated, info["is_success"]) == (True, False, True)
        assert info["distance_to_goal"] <= env.task.goal_tolerance == 20.0
        assert reward > 9

    def test_a_goal_behind_a_wall_is_not_reached(self):
        cells = np.zeros((300, 300), bool)
        cells[60:, 150] = True
        options = {"robot_radius": 4, "goal_tolerance": 30, "on_collision": "block"}
        env = Map2DEnv(cells, (50, 200, 0), (160, 200), **options)
        env.reset(seed=0)
        for _ in range(100):
            _, _, terminated, _, info = env.step(FULL)
            assert not info["is_success"]
            assert not terminated
        assert info["distance_to_goal"] < 30
        assert info["collisions"] > 50

    def test_a_collision_ends_the_episode(self):
        env = walled_env()
        env.reset(seed=0)
        _, reward, terminated, truncated, info = self.drive(env, FULL)
        assert (terminated, truncated) == (True, False)
        assert (info["collision"], info["collisions"]) == (True, 1)
        assert not info["is_success"]
        assert reward < -9
        assert env.pose()[0] == pytest.approx(149.5 - 15, abs=2e-6)

    def test_blocked_at_a_wall_it_stays_out_and_may_leave(self):
        env = walled_env(on_collision="block")
        env.reset(seed=0)
        cells = env.task.terrain.grid.cells
        for _ in range(1000):
            _, _, terminated, _, info = env.step(FULL)
            assert not terminated
        assert env.pose()[0] <= 149.5 - 15 + 1e-6
        assert brute_force.distance(cells, *env.pose()[:2]) >= 15 - 1e-6
        assert 900 < info["collisions"] < 1000
        for _ in range(20):
            _, _, _, _, info = env.step(-FULL)
            assert not info["collision"]
        assert env.pose()[0] == pytest.approx(134.5 - 20 * 75.59 * 0.05, abs=1e-4)

    def test_the_horizon_cuts_off(self):
        env = open_env(horizon=7)
        env.reset(seed=0)
        ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(7)]
        assert ends == [(False, False)] * 6 + [(False, True)]

    def test_the_goal_in_the_last_step_is_no_cut_off(self):
        env = open_env(start=(227, 150, 0), goal_tolerance=20, horizon=1)
        env.reset(seed=0)
        assert env.step(FULL)[2:4] == (True, False)

    def test_the_default_horizon(self):
        env = walled_env(dt=0.01)
        formula = math.ceil(6 * env.task.shortest / (75.59 * 0.01))
        assert env.task.horizon == formula > 2500
        assert walled_env().task.horizon == 2500


class TestActions:
    @pytest.mark.parametrize(
        "given", [(0.5, -0.25), [0.5, -0.25], np.array([0.5, -0.25])]
    )
    def test_two_numbers_of_any_kind(self, given):
        env = open_env()
        env.reset(seed=0)
        observation, *_ = env.step(given)
        np.testing.assert_array_equal(observation["wheel_speeds"], [0.5, -0.25])

    @pytest.mark.parametrize("given", [(3.0, -9.0), np.array([2, -2]), (1e300, -1e300)])
    def test_too_much_is_clipped_and_counted(self, given):
        env = open_env()
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
    def test_anything_else_is_refused_and_changes_nothing(self, given):
        env = open_env()
        env.reset(seed=0)
        with pytest.raises(ValueError, match="expected an action of two finite"):
            env.step(given)
        assert env.pose().tolist() == [50, 150, 0]


class TestReward:
    def test_the_terms_add_up(self):
        weights = RewardWeights(progress=0.5, goal=8.0, collision=3.0, time=0.25)
        assert step_reward(weights, 0.0, False, False) == -0.25
        assert step_reward(weights, 1.0, False, False) == 0.25
        assert step_reward(weights, -1.0, False, True) == -3.75
        assert step_reward(weights, 0.5, True, False) == 8.0

    def test_a_full_step_towards_the_goal_is_one_unit_of_progress(self):
        env = open_env()
        env.reset(seed=0)
        rewards = [env.step(FULL)[1] for _ in range(20)]
        assert np.mean(rewards) == pytest.approx(0.1 - 0.01, abs=1e-3)
        assert env.step(-FULL)[1] == pytest.approx(-0.1 - 0.01, abs=0.01)

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
    def test_keys_and_types(self):
        expected = {
            "is_success": bool,
            "collision": bool,
            "collisions": int,
            "clipped": int,
            "distance_to_goal": float,
            "path_distance": float,
            "clearance": float,
        }
        env = walled_env()
        infos = [env.reset(seed=0)[1], env.step(FULL)[4]]
        infos.append(TestEnds().drive(env, FULL)[4])
        contacts = [info.pop("contact") for info in infos]
        assert contacts == [None, None, "wall"]
        for info in infos:
            assert {key: type(value) for key, value in info.items()} == expected

    def test_types_of_a_step(self):
        env = open_env()
        env.reset(seed=0)
        observation, reward, terminated, truncated, _ = env.step(FULL)
        assert [type(v) for v in (reward, terminated, truncated)] == [float, bool, bool]
        assert {v.dtype for v in observation.values()} == {np.dtype(np.float32)}

    def test_values_at_the_start(self):
        _, info = walled_env().reset(seed=0)
        assert info["distance_to_goal"] == 200.0
        assert info["path_distance"] > 300.0
        assert info["clearance"] == 50.5

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
    def rollout(self, env, seed, steps=200):
        env.action_space.seed(0)
        rows = [env.reset(seed=seed)[0]]
        for _ in range(steps):
            observation, *_ = env.step(env.action_space.sample())
            assert observation in env.observation_space
            rows.append(observation)
        return np.array([np.concatenate(list(row.values())) for row in rows])

    def test_it_is_seeded(self):
        env = walled_env(on_collision="block", **NOISY)
        one, two = self.rollout(env, 5), self.rollout(env, 5)
        np.testing.assert_array_equal(one, two)
        assert (self.rollout(env, 6) != one).any()

    def test_it_is_off_by_default(self):
        one, two = (self.rollout(walled_env(), seed, 30) for seed in (1, 2))
        np.testing.assert_array_equal(one, two)

    def test_a_delay_holds_actions_back(self):
        env = open_env(delay=2)
        env.reset(seed=0)
        speeds = [env.step(FULL)[0]["wheel_speeds"][0] for _ in range(4)]
        assert speeds == [0, 0, 1, 1]

    def test_a_lag_follows_an_exponential(self):
        env = open_env(motor_lag=0.1)
        env.reset(seed=0)
        speeds = [env.step(FULL)[0]["wheel_speeds"][1] for _ in range(5)]
        expected = 1 - np.exp(-0.5 * np.arange(1, 6))
        np.testing.assert_allclose(speeds, expected, rtol=1e-5)

    def test_slip_moves_the_robot_but_not_the_wheel_speeds(self):
        env = open_env(wheel_slip=0.2)
        env.reset(seed=0)
        observation, *_ = env.step(0.5 * FULL)
        np.testing.assert_array_equal(observation["wheel_speeds"], [0.5, 0.5])
        assert observation["pose"][2] != 0.0

    def test_range_noise_is_relative_and_keeps_to_the_space(self):
        env = walled_env(range_noise=0.1)
        noisy = np.array([env.reset(seed=s)[0]["ranges"] for s in range(200)])
        exact = walled_env().reset(seed=0)[0]["ranges"]
        near = exact < 150
        spread = (noisy[:, near] / exact[near]).std()
        assert spread == pytest.approx(0.1, abs=0.02)
        assert noisy.max() <= np.float32(220.0)


class TestVariations:
    def test_nominal_is_always_the_same(self):
        env = walled_env()
        poses = [env.reset(seed=s)[0]["pose"].tolist() for s in range(3)]
        assert poses == [[50, 200, 0]] * 3

    def test_jitter_starts_near_and_differs(self):
        env = walled_env(variation="jitter")
        poses = np.array([env.reset(seed=s)[0]["pose"] for s in range(50)])
        assert np.hypot(poses[:, 0] - 50, poses[:, 1] - 200).max() <= 15
        assert len(np.unique(poses[:, 0])) == 50
        np.testing.assert_array_equal(env.reset(seed=7)[0]["pose"], poses[7])

    def test_mixed_starts_near_or_all_over_the_map_and_keeps_the_goal(self):
        env = walled_env(variation="mixed")
        poses = []
        for seed in range(60):
            observation, info = env.reset(seed=seed)
            poses.append(observation["pose"])
            assert observation in env.observation_space
            assert 0.0 < info["path_distance"] < math.inf
            assert info["clearance"] >= 15
            assert env.task.goal == env.nominal.goal
            assert env.task.horizon == env.nominal.horizon
        x, y, heading = np.array(poses).T
        assert min(np.ptp(x), np.ptp(y)) > 200
        assert np.ptp(heading) > 6.0
        near = (np.hypot(x - 50, y - 200) <= 15) & (np.abs(heading) <= 0.5)
        assert 15 < near.sum() < 45
        np.testing.assert_array_equal(env.reset(seed=7)[0]["pose"], poses[7])

    def test_random_draws_start_and_goal_with_their_own_horizon(self):
        env = walled_env(variation="random", dt=0.01)
        for seed in range(10):
            observation, info = env.reset(seed=seed)
            assert observation in env.observation_space
            formula = math.ceil(6 * info["path_distance"] / (75.59 * 0.01))
            assert env.task.horizon == max(2500, formula)
            assert observation["goal"].tolist() == list(env.task.goal)
        assert env.nominal.goal == (250.0, 200.0)

    def test_random_keeps_a_horizon_that_was_given(self):
        env = walled_env(variation="random", horizon=99)
        env.reset(seed=0)
        assert env.task.horizon == 99

    def test_options_set_start_and_goal_for_one_episode(self):
        env = walled_env(variation="jitter")
        options = {"start": (60, 100, 7.0), "goal": [240, 120]}
        observation, _ = env.reset(seed=0, options=options)
        expected = [60, 100, 7.0 - 2 * math.pi]
        np.testing.assert_allclose(observation["pose"], expected, rtol=1e-6)
        assert observation["goal"].tolist() == [240, 120]
        observation, _ = env.reset(options={"start": (61, 100)})
        assert observation["pose"].tolist() == [61, 100, 0]
        assert observation["goal"].tolist() == [250, 200]

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"pose": (1, 2)}, r"unknown reset options \['pose'\]; expected 'start'"),
            ({"start": (151, 200, 0)}, "start .* lies in an obstacle"),
            ({"goal": (140, 200)}, "goal .* too near"),
            ({"goal": (50, 201)}, "already at the goal"),
            ({"start": (50,)}, "expected start to be 3 finite numbers"),
        ],
    )
    def test_options_that_cannot_be_used(self, options, message):
        env = walled_env()
        with pytest.raises(TaskError, match=message):
            env.reset(options=options)

    def test_a_deep_pickle_in_the_middle_of_an_episode_goes_on_alike(self):
        env = walled_env(variation="jitter", **NOISY)
        env.reset(seed=3)
        for _ in range(10):
            env.step(FULL)
        twin = pickle.loads(pickle.dumps(env))
        for _ in range(20):
            one, two = env.step(LEFT_TURN), twin.step(LEFT_TURN)
            assert one[1:] == two[1:]
            for key in one[0]:
                np.testing.assert_array_equal(one[0][key], two[0][key])


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
