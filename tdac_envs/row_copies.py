"""What `tdac_envs.row_loop` copies before and after the call of a row."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.row_loop import N_PIECE, TO_FLAG, TO_WHOLE

Arrays = Sequence[NDArray[Any]]
Columns = Mapping[np.dtype[Any], Arrays]
Words = NDArray[np.int64]

# Where the ends of a copy are in its words, and the bytes of a row.
_TO, _FROM, _LENGTH = 0, 2, 4
_ALIGNED = 64
_BECOMES = {np.dtype(np.int64): TO_WHOLE, np.dtype(np.bool_): TO_FLAG}


class Outputs:
    """Arrays whose rows are copied into new ones, which are allocated all at once.

    Args:
        arrays: Each has a row for each row, which lies in one piece.
        columns: Arrays with a float64 for each row, by what the numbers become:
            float64, int64, or bool, which is whether they are not 0.

    Attributes:
        pieces: The copies, for the loop; where to is told from the new arrays' begin.
    """

    def __init__(self, arrays: Arrays, columns: Columns) -> None:
        self._kept = arrays, columns
        kinds = [(array.shape, array.dtype) for array in arrays]
        copied = [_pieces(arrays, _FROM)]
        copied[0][:, _TO + 1] = copied[0][:, _LENGTH]
        for dtype, several in columns.items():
            pieces = _pieces(several, _FROM)
            pieces[:, _TO + 1] = dtype.itemsize
            pieces[:, _LENGTH] = _BECOMES.get(dtype, dtype.itemsize)
            copied.append(pieces)
            kinds.append(((len(several), len(several[0])), dtype))
        self.pieces = np.concatenate(copied)
        sizes = [math.prod(shape) * dtype.itemsize for shape, dtype in kinds]
        ends = np.cumsum([-(-size // _ALIGNED) * _ALIGNED for size in sizes], dtype=int)
        begins = np.append(0, ends).tolist()
        self._size = begins.pop()
        self._kinds = [(*k, begin) for k, begin in zip(kinds, begins, strict=True)]
        to = begins[: len(arrays)]
        for (count, length), dtype, begin in self._kinds[len(arrays) :]:
            step = length * dtype.itemsize
            to += range(begin, begin + count * step, step)
        self.pieces[:, _TO] = to

    def renewed(self) -> tuple[list[NDArray[Any]], int]:
        """New arrays, not filled in, and where the memory of all of them begins."""
        block = np.empty(self._size, np.uint8)
        found = [
            np.ndarray(shape, kind, block, begin) for shape, kind, begin in self._kinds
        ]
        return found, address(block)


def copies(pairs: Sequence[tuple[NDArray[Any], NDArray[Any]]]) -> Words:
    """Copies from the first of each pair of arrays to the second, for the loop."""
    pieces = _pieces([to for _, to in pairs], _TO)
    _join(pieces, _FROM, [source for source, _ in pairs])
    return pieces


def address(array: NDArray[Any]) -> int:
    """Where its memory begins."""
    return int(array.__array_interface__["data"][0])


def _pieces(arrays: Arrays, end: int) -> Words:
    """Copies from or to the rows of these arrays, whose other ends are open."""
    pieces = np.zeros((len(arrays), N_PIECE), np.int64)
    pieces[:, _LENGTH] = [array[0].nbytes for array in arrays]
    _join(pieces, end, arrays)
    return pieces


def _join(pieces: Words, end: int, arrays: Arrays) -> None:
    """Has these arrays be one end of the copies."""
    pieces[:, end] = [address(array) for array in arrays]
    pieces[:, end + 1] = [array.strides[0] for array in arrays]
