"""Promises of wrapped batches: each robot is told what a wrapped single one is told."""

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from tdac_envs.core.errors import TaskError
from tdac_envs.learning.wrapped_vector import WrappedVectorEnv
from tdac_envs.learning.wrappers import wrap

MAP = "TDAC-Map2D-v0"
EACH = [{"map": "rooms"}, {"map": "cave"}]
CASES = [
    (("goal-relative",), "SameStep", "jitter", EACH),
    (("goal-relative", "guidance", "flatten"), "SameStep", "random", EACH),
    (("goal-relative", "guidance", "flatten"), "NextStep", "jitter", EACH),
    (("goal-relative", "guidance", "flatten"), "SameStep", "mixed", EACH),
    (("guidance",), "SameStep", "jitter", [{"map": "rooms"}]),
    (("flatten", "flatten"), "SameStep", "random", [{"map": "rooms"}]),
    ((), "NextStep", "nominal", [{"map": "rooms"}]),
]


def batch(count, names, mode="SameStep", **options):
    made = gym.make_vec(MAP, count, autoreset_mode=mode, **options)
    return WrappedVectorEnv(made, names)


def assert_equal(one, two):
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            np.testing.assert_array_equal(one[key], two[key])
    else:
        np.testing.assert_array_equal(one, two)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(("names", "mode", "variation", "each"), CASES)
def test_it_tells_what_wrapped_single_environments_tell(names, mode, variation, each):
    """To the last bit, also at the ends of episodes and after them."""
    options = {"variation": variation, "horizon": 12, "range_noise": 0.1}
    made = [{**options, **each[i % len(each)]} for i in range(4)]
    single = [lambda kw=kw: wrap(gym.make(MAP, **kw), names) for kw in made]
    many = SyncVectorEnv(single, autoreset_mode=mode)
    ours = batch(4, names, mode, each=each, **options)
    assert ours.observation_space == many.observation_space
    assert_equal(many.reset(seed=5)[0], ours.reset(seed=5)[0])
    random, ends = np.random.default_rng(1), 0
    for _ in range(40):
        actions = random.uniform(-1.0, 1.0, (4, 2)).astype(np.float32)
        first, second = many.step(actions), ours.step(actions)
        assert_equal(first[0], second[0])
        assert second[0] in ours.observation_space
        over = first[2] | first[3]
        ends += over.sum()
        if mode == "SameStep":
            for i in np.flatnonzero(over):
                assert_equal(first[4]["final_obs"][i], second[4]["final_obs"][i])
    assert ends >= 8
    many.close()
    ours.close()


def test_a_pickle_goes_on_alike():
    """A copy in another process tells the same."""
    one = batch(3, ("goal-relative", "guidance", "flatten"), variation="jitter")
    one.reset(seed=0)
    two = pickle.loads(pickle.dumps(one))
    actions = np.full((3, 2), 0.5, np.float32)
    assert_equal(one.step(actions)[0], two.step(actions)[0])


def test_what_cannot_be_wrapped_is_refused():
    """By one line that says what was expected."""
    with pytest.raises(TaskError, match="unknown wrapper 'relative'; expected some of"):
        batch(2, ["relative"])
    with pytest.raises(TaskError, match="expected observations in a Dict"):
        batch(2, ["flatten", "guidance"])
    with pytest.raises(TaskError, match="observations with a goal, and a pose"):
        batch(2, ["goal-relative", "goal-relative"])
    with pytest.raises(TaskError, match="expected a batch made by"):
        WrappedVectorEnv(gym.make_vec("CartPole-v1", 2), ())
