"""Tables of array addresses, through which compiled code reads each robot's arrays.

A step needs up to twenty arrays. Passing them one by one takes longer than the step of
an e-puck itself, and in a batch each robot has its own arrays. So compiled code takes a
single table of addresses and shapes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from typing import Any

import numpy as np
from numba import carray, config, types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic
from numpy.typing import NDArray

from tdac_envs.core.compiled import read_only, subkernel

Words = NDArray[np.int64]
_WORDS = 4
"""Words per array: its address, and its shape in up to three dimensions."""


class Addresses:
    """A table of the addresses of arrays; it keeps the arrays alive.

    Args:
        rows: The C-contiguous arrays of each row. All rows have the same number of
            arrays, with the same numbers of dimensions.

    Attributes:
        words: Shape (rows, arrays, 4): address, and shape padded with zeros.
    """

    def __init__(self, rows: Iterable[tuple[NDArray[Any], ...]]) -> None:
        self._held: list[Any] = list(rows)
        self.words: Words = np.array([words_of(arrays) for arrays in self._held])

    def put(self, row: int, arrays: tuple[NDArray[Any], ...]) -> None:
        """Replaces the first arrays of one row, as many as are given."""
        words, held = words_of(arrays), self._held[row]
        # Keep both until the address is replaced, in case of an interrupt in between.
        self._held[row] = held, arrays
        self.words[row, : len(arrays)] = words
        self._held[row] = *arrays, *held[len(arrays) :]

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("memory addresses cannot be copied or pickled")


def words_of(arrays: Iterable[NDArray[Any]]) -> Words:
    """The words of arrays, shape (arrays, 4); the caller must keep the arrays alive."""
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
    """Converts an integer to a pointer for `carray`, in compiled code."""

    def generate(context: Any, builder: Any, _: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), generate


@intrinsic  # type: ignore[untyped-decorator]
def _compiled_frozen(_: Any, array: Any) -> Any:
    """Changes the type of an array to that of a read-only one, in compiled code."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return impl_ret_borrowed(context, builder, signature.return_type, args[0])

    return array.copy(readonly=True)(array), generate


def _plain_frozen(array: NDArray[Any]) -> NDArray[Any]:
    return read_only(array)


_pointer = ctypes.c_void_p if config.DISABLE_JIT else _compiled_pointer
frozen = _plain_frozen if config.DISABLE_JIT else _compiled_frozen
"""Compiled code: the same array, of the type that `read_only` arrays have.

A subkernel that only reads it is then compiled once for addresses and for arguments.
"""


@subkernel
def line(words: Words, dtype: type[Any]) -> NDArray[Any]:
    """The one-dimensional array that the four words describe."""
    array: NDArray[Any] = carray(_pointer(int(words[0])), (words[1],), dtype)
    return array


@subkernel
def plane(words: Words, dtype: type[Any]) -> NDArray[Any]:
    """The two-dimensional array that the four words describe."""
    array: NDArray[Any] = carray(_pointer(int(words[0])), (words[1], words[2]), dtype)
    return array


@subkernel
def block(words: Words, dtype: type[Any]) -> NDArray[Any]:
    """The three-dimensional array that the four words describe."""
    shape = words[1], words[2], words[3]
    array: NDArray[Any] = carray(_pointer(int(words[0])), shape, dtype)
    return array
