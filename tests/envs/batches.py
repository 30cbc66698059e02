"""Actions for batched environments, and whether two of these agree."""

import pickle

import numpy as np


def assert_same(one, two):
    """Equal to the last bit, types included."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            assert_same(one[key], two[key])
    elif one is None or isinstance(one, str):
        assert one == two
    elif one.dtype == object:
        for a, b in zip(one, two, strict=True):
            assert_same(a, b)
    else:
        assert one.dtype == two.dtype
        np.testing.assert_array_equal(one, two)


def assert_alike(many, batch, seed, script):
    """A batch does what the single environments do; yields the result of each step."""
    for one, two in zip(many.reset(seed=seed), batch.reset(seed=seed), strict=True):
        assert_same(one, two)
    for action in script:
        expected, result = many.step(action), batch.step(action)
        for one, two in zip(expected, result, strict=True):
            assert_same(one, two)
        yield result


def actions(count, steps, seed=0):
    """Random actions, now and then straight ahead or out of range."""
    random = np.random.default_rng(seed)
    drawn = random.uniform(-1.2, 1.2, (steps, count, 2)).astype(np.float32)
    for k in range(0, steps, 3):
        drawn[k : k + 2, k % count] = 1.0
    drawn[steps // 2 :, : count // 2] = 1.0
    return drawn


def assert_goes_on(batch, count):
    """A pickle of a batch goes on where the batch is after some steps."""
    batch.reset(seed=2)
    script = actions(count, 40)
    for action in script[:20]:
        batch.step(action)
    twin = pickle.loads(pickle.dumps(batch))
    for action in script[20:]:
        for one, two in zip(batch.step(action), twin.step(action), strict=True):
            assert_same(one, two)
