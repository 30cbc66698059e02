"""The widest path between two pixels, and its narrowest place."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import BoolGrid, FloatGrid

Pixel = tuple[int, int]
Nodes = NDArray[np.int64]

_FRESH = -2
"""Link of a node that was not reached yet."""


def bottleneck(cells: BoolGrid, clear: FloatGrid, start: Pixel, goal: Pixel) -> float:
    """Clearance at the narrowest place of the widest path between two pixels, px.

    The path joins centres and corners of pixels, so that the result is exact in
    corridors along an axis, of an odd or an even number of pixels. Elsewhere it differs
    from that of the widest path of all by less than half a px.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        clear: Shape (height, width), float32, from `grid.clearance`.
        start: Pixel (x, y).
        goal: Pixel (x, y).

    Returns:
        0 if there is no path.
    """
    width = cells.shape[1]
    at_corners = cv2.distanceTransform(
        (~touched_corners(cells)).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )
    first, last = goal[1] * width + goal[0], start[1] * width + start[0]
    nodes = clear.size + at_corners.size
    heads = np.full(_quarters(float(clear[goal[::-1]])) + 1, -1)
    links, stack = np.full(nodes, _FRESH), np.empty(nodes, np.int64)
    centres, corners = read_only(clear.ravel()), read_only(at_corners.ravel())
    found = _widest(centres, corners, width, first, last, heads, links, stack)
    return math.sqrt(found) / 2.0


def touched_corners(cells: BoolGrid) -> BoolGrid:
    """Whether each corner of a pixel belongs to an occupied square or to the border.

    Args:
        cells: Shape (height, width), bool, True = occupied.

    Returns:
        Shape (height + 1, width + 1), bool: `[j, i]` is the point (i - 1/2, j - 1/2).
    """
    padded = np.pad(cells, 1, constant_values=True)
    rows = padded[1:] | padded[:-1]
    return np.asarray(rows[:, 1:] | rows[:, :-1])


def _quarters(distance: float) -> int:
    """A squared distance in quarters of px**2, of which it is a whole number."""
    return math.floor(4.0 * distance * distance + 0.5)


_compiled_quarters = subkernel(_quarters)


@kernel
def _widest(
    centres: NDArray[np.float32],
    corners: NDArray[np.float32],
    width: int,
    first: int,
    last: int,
    heads: Nodes,
    links: Nodes,
    stack: Nodes,
) -> int:
    """Bottleneck from node `first` to `last`, quarters of px**2.

    The nodes are the centres of all pixels, row by row, and then their corners. A node
    at least as wide as the bottleneck so far is visited at once; the others wait in a
    list for each width: `heads` has the first of each list, `links` the next.
    """
    height = centres.size // width
    level, size = heads.shape[0] - 1, 1
    stack[0], links[first] = first, -1
    while level > 0:
        while size > 0:
            size -= 1
            node = stack[size]
            if node == last:
                return int(level)
            is_corner = node >= centres.size
            place = node - centres.size if is_corner else node
            columns = width + 1 if is_corner else width
            j = place // columns
            i = place - j * columns
            for k in range(8):
                to = _neighbour(i, j, is_corner, k, height, width)
                if to < 0 or links[to] != _FRESH:
                    continue
                links[to] = -1
                if to < centres.size:
                    room = _compiled_quarters(centres[to])
                else:
                    room = _compiled_quarters(corners[to - centres.size])
                if room >= level:
                    stack[size] = to
                    size += 1
                elif room > 0:
                    links[to] = heads[room]
                    heads[room] = to
        level -= 1
        while level > 0 and heads[level] < 0:
            level -= 1
        node = heads[level]
        while node >= 0:
            stack[size] = node
            size += 1
            node = links[node]
    return 0


@subkernel
def _neighbour(i: int, j: int, is_corner: bool, k: int, height: int, width: int) -> int:
    """The k-th of the eight nodes around node (i, j); -1 outside the map."""
    if k < 4:
        i += (k == 0) - (k == 1)
        j += (k == 2) - (k == 3)
        more = 1 if is_corner else 0
        if i < 0 or j < 0 or i >= width + more or j >= height + more:
            return -1
        return height * width + j * (width + 1) + i if is_corner else j * width + i
    # Pixel (i, j) has the corners (i, j) to (i + 1, j + 1).
    i += k & 1
    j += (k >> 1) & 1
    if not is_corner:
        return height * width + j * (width + 1) + i
    if i < 1 or j < 1 or i > width or j > height:
        return -1
    return (j - 1) * width + i - 1
