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

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.grid.grid import BoolGrid, FloatGrid
from tdac_envs.map2d.contact import arc_contact, has_room

Values = NDArray[np.float64]
Links = NDArray[np.int64]

SLACK = 1e-6
"""The disc is tested with a radius smaller by this, px: it may touch corners."""
START, GOAL = -1, -2
"""Nodes of the two ends; node 2 k + 1 is corner k with sense -1, node 2 k with 1."""
NO_PATH, FULL = -1, -2
MX, MY, LENGTH, TOTAL, LIMIT_X, LIMIT_Y = range(6)
"""Columns of a label's values: its line, length so far, lower bound of the whole."""
NODE, PARENT, NEXT = range(3)
"""Columns of a label's links; NEXT is the next processed label of the same node."""
_ANGLE = 1e-9
"""Tolerance of directions, rad."""
_ROUNDING = 1e-5
"""Margin for the float32 rounding of the clearance field, px."""
_SHORT = 0.5
"""Distance between tests where the clearance does not decide, px."""
_PIECE = 8.0
"""Length of the pieces of a line that are tested exactly, px."""


@kernel
def exposed_corners(
    cells: BoolGrid, radius: float, corners: Values, exposed: Values, rows: Links
) -> int:
    """Convex corners of obstacles, and the directions in which a disc may touch them.

    Directions at the ends of a corner's quarter circle are dropped where a disc that
    touches the corner covers another corner.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        radius: Radius of the disc, px.
        corners: Shape (n, 2); its first rows become the corners (x, y).
        exposed: Shape (n, 4); its first rows become the first and last direction.
        rows: Shape (height + 2,), overwritten.

    Returns:
        The number of corners.
    """
    found = _convex_corners(cells, corners, exposed, rows)
    reach = math.ceil(2.0 * radius)
    kept = np.zeros(found, np.bool_)
    for k in range(found):
        row = math.floor(corners[k, 1] + 0.5)
        first = rows[max(row - reach, 0)]
        last = rows[min(row + reach + 1, rows.shape[0] - 1)]
        kept[k] = True
        # A second pass, since what covers the middle may then be at an end.
        for number in range(2 * (last - first)):
            other = first + number % (last - first)
            dx = corners[other, 0] - corners[k, 0]
            if other != k and abs(dx) < 2.0 * radius:
                dy = corners[other, 1] - corners[k, 1]
                if not _trim(exposed, k, dx, dy, radius):
                    kept[k] = False
                    break
    count = 0
    for k in range(found):
        if kept[k]:
            corners[count], exposed[count] = corners[k], exposed[k]
            count += 1
    return count


@subkernel
def _convex_corners(
    cells: BoolGrid, corners: Values, exposed: Values, rows: Links
) -> int:
    """Points with one occupied pixel of four; `rows` gets each row's first corner."""
    height, width = cells.shape
    count = 0
    rows[0] = 0
    for j in range(1, height):
        rows[j] = count
        for i in range(1, width):
            above, below = cells[j - 1], cells[j]
            occupied = int(above[i - 1]) + above[i] + below[i - 1] + below[i]
            if occupied != 1:
                continue
            away_x = 1.0 if above[i - 1] or below[i - 1] else -1.0
            away_y = 1.0 if above[i - 1] or above[i] else -1.0
            corners[count, 0], corners[count, 1] = i - 0.5, j - 0.5
            exposed[count] = 0.0
            first = 0 if away_x * away_y > 0.0 else 2
            exposed[count, first], exposed[count, 3 - first] = away_x, away_y
            count += 1
    rows[height:] = count
    return count


@subkernel
def _trim(exposed: Values, k: int, dx: float, dy: float, radius: float) -> bool:
    """Drops the directions in which the disc at a corner covers another corner.

    Args:
        exposed: Directions of all corners.
        k: The corner.
        dx: x of the other corner, seen from this one, px.
        dy: y of the other corner.
        radius: Radius of the disc, px.

    Returns:
        False if no direction is left.
    """
    cos = _half_angle(math.sqrt(dx * dx + dy * dy), radius)
    if cos >= 1.0:
        return True
    ax, ay = _rotated(dx, dy, cos, -1.0)
    bx, by = _rotated(dx, dy, cos, 1.0)
    low_x, low_y = exposed[k, 0], exposed[k, 1]
    high_x, high_y = exposed[k, 2], exposed[k, 3]
    low = _cross(ax, ay, low_x, low_y) > 0.0 and _cross(low_x, low_y, bx, by) > 0.0
    high = _cross(ax, ay, high_x, high_y) > 0.0 and _cross(high_x, high_y, bx, by) > 0.0
    if low and high:
        return False
    if low:
        exposed[k, 0], exposed[k, 1] = bx, by
    if high:
        exposed[k, 2], exposed[k, 3] = ax, ay
    return True


@subkernel
def _half_angle(distance: float, radius: float) -> float:
    """Cosine of the angle to a point at which a disc on a circle begins to cover it.

    The disc's centre is on a circle of `radius` around a corner. Above 1 if the disc
    never covers a point at this distance from the corner.
    """
    body = radius - SLACK
    return (radius * radius - body * body + distance * distance) / (
        2.0 * radius * distance
    )


