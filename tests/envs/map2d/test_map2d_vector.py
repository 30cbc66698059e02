"""Promises of the batched TDAC-Map2D-v0 beyond those of every batch."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_same
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

import tdac_envs
from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.vector import Map2DVectorEnv

NAME = "TDAC-Map2D-v0"


def test_options_of_reset_reach_all_robots():
    """A start and a goal are those of every robot that is reset."""
    batch = Map2DVectorEnv(3, map="office")
    task = batch.setups[0].nominal
    start = (task.start.x, task.start.y, 1.0)
    observations, _ = batch.reset(seed=0, options={"start": start})
    np.testing.assert_allclose(observations["pose"], [start] * 3, rtol=1e-6)
    with pytest.raises(TaskError, match="unknown reset options"):
        batch.reset(options={"begin": start})


def test_a_masked_reset_leaves_the_others_alone():
    """Only the robots in the mask begin anew, from the seeds given for them."""
    batch = Map2DVectorEnv(3, variation="jitter")
    before, _ = batch.reset(seed=1)
    mask = np.array([False, True, False])
    options = {"reset_mask": mask}
    after, infos = batch.reset(seed=50, options=options)
    assert options == {"reset_mask": mask}
    for key in before:
        np.testing.assert_array_equal(after[key][~mask], before[key][~mask])
    assert (after["pose"][1] != before["pose"][1]).any()
    assert infos["_clearance"].tolist() == mask.tolist()
    single = Map2DEnv(variation="jitter")
    np.testing.assert_array_equal(single.reset(seed=51)[0]["pose"], after["pose"][1])


def test_observations_are_the_callers_own():
    """What a step returned is not changed by the next one, nor the other way round."""
    batch = Map2DVectorEnv(4)
    first, _ = batch.reset(seed=0)
    kept = {key: value.copy() for key, value in first.items()}
    second, *_ = batch.step(np.ones((4, 2), np.float32))
    assert_same(first, kept)
    for value in second.values():
        value[:] = 0.0
    third, *_ = batch.step(np.ones((4, 2), np.float32))
    way = np.linalg.norm(third["pose"][:, :2] - kept["pose"][:, :2], axis=1)
    np.testing.assert_allclose(way, 2 * 75.59 * 0.05, rtol=1e-4)
    assert (third["goal"] == kept["goal"]).all()


@pytest.mark.parametrize("lay", [np.asfortranarray, np.ndarray.tolist, np.float32])
def test_actions_of_any_layout_are_the_same(lay):
    """Lists, and arrays in any order and of any type."""
    one, two = (Map2DVectorEnv(100, threads=2) for _ in range(2))
    for env in (one, two):
        env.reset(seed=0)
    action = actions(100, 1)[0].astype(np.float64)
    for a, b in zip(one.step(action), two.step(lay(action)), strict=True):
        assert_same(a, b)


def test_a_mask_of_any_layout_is_the_same():
    """Also one that is a part of a larger array."""
    one, two = (Map2DVectorEnv(4, variation="jitter") for _ in range(2))
    mask = np.array([True, False, False, True])
    for env, given in ((one, mask), (two, np.repeat(mask, 2)[::2])):
        env.reset(seed=0)
        env.reset(seed=9, options={"reset_mask": given})
    np.testing.assert_array_equal(one.pose(), two.pose())


@pytest.mark.parametrize(
    "given",
    [np.ones((2, 2)), np.ones((3, 3)), np.full((3, 2), np.nan), None, "ab", [[1]]],
)
def test_actions_of_another_kind_are_refused_and_change_nothing(given):
    """The message says what was expected."""
    batch = Map2DVectorEnv(3)
    batch.reset(seed=0)
    before = batch.pose()
    with pytest.raises(ValueError, match="expected actions of two finite numbers"):
        batch.step(given)
    np.testing.assert_array_equal(batch.pose(), before)


def test_wrong_actions_of_many_are_told_in_few_words():
    """With the robot that they are for."""
    batch = Map2DVectorEnv(200)
    batch.reset(seed=0)
    actions = np.ones((200, 2), np.float32)
    actions[17, 1] = np.nan
    with pytest.raises(ValueError, match=r"got \[1.0, nan\] for robot 17$"):
        batch.step(actions)
    with pytest.raises(ValueError, match=r"got an array of shape \(2, 200\)$"):
        batch.step(actions.T)


def test_no_robot_is_stepped_before_its_first_reset():
    """As in a single environment."""
    batch, still = Map2DVectorEnv(3), np.zeros((3, 2), np.float32)
    with pytest.raises(ResetNeeded, match=r"reset\(\) of all robots before step"):
        batch.step(still)
    batch.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(ResetNeeded, match=r"reset\(\) of all robots before step"):
        batch.step(still)
    batch.reset(options={"reset_mask": np.array([False, True, False])})
    batch.step(still)


def test_without_autoreset_an_ended_episode_is_not_stepped():
    """The message says which robots are to be reset, and how."""
    batch = Map2DVectorEnv(3, autoreset_mode=AutoresetMode.DISABLED, horizon=1)
    batch.reset(seed=0)
    still = np.zeros((3, 2), np.float32)
    assert batch.step(still)[3].all()
    with pytest.raises(ResetNeeded, match=r"reset_mask.*\[0, 1, 2\]"):
        batch.step(still)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"num_envs": 0}, "num_envs to be a whole number from 1"),
        ({"autoreset_mode": "Never"}, "autoreset_mode to be one of 'NextStep'"),
        ({"threads": 0}, "threads to be a whole number from 1"),
        ({"render_mode": "human"}, "expected render_mode None"),
        ({"render_mode": "rgb_array", "num_envs": 65}, "more than 64 robots"),
        ({"each": {"map": "maze"}}, "expected each to be a list of dicts"),
        ({"each": ["maze"]}, "expected each to be a list of dicts"),
        ({"each": [{}, {}, {}]}, "each has 3 entries for 2 robots"),
        ({"each": [{}, {"start": (0, 0)}]}, r"each\[1\]: .*start \(0, 0\)"),
        ({"each": [{"n_rays": 3}, {"n_rays": 4}]}, "the same n_rays and delay"),
        ({"map": "mase"}, "did you mean 'maze'"),
    ],
)
def test_wrong_arguments_are_named(options, message):
    with pytest.raises(tdac_envs.TdacError, match=message):
        Map2DVectorEnv(**{"num_envs": 2, **options})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": [1, 2]}, "expected 3 seeds"),
        ({"seed": 1.5}, "expected a whole number as seed, or 3 of them"),
        ({"options": "start"}, "expected options to be a dict"),
    ],
)
def test_wrong_seeds_and_masks_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Map2DVectorEnv(3).reset(**arguments)


def test_gymnasium_makes_it_by_default_and_without_a_warning():
    """`make_vec` takes the batch where no other mode is asked for."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        batch = gym.make_vec(f"tdac_envs:{NAME}", num_envs=2)
    assert isinstance(batch.unwrapped, Map2DVectorEnv)
    assert batch.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    wrapped = gym.wrappers.vector.RecordEpisodeStatistics(batch)
    wrapped.reset(seed=0)
    wrapped.step(wrapped.action_space.sample())
