"""Compiled search for the shortest path of a disc among occupied squares.

A shortest path consists of straight lines and of arcs on which the disc rolls around
corners of obstacles, and the lines touch the arcs. So the search goes from corner to
corner along common tangents of their circles. A *label* is a tangent that arrives at
a corner; whether the disc can drive along it is tested only when its turn comes.

Directions are unit vectors; `m` of a line with direction (dx, dy) is (dy, -dx). The
disc rolls around a corner with a *sense* of 1 (from +x towards +y) or -1; it arrives at
and leaves a corner's circle of radius r at `corner + sense * r * m`.
"""

from __future__ import annotations

import math

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.grid.grid import BoolGrid, FloatGrid
from tdac_envs.ladder.rolling import (
    ANGLE,
    ROUNDING,
    SLACK,
    Links,
    Values,
    cross,
    is_line_free,
    roll_limit,
)
from tdac_envs.map2d.contact import has_room

START, GOAL = -1, -2
"""Nodes of the two ends; node 2 k + 1 is corner k with sense -1, node 2 k with 1."""
NO_PATH, FULL = -1, -2
MX, MY, LENGTH, TOTAL, LIMIT_X, LIMIT_Y = range(6)
"""Columns of a label's values: its line, length so far, lower bound of the whole."""
NODE, PARENT, NEXT = range(3)
"""Columns of a label's links; NEXT is the next processed label of the same node."""


@subkernel
def _push(heap: Links, size: int, label: int, values: Values) -> None:
    """Adds a label to a binary heap by its bound."""
    total, at = values[label, TOTAL], size
    while at > 0 and values[heap[(at - 1) >> 1], TOTAL] > total:
        heap[at] = heap[(at - 1) >> 1]
        at = (at - 1) >> 1
    heap[at] = label


@subkernel
def _pop(heap: Links, size: int, values: Values) -> int:
    """Removes the label with the least bound from a heap of `size` labels."""
    first, moved = heap[0], heap[size - 1]
    total, at, last = values[moved, TOTAL], 0, size - 1
    while 2 * at + 1 < last:
        child = 2 * at + 1
        right = child + 1 < last
        if right and values[heap[child + 1], TOTAL] < values[heap[child], TOTAL]:
            child += 1
        if values[heap[child], TOTAL] >= total:
            break
        heap[at] = heap[child]
        at = child
    heap[at] = moved
    return int(first)


@subkernel
def _is_dominated(
    values: Values,
    links: Links,
    head: int,
    sense: float,
    mx: float,
    my: float,
    length: float,
    radius: float,
) -> bool:
    """Whether an earlier label of the node rolls to the same place in less length."""
    label, nx, ny = head, sense * mx, sense * my
    while label >= 0:
        px, py = sense * values[label, MX], sense * values[label, MY]
        turn = sense * cross(px, py, nx, ny)
        beyond = sense * cross(nx, ny, values[label, LIMIT_X], values[label, LIMIT_Y])
        if turn >= -ANGLE and beyond >= -ANGLE:
            roll = radius * math.atan2(abs(turn), px * nx + py * ny)
            if values[label, LENGTH] + roll <= length + ANGLE:
                return True
        label = links[label, NEXT]
    return False