@subkernel
def _rotated(x: float, y: float, cos: float, sense: float) -> tuple[float, float]:
    """The direction of (x, y), rotated by the angle of this cosine, as unit vector."""
    sin, norm = sense * math.sqrt(1.0 - cos * cos), math.sqrt(x * x + y * y)
    return (x * cos - y * sin) / norm, (x * sin + y * cos) / norm


@subkernel
def _cross(ax: float, ay: float, bx: float, by: float) -> float:
    return ax * by - ay * bx


@subkernel
def _roll_limit(
    touched: BoolGrid,
    x: float,
    y: float,
    from_x: float,
    from_y: float,
    to_x: float,
    to_y: float,
    sense: float,
    radius: float,
) -> tuple[float, float]:
    """How far a disc rolls around a corner before it covers another corner.

    Args:
        touched: Shape (height + 1, width + 1), from `passages.touched_corners`.
        x: Column of the corner.
        y: Row of the corner.
        from_x: Direction from the corner to the disc's centre at first.
        from_y: Its y.
        to_x: The last direction that is wanted.
        to_y: Its y.
        sense: Sense of the roll.
        radius: Radius of the disc, px.

    Returns:
        The last direction that is possible.
    """
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    step_x = 1 if from_x + to_x > 0.0 else -1
    step_y = 1 if from_y + to_y > 0.0 else -1
    reach = math.ceil(2.0 * radius)
    for b in range(reach + 1):
        j = row + step_y * b
        if j < 0 or j >= touched.shape[0]:
            break
        for a in range(reach + 1):
            i = column + step_x * a
            if i < 0 or i >= touched.shape[1]:
                break
            if not touched[j, i] or a + b == 0:
                continue
            dx, dy = float(step_x * a), float(step_y * b)
            if sense * _cross(from_x, from_y, dx, dy) <= _ANGLE:
                continue
            if sense * _cross(dx, dy, to_x, to_y) <= _ANGLE:
                continue
            cos = _half_angle(math.sqrt(dx * dx + dy * dy), radius)
            if cos >= 1.0:
                continue
            end_x, end_y = _rotated(dx, dy, cos, -sense)
            if sense * _cross(from_x, from_y, end_x, end_y) <= 0.0:
                return from_x, from_y
            if sense * _cross(end_x, end_y, to_x, to_y) > 0.0:
                to_x, to_y = end_x, end_y
    return to_x, to_y


@subkernel
def _is_line_free(
    clear: FloatGrid,
    x: float,
    y: float,
    dx: float,
    dy: float,
    length: float,
    body: float,
) -> bool:
    """Whether a disc of radius `body` touches nothing on a straight line."""
    if not has_room(clear, x, y, body):
        return False
    far, in_doubt = 0.0, False
    while far < length:
        at_x, at_y = x + far * dx, y + far * dy
        i, j = math.floor(at_x + 0.5), math.floor(at_y + 0.5)
        off = math.sqrt((at_x - i) ** 2 + (at_y - j) ** 2) + _ROUNDING
        room = clear[j + 1, i + 1] - body
        if room + off < 0.0:
            return False
        if room - off < _SHORT:
            in_doubt = True
        far += max(room - off, _SHORT)
    if not in_doubt:
        return has_room(clear, x + length * dx, y + length * dy, body)
    pieces = math.ceil(length / _PIECE)
    heading, piece = math.atan2(dy, dx), length / pieces
    for k in range(pieces):
        at_x, at_y = x + k * piece * dx, y + k * piece * dy
        if arc_contact(clear, at_x, at_y, heading, piece, 0.0, body) <= 1.0:
            return False
    return True


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
        turn = sense * _cross(px, py, nx, ny)
        beyond = sense * _cross(nx, ny, values[label, LIMIT_X], values[label, LIMIT_Y])
        if turn >= -_ANGLE and beyond >= -_ANGLE:
            roll = radius * math.atan2(abs(turn), px * nx + py * ny)
            if values[label, LENGTH] + roll <= length + _ANGLE:
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
    values[label, LIMIT_X], values[label, LIMIT_Y] = _roll_limit(
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
            turn = math.atan2(abs(_cross(px, py, mx, my)), px * mx + py * my)
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
    small = -_ANGLE * square
    return line * y - shift * x, -(line * x + shift * y), line, small


@subkernel
def _is_exposed(
    exposed: Values, k: int, sense: float, mx: float, my: float, small: float
) -> bool:
    """Whether a line arrives at a corner's circle in one of its directions."""
    low_x, low_y = exposed[k, 0], exposed[k, 1]
    high_x, high_y = exposed[k, 2], exposed[k, 3]
    return bool(
        sense * _cross(low_x, low_y, mx, my) >= small
        and sense * _cross(mx, my, high_x, high_y) >= small
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
        sense * _cross(from_x, from_y, mx, my) >= small
        and sense * _cross(mx, my, limit_x, limit_y) >= small
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
    if length < _ROUNDING:
        return bool(has_room(clear, from_x, from_y, body))
    return bool(_is_line_free(clear, from_x, from_y, -my, mx, length, body))
