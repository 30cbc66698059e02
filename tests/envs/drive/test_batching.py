"""Promises of both batches: they are many single ones, only faster.

Libraries find in them what Gymnasium's own vectors have.
"""

import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_goes_on, assert_same
from gymnasium.vector import VectorEnv

import tdac_envs  # noqa: F401 - registers the envs

MAP2D, EPUCK = "TDAC-Map2D-v0", "TDAC-EPuck-v0"
IDS = [MAP2D, EPUCK]
every_env = pytest.mark.parametrize("name", IDS)
SLOPPY = {"wheel_slip": 0.1, "motor_lag": 0.1, "delay": 2}
NOISY = {
    MAP2D: {"range_noise": 0.1, **SLOPPY},
    EPUCK: {"sensor_noise": 1.0, **SLOPPY},
}
RANDOM = {"variation": "random", "horizon": 40}
JITTER = {"variation": "jitter", "horizon": 25}
BLOCK = {"on_collision": "block", "horizon": 33}
SENSORS = {"ground_sensors": True, "gps": True, "compass": True}
CASES = {
    "map": (MAP2D, {}),
    "map noisy": (MAP2D, {"map": "office", **RANDOM, **NOISY[MAP2D]}),
    "map block": (MAP2D, {"variation": "jitter", **BLOCK}),
    "world": (EPUCK, {"horizon": 55}),
    "world walls": (EPUCK, {"world": "maze"}),
    "world noisy": (EPUCK, {"world": "maze", **RANDOM, **NOISY[EPUCK]}),
    "world sensors": (EPUCK, {**JITTER, "sensor_noise": 0.5, **SENSORS}),
    "world block": (EPUCK, {"world": "room", **BLOCK, **SENSORS}),
}
OWN = {
    MAP2D: [
        {"map": "maze", "reward_weights": {"time": 0.5}},
        {"map": "cave", "dt": 0.02},
        {"map": "office", "range_noise": 0.0},
    ],
    EPUCK: [{"world": "maze"}, {"world": "yard", "dt": 0.016}, {"world": "clutter"}],
}
SHARED = {
    MAP2D: {"variation": "random", "range_noise": 0.1, **BLOCK},
    EPUCK: {"horizon": 30},
}


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_it_does_what_single_environments_do(case, mode):
    """Observations, rewards, ends and infos are Gymnasium's own, to the last bit."""
    count, kwargs, (name, options) = 5, {"autoreset_mode": mode}, CASES[case]
    many = gym.make_vec(name, count, "sync", vector_kwargs=kwargs, **options)
    batch = gym.make_vec(name, count, "vector_entry_point", **kwargs, **options)
    assert batch.single_observation_space == many.single_observation_space
    assert batch.observation_space == many.observation_space
    assert batch.action_space == many.action_space
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


@pytest.mark.slow
@every_env
@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_nothing(name, threads):
    """Every robot is stepped by one thread, so no result depends on how many."""
    one, many = (
        gym.make_vec(name, 300, threads=k, variation="jitter") for k in (1, threads)
    )
    for a, b in zip(one.reset(seed=5), many.reset(seed=5), strict=True):
        assert_same(a, b)
    for action in actions(300, 40):
        for a, b in zip(one.step(action), many.step(action), strict=True):
            assert_same(a, b)
    many.close()


@every_env
def test_each_robot_may_have_its_own_place_and_options(name):
    """Robot i has the arguments of entry i, which begin anew after the last."""
    each, more = OWN[name], SHARED[name]
    batch = gym.make_vec(name, 4, each=each, **more).unwrapped
    singles = [gym.make(name, **{**more, **each[i % 3]}).unwrapped for i in range(4)]
    observations, _ = batch.reset(seed=[7, 8, 9, 10])
    for i, env in enumerate(singles):
        first, _ = env.reset(seed=7 + i)
        assert_same(first, {key: value[i] for key, value in observations.items()})
    for action in 0.2 * actions(4, 25):
        observations, rewards, terminated, *_ = batch.step(action)
        assert observations in batch.observation_space
        assert not terminated.any()
        for i, env in enumerate(singles):
            single, reward, *_ = env.step(action[i])
            assert_same(single, {key: value[i] for key, value in observations.items()})
            assert rewards[i] == reward
    assert len({id(setup.nominal.field) for setup in batch.setups}) == 3


@every_env
def test_a_pickle_goes_on_where_the_batch_was(name):
    """Poses, tasks and random streams are kept."""
    batch = gym.make_vec(name, 3, variation="jitter", **NOISY[name]).unwrapped
    assert_goes_on(batch, 3)


MASKS = {
    "list": [True, False, True],
    "none": None,
    "shape": np.ones(2, bool),
    "ints": np.ones(3, int),
    "empty": np.zeros(3, bool),
}


@pytest.mark.parametrize("given", MASKS.values(), ids=MASKS)
def test_wrong_masks_are_named_as_gymnasium_names_them(given):
    """By the same type of error and the same words (before 1.3 it only asserts)."""
    errors = []
    for mode in ("vector_entry_point", "sync"):
        envs = gym.make_vec(IDS[0], 3, mode)
        envs.reset(seed=0)
        with pytest.raises((TypeError, ValueError, AssertionError)) as raised:
            envs.reset(options={"reset_mask": given})
        errors.append(raised)
        envs.close()
    ours, theirs = errors
    assert "reset_mask" in str(ours.value)
    assert ours.type in (TypeError, ValueError)
    if theirs.type is not AssertionError:
        assert (ours.type, str(ours.value)) == (theirs.type, str(theirs.value))


@every_env
def test_seeds_are_known_before_the_first_reset(name):
    """Each robot has its own, and begins as a single one does with it."""
    batch = gym.make_vec(name, 3, variation="jitter")
    seeds = batch.unwrapped.np_random_seed
    assert len(set(seeds)) == 3
    poses = batch.reset()[0]["pose"]
    assert batch.unwrapped.np_random_seed == seeds
    for seed, pose in zip(seeds, poses, strict=True):
        single = gym.make(name, variation="jitter")
        np.testing.assert_array_equal(single.reset(seed=seed)[0]["pose"], pose)
    batch.close()


@every_env
def test_gymnasium_is_a_direct_base(name):
    """skrl recognises an environment by the direct bases of its class."""
    batch = gym.make_vec(name, 2).unwrapped
    assert VectorEnv in type(batch).__bases__
    single = gym.make(name).unwrapped
    assert gym.Env in type(single).__bases__


@every_env
def test_a_call_gives_a_value_for_each_robot(name):
    """Of a method or an attribute, as in Gymnasium's `SyncVectorEnv`."""
    batch = gym.make_vec(name, 3, render_mode="rgb_array").unwrapped
    batch.reset(seed=0)
    assert len(batch.call("render")) == 3
    assert batch.call("np_random_seed") == (0, 1, 2)
    assert np.shape(batch.call("pose")) == (3, 3)
    assert batch.call("render_mode") == ("rgb_array",) * 3
