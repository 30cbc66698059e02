"""What `tdac_envs.row_loop` copies before and after the call of a row."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.row_loop import N_PIECE

Arrays = Sequence[NDArray[Any]]
Words = NDArray[np.int64]

# Where the ends of a copy are in its words, and the bytes of a row.
_TO, _FROM, _LENGTH = 0, 2, 4
_ALIGNED = 64


class Outputs:
    """Arrays whose rows are copied into new ones, which are allocated all at once.

    Args:
        arrays: Each has a row for each row, which lies in one piece.

    Attributes:
        pieces: The copies, for the loop.
    """

    def __init__(self, arrays: Arrays) -> None:
        self._kept = arrays
        self.pieces = _pieces(arrays, _FROM)
        self.pieces[:, _TO + 1] = self.pieces[:, _LENGTH]
        ends = np.cumsum(
            [-(-a.nbytes // _ALIGNED) * _ALIGNED for a in arrays], dtype=int
        )
        self._size = int(ends[-1]) if len(arrays) else 0
        self._begins = np.append(0, ends)[: len(arrays)]
        self._kinds = [
            (array.shape, array.dtype, begin)
            for array, begin in zip(arrays, self._begins.tolist(), strict=True)
        ]

    def renewed(self) -> list[NDArray[Any]]:
        """New arrays, not filled in, to which rows are copied from now on."""
        block = np.empty(self._size, np.uint8)
        self.pieces[:, _TO] = self._begins + address(block)
        return [
            np.ndarray(shape, kind, block, begin) for shape, kind, begin in self._kinds
        ]


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
