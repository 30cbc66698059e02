"""Promises of `wrap_for_rl`: one call for single and batched environments."""

import gymnasium as gym
import numpy as np
import pytest

from tdac_envs import wrap_for_rl
from tdac_envs.core.errors import TaskError
from tdac_envs.learning.wrappers import GoalRelativeObservation, Guidance

IDS = ["TDAC-Map2D-v0", "TDAC-EPuck-v0"]


@pytest.mark.parametrize("name", IDS)
def test_one_call_flattens_scales_and_makes_goal_relative(name):
    """As the three wrappers do; a batch and Gymnasium's own vector agree with it."""
    options = {"variation": "jitter"}
    env = wrap_for_rl(gym.make(name, **options))
    long = Guidance(GoalRelativeObservation(gym.make(name, **options)))
    long = gym.wrappers.FlattenObservation(long)
    batch = wrap_for_rl(gym.make_vec(name, 2, **options))
    vector = gym.make_vec(name, 2, "sync", wrappers=[wrap_for_rl], **options)
    space = env.observation_space
    assert space == long.observation_space == batch.single_observation_space
    assert (space.low.min(), space.high.max(), space.dtype) == (-1, 1, np.float32)
    first = env.reset(seed=4)[0]
    np.testing.assert_array_equal(first, long.reset(seed=4)[0])
    for envs in (batch, vector):
        np.testing.assert_array_equal(first, envs.reset(seed=4)[0][0])
    action = np.array([0.5, 0.7], np.float32)
    seen, reward, *_ = env.step(action)
    assert reward == gym.Wrapper.step(long, action)[1]
    for envs in (batch, vector):
        found = envs.step(np.stack([action, action]))
        np.testing.assert_array_equal(seen, found[0][0])
        assert found[1][0] == reward
        envs.close()


def test_sensors_alone():
    """Without guidance, which knows the map."""
    names = ("goal-relative", "flatten")
    whole = wrap_for_rl(gym.make(IDS[0])).observation_space.shape
    alone = wrap_for_rl(gym.make(IDS[0]), names).observation_space.shape
    assert alone[0] == whole[0] - 2


@pytest.mark.parametrize("made", [gym.make, gym.make_vec])
def test_what_cannot_be_wrapped_is_refused(made):
    """In one line that says what was expected."""
    with pytest.raises(TaskError, match=r"expected an environment of|a batch made by"):
        wrap_for_rl(made("CartPole-v1"))
    with pytest.raises(TaskError, match="unknown wrapper 'flat'"):
        wrap_for_rl(made(IDS[0]), ["flat"])
