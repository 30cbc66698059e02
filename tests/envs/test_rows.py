"""Many calls of one kernel, in one go."""

import copy
import threading

import numpy as np
import pytest

from tdac_envs.compiled import kernel
from tdac_envs.rows import Rows


@kernel("f8[:] i8[:] ->")
def _scaled(values, factor):
    for i in range(values.shape[0]):
        values[i] *= factor[0]


@kernel("i8[:] ->")
def _inverted(value):
    value[0] = 100 // value[0]


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1000])
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_row_is_called_once(count, threads):
    """With arrays of any length; whatever the number of threads."""
    arrays = [np.arange(1.0 + k % 7) for k in range(count)]
    rows = Rows(_scaled, [(a, np.array([k])) for k, a in enumerate(arrays)], threads)
    rows.call_all()
    rows.close()
    for k, array in enumerate(arrays):
        np.testing.assert_array_equal(array, k * np.arange(1.0 + k % 7))


def test_one_row_alone_and_with_other_arrays():
    """Only that one is written to; what was put in its place counts."""
    first, second, other = np.ones(2), np.ones(2), np.ones(3)
    rows = Rows(_scaled, [(first, np.array([2])), (second, np.array([3]))])
    rows.call(1)
    rows.put(0, other, np.array([5]))
    rows.call(0)
    assert (first.tolist(), second.tolist()) == ([1, 1], [3, 3])
    assert other.tolist() == [5, 5, 5]
    rows.put(1, first, np.array([7]))
    rows.call_all()
    assert (first.tolist(), second.tolist()) == ([7, 7], [3, 3])
    assert other.tolist() == [25, 25, 25]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_failing_row_is_told(threads):
    """As with one call; the others are made all the same."""
    values = [np.array([k % 200]) for k in range(300)]
    rows = Rows(_inverted, [(value,) for value in values], threads)
    with pytest.raises(ArithmeticError, match="_inverted failed"):
        rows.call_all()
    assert values[299][0] == 100 // 99
    with pytest.raises(ArithmeticError, match="_inverted failed"):
        rows.call(0)
    rows.close()


def test_threads_end_with_the_rows():
    """Closing leaves none behind; the next call starts them again."""
    arguments = [(np.ones(1), np.array([1])) for _ in range(500)]
    rows = Rows(_scaled, arguments, 3)
    before = threading.active_count()
    for _ in range(2):
        rows.call_all()
        rows.close()
        assert threading.active_count() == before


def test_addresses_are_not_copied():
    """A copy would write to memory that is not its own."""
    with pytest.raises(TypeError, match="cannot be copied"):
        copy.copy(Rows(_scaled, [(np.ones(1), np.array([1]))]))