@kernel
def search(
    clear: FloatGrid,
    touched: BoolGrid,
    corners: Values,
    exposed: Values,
    heads: Links,
    ends: Values,
    radius: float,
    bound: float,
    values: Values,
    links: Links,
    heap: Links,
) -> int:
    """A* from the start along tangents; the straight distance is its heuristic.

    Args:
        clear: Padded clearance, px.
        touched: From `passages.touched_corners`.
        corners: Shape (n, 2), from `exposed_corners`.
        exposed: Shape (n, 4), from `exposed_corners`.
        heads: Shape (2 n,), filled with -1: a node's processed label.
        ends: Start and goal, [[x, y], [x, y]].
        radius: Radius of the disc, px.
        bound: Longer paths are not searched, px.
        values: Shape (m, 6), overwritten: the values of all labels.
        links: Shape (m, 3), overwritten: their links.
        heap: Shape (m,), overwritten.

    Returns:
        The label that arrives at the goal, NO_PATH, or FULL if there are more than m
        labels.
    """
    body = radius - SLACK
    values[0] = 0.0
    links[0, NODE], links[0, PARENT] = START, -1
    count, size, heap[0] = 1, 1, 0
    while size > 0:
        label = _pop(heap, size, values)
        size -= 1
        node = links[label, NODE]
        if _is_late(values, links, heads, node, label, radius):
            continue
        if node != START and not _arrives(
            clear, corners, ends, values, links, label, radius, body
        ):
            continue
        if node == GOAL:
            return label
        if node >= 0:
            _settle(touched, corners, exposed, values, links, label, radius)
            links[label, NEXT], heads[node] = heads[node], label
        count, size = _expand(
            corners,
            exposed,
            heads,
            ends,
            radius,
            bound,
            values,
            links,
            heap,
            label,
            count,
            size,
        )
        if count == FULL:
            return FULL
    return NO_PATH


@subkernel
def _is_late(
    values: Values, links: Links, heads: Links, node: int, label: int, radius: float
) -> bool:
    """Whether another label of the node was processed that is at least as good."""
    if node < 0:
        return False
    sense, head = 1.0 - 2.0 * (node & 1), heads[node]
    mx, my, length = values[label, MX], values[label, MY], values[label, LENGTH]
    return bool(_is_dominated(values, links, head, sense, mx, my, length, radius))


@subkernel
def _settle(
    touched: BoolGrid,
    corners: Values,
    exposed: Values,
    values: Values,
    links: Links,
    label: int,
    radius: float,
) -> None:
    """Writes how far the disc rolls after a tangent."""
    k, sense = links[label, NODE] >> 1, 1.0 - 2.0 * (links[label, NODE] & 1)
    last = 2 if sense > 0.0 else 0
    values[label, LIMIT_X], values[label, LIMIT_Y] = roll_limit(
        touched,
        corners[k, 0],
        corners[k, 1],
        sense * values[label, MX],
        sense * values[label, MY],
        exposed[k, last],
        exposed[k, last + 1],
        sense,
        radius,
    )


@subkernel
def _expand(
    corners: Values,
    exposed: Values,
    heads: Links,
    ends: Values,
    radius: float,
    bound: float,
    values: Values,
    links: Links,
    heap: Links,
    label: int,
    count: int,
    size: int,
) -> tuple[int, int]:
    """Adds the labels of all tangents that leave after a label.

    Returns:
        Number of labels and size of the heap, or FULL and 0.
    """
    node, x, y, turning = links[label, NODE], ends[0, 0], ends[0, 1], 0.0
    if node >= 0:
        x, y = corners[node >> 1, 0], corners[node >> 1, 1]
        turning = 1.0 - 2.0 * (node & 1)
    for to in range(GOAL, heads.shape[0]):
        if to == START or (node >= 0 and to >> 1 == node >> 1):
            continue
        to_x, to_y, to_turning = ends[1, 0], ends[1, 1], 0.0
        if to >= 0:
            to_x, to_y = corners[to >> 1, 0], corners[to >> 1, 1]
            to_turning = 1.0 - 2.0 * (to & 1)
        mx, my, line, small = _tangent(
            to_x - x, to_y - y, (to_turning - turning) * radius
        )
        if line < 0.0:
            continue
        if to >= 0 and not _is_exposed(exposed, to >> 1, to_turning, mx, my, small):
            continue
        if node >= 0 and not _leaves(values, label, turning, mx, my, small):
            continue
        norm = math.sqrt(mx * mx + my * my)
        mx, my = mx / norm, my / norm
        whole = values[label, LENGTH] + line
        if node >= 0:
            px, py = values[label, MX], values[label, MY]
            turn = math.atan2(abs(cross(px, py, mx, my)), px * mx + py * my)
            whole += radius * turn
        end_x, end_y = to_x + to_turning * radius * mx, to_y + to_turning * radius * my
        rest = math.sqrt((ends[1, 0] - end_x) ** 2 + (ends[1, 1] - end_y) ** 2)
        if whole + rest > bound:
            continue
        if count == heap.shape[0]:
            return FULL, 0
        values[count, MX], values[count, MY] = mx, my
        values[count, LENGTH], values[count, TOTAL] = whole, whole + rest
        links[count, NODE], links[count, PARENT], links[count, NEXT] = to, label, -1
        if not _is_late(values, links, heads, to, count, radius):
            _push(heap, size, count, values)
            count, size = count + 1, size + 1
    return count, size


