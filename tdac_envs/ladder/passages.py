"""The widest path between two pixels, and its narrowest place."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import BoolGrid, FloatGrid

Pixel = tuple[int, int]
Nodes = NDArray[np.int32]

_CENTRE, _CORNER = 0, 1
"""Layers of the nodes."""


def bottleneck(
    cells: BoolGrid, clear: FloatGrid, start: Pixel, goal: Pixel, least: float = 0.0
) -> float:
    """Clearance at the narrowest place of the widest path between two pixels, px.

    The path joins centres and corners of pixels, so that the result is exact in
    corridors along an axis, of an odd or an even number of pixels. Elsewhere it differs
    from that of the widest path of all by less than half a px.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        clear: Shape (height, width), float32, from `grid.clearance`.
        start: Pixel (x, y).
        goal: Pixel (x, y).
        least: Least clearance of interest, px. It makes the search faster.

    Returns:
        0 if there is no path, or none with the least clearance.
    """
    height, width = cells.shape
    at_corners = cv2.distanceTransform(
        (~touched_corners(cells)).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )
    room = np.empty((2, height + 2, width + 1), np.int32)
    heads = np.full(_quarters(float(clear[goal[::-1]])) + 1, -1, np.int32)
    links, stack = np.empty(room.size, np.int32), np.empty(room.size, np.int32)
    first, last = ((y + 1) * (width + 1) + x for x, y in (goal, start))
    distances = read_only(clear), read_only(at_corners)
    lowest = max(_quarters(least), 1)
    _fill_rooms(*distances, lowest, room)
    found = _widest(room.ravel(), width + 1, first, last, heads, links, stack)
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
def _fill_rooms(
    clear: FloatGrid, at_corners: FloatGrid, least: int, room: Nodes
) -> None:
    """Fills `room` with the clearance of each node, quarters of px**2.

    What is below `least` becomes 0. Pixel (i, j) is `[_CENTRE, j + 1, i]`, and its
    first corner is `[_CORNER, j + 1, i]`.
    Nodes beside the map have no room, and neither have corners on its border. So a
    node with room has all its neighbours at the same offsets.
    """
    height, width = clear.shape
    room[:, 0], room[:, height + 1], room[_CENTRE, :, width] = 0, 0, 0
    for j in range(height):
        for i in range(width):
            centre = _compiled_quarters(clear[j, i])
            corner = _compiled_quarters(at_corners[j, i])
            room[_CENTRE, j + 1, i] = centre if centre >= least else 0
            room[_CORNER, j + 1, i] = corner if corner >= least else 0
        room[_CORNER, j + 1, width] = 0


@kernel
def _widest(
    room: Nodes,
    stride: int,
    first: int,
    last: int,
    heads: Nodes,
    links: Nodes,
    stack: Nodes,
) -> int:
    """Bottleneck from node `first` to `last`, quarters of px**2.

    A node at least as wide as the bottleneck so far is visited at once; the others wait
    in a list for each width: `heads` has the first of each list, `links` the next.

    Args:
        room: From `_fill_rooms`, flattened. A node that was reached gets 0.
        stride: Nodes in a row.
        first: A node.
        last: A node.
        heads: One more than the room of `first`, filled with -1.
        links: As many as nodes, overwritten.
        stack: As many as nodes, overwritten.
    """
    level, size, corners = heads.shape[0] - 1, 1, room.size // 2
    stack[0] = first
    level, room[first] = room[first], 0
    while level > 0:
        while size > 0:
            size -= 1
            node = stack[size]
            if node == last:
                return int(level)
            across = -corners if node >= corners else corners
            ahead = -1 if node >= corners else 1
            for k in range(8):
                to = _neighbour(node, k, stride, across, ahead)
                wide = room[to]
                if wide == 0:
                    continue
                room[to] = 0
                if wide >= level:
                    stack[size] = to
                    size += 1
                else:
                    links[to] = heads[wide]
                    heads[wide] = to
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
def _neighbour(node: int, k: int, stride: int, across: int, ahead: int) -> int:
    """The k-th of the eight nodes around a node: four of its layer, four of the other.

    Args:
        node: The node.
        k: 0 to 7.
        stride: Nodes in a row.
        across: Offset of the other layer.
        ahead: Direction of the nearest nodes there: 1 from pixels, -1 from corners.
    """
    if k < 4:
        step = 1 if k < 2 else stride
        return node + step if k & 1 else node - step
    step = (k & 1) + (stride if k & 2 else 0)
    return node + across + ahead * step
