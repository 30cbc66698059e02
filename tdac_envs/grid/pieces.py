"""Connected pieces of a grid, and the pixels nearest to a point."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid

End = Literal["start", "goal"]
Pixel = tuple[int, int]

REACHABLE: dict[End, str] = {
    "start": "from which the goal can be reached",
    "goal": "that can be reached from the start",
}
"""Describes in messages how a place for an end is connected with the other end."""
_REACH = 64
"""Half the side of the first window in which `nearest_free` searches, px."""


def pieces_of(free: BoolGrid) -> NDArray[np.int32]:
    """Number of the connected piece of each free pixel, from 1; 0 for the others.

    A diagonal step requires both pixels beside it, so 4-connectivity decides.
    """
    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    return labels.astype(np.int32, copy=False)


def connected_with(free: BoolGrid, pixel: Pixel) -> BoolGrid:
    """The free pixels that are connected with a free pixel (x, y)."""
    labels = pieces_of(free)
    return np.asarray(labels == labels[pixel[::-1]])


def nearest_free(free: BoolGrid, x: float, y: float) -> Pixel | None:
    """The free pixel nearest to a point, px; None if there is none.

    The search begins in a window around the point, which grows until no pixel beyond it
    can be nearer.

    Args:
        free: Shape (height, width), bool.
        x: Column, px; may lie outside.
        y: Row, px; may lie outside.
    """
    height, width = free.shape
    reach = _REACH
    while True:
        x0, x1 = _span(x, reach, width)
        y0, y1 = _span(y, reach, height)
        rows, columns = np.nonzero(free[y0:y1, x0:x1])
        is_whole = (x1 - x0, y1 - y0) == (width, height)
        if rows.size:
            squares = (columns + x0 - x) ** 2 + (rows + y0 - y) ** 2
            best = int(np.argmin(squares))
            if is_whole or squares[best] <= (reach - 1) ** 2:
                return int(columns[best]) + x0, int(rows[best]) + y0
        elif is_whole:
            return None
        reach *= 4


def _span(centre: float, reach: int, size: int) -> tuple[int, int]:
    """First index, and index after the last, within `reach` of a coordinate."""
    low = min(max(int(centre) - reach, 0), size)
    return low, min(max(int(centre) + reach + 1, low), size)


def end_outside(cells: BoolGrid, start: Pixel, goal: Pixel) -> End | None:
    """Which of two free pixels lies outside of a closed wall around the other one.

    The outside is the free space that is connected with the border of the map.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        start: Pixel (x, y).
        goal: Pixel (x, y).

    Returns:
        None if a pixel is occupied, if a free line joins them, or if both or neither
        are connected with the border.
    """
    labels = pieces_of(~cells)
    at_start, at_goal = int(labels[start[::-1]]), int(labels[goal[::-1]])
    if at_start == at_goal or 0 in (at_start, at_goal):
        return None
    rim = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    is_open = bool((rim == at_start).any()), bool((rim == at_goal).any())
    ends: dict[tuple[bool, bool], End] = {
        (True, False): "start",
        (False, True): "goal",
    }
    return ends.get(is_open)