@subkernel
def _tangent(x: float, y: float, shift: float) -> tuple[float, float, float, float]:
    """The line that touches two circles.

    Its direction d fulfils (x, y) = length * d - shift * m.

    Args:
        x: Column of the second circle, seen from the first, px.
        y: Row of the second circle.
        shift: Radius of the second circle less that of the first, px; a radius is
            negative if the disc rolls with sense -1.

    Returns:
        A multiple of m, the length, which is -1 if there is no such line, and a small
        number to compare products with this multiple of m with.
    """
    square = x * x + y * y
    if square < shift * shift or square == 0.0:
        return 0.0, 0.0, -1.0, 0.0
    line = math.sqrt(square - shift * shift)
    small = -ANGLE * square
    return line * y - shift * x, -(line * x + shift * y), line, small


@subkernel
def _is_exposed(
    exposed: Values, k: int, sense: float, mx: float, my: float, small: float
) -> bool:
    """Whether a line arrives at a corner's circle in one of its directions."""
    low_x, low_y = exposed[k, 0], exposed[k, 1]
    high_x, high_y = exposed[k, 2], exposed[k, 3]
    return bool(
        sense * cross(low_x, low_y, mx, my) >= small
        and sense * cross(mx, my, high_x, high_y) >= small
        and sense * (low_x * mx + low_y * my) >= small
    )


@subkernel
def _leaves(
    values: Values, label: int, sense: float, mx: float, my: float, small: float
) -> bool:
    """Whether the disc reaches a line when it rolls after a label's tangent."""
    from_x, from_y = values[label, MX], values[label, MY]
    limit_x, limit_y = sense * values[label, LIMIT_X], sense * values[label, LIMIT_Y]
    return bool(
        sense * cross(from_x, from_y, mx, my) >= small
        and sense * cross(mx, my, limit_x, limit_y) >= small
        and from_x * mx + from_y * my >= small
    )


@subkernel
def _arrives(
    clear: FloatGrid,
    corners: Values,
    ends: Values,
    values: Values,
    links: Links,
    label: int,
    radius: float,
    body: float,
) -> bool:
    """Whether the disc can drive along the tangent of a label."""
    node, origin = links[label, NODE], links[links[label, PARENT], NODE]
    mx, my = values[label, MX], values[label, MY]
    from_x, from_y, to_x, to_y = ends[0, 0], ends[0, 1], ends[1, 0], ends[1, 1]
    if origin >= 0:
        shift = (1.0 - 2.0 * (origin & 1)) * radius
        from_x = corners[origin >> 1, 0] + shift * mx
        from_y = corners[origin >> 1, 1] + shift * my
    if node >= 0:
        shift = (1.0 - 2.0 * (node & 1)) * radius
        to_x = corners[node >> 1, 0] + shift * mx
        to_y = corners[node >> 1, 1] + shift * my
    length = math.sqrt((to_x - from_x) ** 2 + (to_y - from_y) ** 2)
    if length < ROUNDING:
        return bool(has_room(clear, from_x, from_y, body))
    return bool(is_line_free(clear, from_x, from_y, -my, mx, length, body))
