"""Arrays by their addresses: how a compiled step reads those of one robot, or of many.

A step takes up to twenty arrays. Passing each of them costs longer than the step of an
e-puck, and a batch has others for each robot, so that compiled code is given a table of
addresses and shapes instead.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np
from numba import carray, config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from tdac_envs.core.compiled import subkernel

Words = NDArray[np.int64]
_WORDS = 4
"""For each array: its address, and its shape in up to three dimensions."""


class Addresses:
    """Where the arrays of some rows are; it holds them, so that they stay there.

    Args:
        rows: Arrays of each row, C-contiguous, of as many dimensions in each row.

    Attributes:
        words: Shape (rows, arrays, 4): address, and shape filled up with zeros.
    """

    def __init__(self, rows: Iterable[tuple[NDArray[Any], ...]]) -> None:
        self._held: list[Any] = list(rows)
        self.words: Words = np.array([words_of(arrays) for arrays in self._held])

    def put(self, row: int, arrays: tuple[NDArray[Any], ...]) -> None:
        """Replaces the arrays of one row."""
        words = words_of(arrays)
        # At no time, should this be interrupted, is there an address of what is gone.
        self._held[row] = self._held[row], arrays
        self.words[row] = words
        self._held[row] = arrays

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("addresses of memory cannot be copied or pickled")


def words_of(arrays: Iterable[NDArray[Any]]) -> Words:
    """Where some arrays are, shape (arrays, 4), as long as somebody else holds them."""
    words = []
    for array in arrays:
        if not array.flags.c_contiguous:
            raise ValueError(
                f"expected C-contiguous arrays, got strides {array.strides}"
            )
        words.append((array.ctypes.data, *array.shape, 0, 0, 0)[:_WORDS])
    return np.array(words)


@intrinsic  # type: ignore[untyped-decorator]
def _compiled_pointer(_: Any, address: Any) -> Any:
    """A whole number as `carray` takes it, in compiled code."""

    def generate(context: Any, builder: Any, _: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), generate


_pointer = ctypes.c_void_p if config.DISABLE_JIT else _compiled_pointer


@subkernel
def line(words: Words, dtype: type[Any]) -> NDArray[Any]:
    """The array of one dimension with these four words."""
    array: NDArray[Any] = carray(_pointer(int(words[0])), (words[1],), dtype)
    return array


@subkernel
def plane(words: Words, dtype: type[Any]) -> NDArray[Any]:
    """The array of two dimensions with these words."""
    array: NDArray[Any] = carray(_pointer(int(words[0])), (words[1], words[2]), dtype)
    return array


@subkernel
def block(words: Words, dtype: type[Any]) -> NDArray[Any]:
    """The array of three dimensions with these words."""
    shape = words[1], words[2], words[3]
    array: NDArray[Any] = carray(_pointer(int(words[0])), shape, dtype)
    return array
