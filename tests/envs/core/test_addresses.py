"""Arrays that compiled code finds by their addresses."""

import copy
import sys

import numpy as np
import pytest
from numba.core.errors import TypingError

from tdac_envs.core.addresses import Addresses, block, frozen, line, plane
from tdac_envs.core.compiled import kernel, read_only


@kernel
def _doubled(words):
    for array in (line(words[0], np.float64), plane(words[1], np.float64).ravel()):
        for i in range(array.size):
            array[i] *= 2.0
    whole = block(words[2], np.int64)
    for k in range(whole.shape[0]):
        whole[k] += whole.shape[1] * whole.shape[2]


@pytest.mark.slow
def test_arrays_are_found_with_their_shapes():
    """What compiled code writes is seen in the arrays themselves."""
    arrays = np.arange(3.0), np.ones((2, 2)), np.zeros((2, 3, 4), np.int64)
    _doubled(Addresses([arrays]).words[0])
    assert arrays[0].tolist() == [0.0, 2.0, 4.0]
    assert (arrays[1] == 2.0).all()
    assert (arrays[2] == 12).all()


@kernel
def _sum(array):
    return array.sum()


@kernel
def _frozen_sum(words):
    return _sum(frozen(plane(words[0], np.float64)))


@kernel
def _overwritten(words):
    frozen(plane(words[0], np.float64))[0, 0] = 1.0


def test_frozen_arrays_have_the_type_of_read_only_ones():
    """So that what reads them is compiled once for both, and nothing can write them."""
    array = np.arange(6.0).reshape(2, 3)
    words = Addresses([(array,)]).words[0]
    assert _frozen_sum(words) == _sum(read_only(array)) == 15.0
    assert len(getattr(_sum, "signatures", [()])) == 1
    with pytest.raises((TypingError, ValueError), match=r"read-?only"):
        _overwritten(words)


def test_one_row_is_replaced():
    """The others stay; the new arrays may have other shapes."""
    first, second, other = np.ones(2), np.ones(2), np.ones(5)
    flat, whole = np.ones((1, 1)), np.zeros((0, 1, 1), np.int64)
    rows = Addresses([(first, flat, whole), (second, flat, whole)])
    rows.put(0, (other, flat, whole))
    assert rows.words[0, 0].tolist() == [other.ctypes.data, 5, 0, 0]
    assert rows.words[1, 0].tolist() == [second.ctypes.data, 2, 0, 0]
    assert (rows.words[0, 1:, 0] == rows.words[1, 1:, 0]).all()


def test_arrays_with_gaps_are_refused():
    """Compiled code would read what is in between."""
    with pytest.raises(ValueError, match="expected C-contiguous arrays, got strides"):
        Addresses([(np.ones((4, 4))[:, ::2],)])


def test_addresses_are_not_copied():
    """A copy would write to memory that is not its own."""
    with pytest.raises(TypeError, match="cannot be copied or pickled"):
        copy.copy(Addresses([(np.ones(1),)]))


def test_an_interrupt_at_any_place_leaves_no_address_of_what_is_gone():
    """While a row's arrays are being replaced, the old ones and the new ones stay."""
    flat, whole = np.ones((1, 1)), np.zeros((0, 1, 1), np.int64)
    rows = Addresses([(np.ones(1), flat, whole)])
    for place in range(1, 30):
        _interrupted(lambda k=place: rows.put(0, (np.ones(k), flat, whole)), place)
        known = {array.ctypes.data for array in _arrays_in(rows._held)}
        assert set(rows.words[0, :, 0].tolist()) <= known


def _arrays_in(held):
    """The arrays in lists and tuples of any depth."""
    if isinstance(held, np.ndarray):
        return [held]
    return [array for each in held for array in _arrays_in(each)]


def _interrupted(call, place):
    """Makes a call that is interrupted before the so many-th line in this package."""
    left = place

    def trace(frame, event, _):
        nonlocal left
        if "tdac_envs" not in frame.f_code.co_filename:
            return None
        if event == "line":
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
        return trace

    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        pass
    finally:
        sys.settrace(None)
