"""Compiled distances to prisms, and the length of the remaining path.

Lengths are metres. `points`, `first` and `extent` are the arrays of a
`tdac_envs.epuck.prisms.Prisms`. Functions that also take `listed`, `begin` and `end`
consider only the parts with the indices `listed[begin:end]`, or `range(begin, end)` if
`listed` is empty.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.epuck.prisms import MID_X, MID_Y, REACH, ROUND, Array, Index


@subkernel
def gap_of(
    points: Array, first: Index, extent: Array, part: int, x: float, y: float
) -> tuple[float, float, float]:
    """Signed distance from a point to a part, and the unit vector away from it."""
    begin, end = first[part], first[part + 1]
    if end - begin == 1:
        off_x, off_y = x - points[begin, 0], y - points[begin, 1]
        far = math.sqrt(off_x * off_x + off_y * off_y)
        if far == 0.0:
            return -extent[part, ROUND], 1.0, 0.0
        return far - extent[part, ROUND], off_x / far, off_y / far
    is_outside, square, near_x, near_y = False, math.inf, 0.0, 0.0
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        edge_x, edge_y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        off_x, off_y = x - points[i, 0], y - points[i, 1]
        is_outside = is_outside or edge_y * off_x - edge_x * off_y > 0.0
        along = off_x * edge_x + off_y * edge_y
        share = min(max(along / (edge_x * edge_x + edge_y * edge_y), 0.0), 1.0)
        off_x, off_y = off_x - share * edge_x, off_y - share * edge_y
        distance2 = off_x * off_x + off_y * off_y
        if distance2 < square:
            square, near_x, near_y = distance2, off_x, off_y
    if not is_outside or square == 0.0:
        return _depth(points, begin, end, x, y)
    distance = math.sqrt(square)
    return distance, near_x / distance, near_y / distance


@kernel
def part_gap(
    points: Array, first: Index, extent: Array, part: int, x: float, y: float
) -> tuple[float, float, float]:
    """`gap_of` for calls from Python."""
    return gap_of(points, first, extent, part, x, y)


@subkernel
def _depth(
    points: Array, begin: int, end: int, x: float, y: float
) -> tuple[float, float, float]:
    """`gap_of` for a point inside a polygon or on its edge."""
    outside, out_x, out_y = -math.inf, 1.0, 0.0
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        edge_x, edge_y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        length = math.sqrt(edge_x * edge_x + edge_y * edge_y)
        off_x, off_y = x - points[i, 0], y - points[i, 1]
        side = (edge_y * off_x - edge_x * off_y) / length
        if side > outside:
            outside, out_x, out_y = side, edge_y / length, -edge_x / length
    return min(outside, 0.0), out_x, out_y


@subkernel
def listed_at(
    cells: Index, count: int, left: float, low: float, width: float, x: float, y: float
) -> tuple[int, int]:
    """Begin and end in `listed` of the parts that are relevant at a point.

    `cells` is that of a `tdac_envs.epuck.nearby.Nearby`, with cells of `width` m.
    Outside the grid, these are all of the `count` parts.
    """
    column, row = math.floor((x - left) / width), math.floor((y - low) / width)
    if 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1] - 1:
        return cells[row, column], cells[row, column + 1]
    return 0, count


@kernel
def nearest_gap(
    points: Array, first: Index, extent: Array, x: float, y: float
) -> float:
    """Distance from a point to the nearest part; negative inside, inf without parts."""
    return nearest_of(points, first, extent, first[:0], 0, extent.shape[0], x, y)


@subkernel
def nearest_of(
    points: Array,
    first: Index,
    extent: Array,
    listed: Index,
    begin: int,
    end: int,
    x: float,
    y: float,
) -> float:
    """`nearest_gap` for the listed parts."""
    best = math.inf
    for n in range(begin, end):
        k = listed[n] if listed.shape[0] else n
        off_x, off_y = extent[k, MID_X] - x, extent[k, MID_Y] - y
        near = best + extent[k, REACH]
        if near > 0.0 and off_x * off_x + off_y * off_y < near * near:
            best = min(best, gap_of(points, first, extent, k, x, y)[0])
    return best


@kernel
def clear_grid(
    points: Array,
    first: Index,
    extent: Array,
    left: float,
    low: float,
    spacing: float,
    clear: Array,
) -> None:
    """Lowers each entry of `clear` to the distance to the nearest part.

    Args:
        points: See the module docstring.
        first: See the module docstring.
        extent: See the module docstring.
        left: x of `clear[:, 0]`.
        low: y of `clear[0, :]`.
        spacing: Distance between grid points.
        clear: Shape (height, width), initially filled with the largest distance of
            interest; overwritten.
    """
    height, width = clear.shape
    if height * width == 0:
        return
    most = clear[0, 0]
    for k in range(extent.shape[0]):
        reach = most + extent[k, ROUND]
        x0 = x1 = points[first[k], 0]
        y0 = y1 = points[first[k], 1]
        for i in range(first[k], first[k + 1]):
            x0, x1 = min(x0, points[i, 0]), max(x1, points[i, 0])
            y0, y1 = min(y0, points[i, 1]), max(y1, points[i, 1])
        for v in range(
            max(math.floor((y0 - reach - low) / spacing), 0),
            min(math.ceil((y1 + reach - low) / spacing) + 1, height),
        ):
            for u in range(
                max(math.floor((x0 - reach - left) / spacing), 0),
                min(math.ceil((x1 + reach - left) / spacing) + 1, width),
            ):
                x, y = left + u * spacing, low + v * spacing
                gap = gap_of(points, first, extent, k, x, y)[0]
                clear[v, u] = min(clear[v, u], gap)


@subkernel
def remaining_path(
    field: NDArray[np.float32],
    left: float,
    low: float,
    spacing: float,
    reach: float,
    x: float,
    y: float,
    previous: float,
) -> float:
    """Length of the shortest path from a point to the goal, m.

    It is the least sum of the distance to a grid point and the path length from there,
    or `previous` if no grid point has a path.

    Args:
        field: Path length from each grid point, m; inf if there is none.
        left: x of the first column, m.
        low: y of the first row, m.
        spacing: Distance between grid points, m.
        reach: Body radius, m: nothing can lie between the robot and grid points that
            are nearer, so only they count.
        x: x of the point, m.
        y: y of the point, m.
        previous: Length one step earlier, m.
    """
    height, width = field.shape
    u, v = (x - left) / spacing, (y - low) / spacing
    column, row = math.floor(u), math.floor(v)
    for ring in range(4):
        best = math.inf
        for j in range(max(row - ring, 0), min(row + ring + 2, height)):
            for i in range(max(column - ring, 0), min(column + ring + 2, width)):
                off_u, off_v = u - i, v - j
                hop = spacing * math.sqrt(off_u * off_u + off_v * off_v)
                if ring == 0 or hop < reach:
                    best = min(best, field[j, i] + hop)
        if best < math.inf:
            return best
    return previous
