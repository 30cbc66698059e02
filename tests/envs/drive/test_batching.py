"""Promises of a batch to libraries: it has what Gymnasium's own vectors have."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import VectorEnv

import tdac_envs  # noqa: F401 - registers the envs

IDS = ["TDAC-Map2D-v0", "TDAC-EPuck-v0"]
every_env = pytest.mark.parametrize("name", IDS)
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
