"""Compiled code of `tdac_envs.learning.seen_map`: what rays have shown.

A map has square cells. Lengths are in cells here, angles in rad; cell (x, y) is
`[y, x]` and reaches from x - 0.5 to x + 0.5.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel

Array = NDArray[np.float64]
Bytes = NDArray[np.int8]
Costs = NDArray[np.int16]

UNKNOWN = np.int8(-128)
"""What a cell says that no ray has touched; others say from `_FREE` to `_SURE`."""
_FREE, _SURE, _HIT = -4, 8, 6
"""Least and largest evidence of a wall, and that of a ray which ends in a cell."""
_PASSED = 2
"""Evidence against a wall: a ray that passes."""
_SHORT = 1.5
"""A ray says nothing about the last cells before its end."""
PER_RADIUS = 4
"""Cells in a body radius."""
RING = 2 * PER_RADIUS
"""Cells nearer than this to a wall, or equally near, cost more."""
WALL = 2000
"""Cost of a step in a cell with a wall, in steps elsewhere."""
_STEPS = {0.0: WALL, 0.9: 90, 1.0: 40, 1.15: 20, 1.35: 8, 1.6: 5, 1.8: 3, 2.0: 2}
"""Cost of a step by the largest distance from a wall, body radii."""
_BESIDE = np.array(
    [
        next(cost for far, cost in _STEPS.items() if near <= (far * PER_RADIUS) ** 2)
        for near in range(RING * RING + 1)
    ],
    np.int16,
)
"""By the squared distance from a wall: below a body radius, the body hardly fits."""
MARGIN = RING + 1
"""Cells at the edges of a map where no robot is."""


@subkernel
def inside(at: float, side: int) -> float:
    """The nearest place within the margins of a map; the middle if it is not known."""
    if math.isnan(at):
        return float(side // 2)
    return min(max(at, float(MARGIN)), float(side - 1 - MARGIN))


@subkernel
def cell_of(at: float, side: int) -> int:
    """The cell of a place along one axis; -1 outside of the map, or if not known."""
    return int(at + 0.5) if -0.5 <= at < side - 0.5 else -1


@kernel
def add_scans(
    rows: NDArray[np.int64],
    poses: Array,
    ranges: NDArray[np.float32],
    largest: Array,
    rays: Array,
    offset: Array,
    walls: NDArray[np.int8],
    costs: Costs,
    visits: NDArray[np.uint8],
) -> None:
    """Adds to each robot's map what its rays show, and that it was there.

    Args:
        rows: Robots.
        poses: Shape (n, 3): x, y, heading.
        ranges: Shape (n, rays), in units of `largest`, in (0, 1]; 0 is no reading.
        largest: Shape (n,): largest range, cells.
        rays: Shape (rays, 2): their directions, ahead and along the y axis.
        offset: Shape (2,): where the rays start, ahead and along the y axis.
        walls: Shape (n, side, side): evidence.
        costs: Shape (n, side, side): cost of a step.
        visits: Shape (n, side, side): steps in a cell, at most 255.
    """
    side = walls.shape[1]
    for i in rows:
        x, y, heading = (
            inside(poses[i, 0], side),
            inside(poses[i, 1], side),
            poses[i, 2],
        )
        at_y, at_x = int(y + 0.5), int(x + 0.5)
        if visits[i, at_y, at_x] < 255:
            visits[i, at_y, at_x] += 1
        cosine, sine = math.cos(heading), math.sin(heading)
        from_x = x + cosine * offset[0] - sine * offset[1]
        from_y = y + sine * offset[0] + cosine * offset[1]
        for ray in range(len(rays)):
            part = float(ranges[i, ray])
            if part <= 0.0:
                continue
            reach = part * largest[i]
            dx = cosine * rays[ray, 0] - sine * rays[ray, 1]
            dy = sine * rays[ray, 0] + cosine * rays[ray, 1]
            _free(walls[i], costs[i], from_x, from_y, dx, dy, reach - _SHORT)
            if part < 0.9999:
                cell_x = cell_of(from_x + reach * dx, side)
                cell_y = cell_of(from_y + reach * dy, side)
                _hit(walls[i], costs[i], cell_x, cell_y)


@subkernel
def _free(
    walls: Bytes,
    costs: Costs,
    x: float,
    y: float,
    dx: float,
    dy: float,
    reach: float,
) -> None:
    """Notes that a ray passed."""
    side = walls.shape[0]
    last_x, last_y, far = -2, -2, 0.0
    while far <= reach:
        cell_x, cell_y = cell_of(x + far * dx, side), cell_of(y + far * dy, side)
        far += 0.9
        if cell_x == last_x and cell_y == last_y:
            continue
        last_x, last_y = cell_x, cell_y
        if cell_x < RING or cell_y < RING:
            break
        if cell_x >= side - RING or cell_y >= side - RING:
            break
        held = walls[cell_y, cell_x]
        if held == UNKNOWN:
            walls[cell_y, cell_x] = _FREE
        elif held > _FREE:
            walls[cell_y, cell_x] = max(held - _PASSED, _FREE)
            if 0 < held <= _PASSED:
                _lower(walls, costs, cell_x, cell_y)


@subkernel
def _hit(walls: Bytes, costs: Costs, x: int, y: int) -> None:
    """Notes that a ray ended in a cell."""
    side = walls.shape[0]
    if x < RING or y < RING or x >= side - RING or y >= side - RING:
        return
    held = int(walls[y, x])
    before = max(held, _FREE)
    walls[y, x] = min(before + _HIT, _SURE)
    if before <= 0:
        raise_costs(costs, x, y)


@subkernel
def raise_costs(costs: Costs, x: int, y: int) -> None:
    """Notes a new wall: steps near it cost more."""
    for dy in range(-RING, RING + 1):
        for dx in range(-RING, RING + 1):
            near = dx * dx + dy * dy
            if near < len(_BESIDE):
                costs[y + dy, x + dx] = max(costs[y + dy, x + dx], _BESIDE[near])


@subkernel
def _lower(walls: Bytes, costs: Costs, x: int, y: int) -> None:
    """Notes that a wall is gone."""
    side = walls.shape[0]
    for row in range(y - RING, y + RING + 1):
        for column in range(x - RING, x + RING + 1):
            dearest = 1
            for dy in range(-RING, RING + 1):
                for dx in range(-RING, RING + 1):
                    near = dx * dx + dy * dy
                    at_y, at_x = row + dy, column + dx
                    if near >= len(_BESIDE) or at_y < 0 or at_x < 0:
                        continue
                    if at_y < side and at_x < side and walls[at_y, at_x] > 0:
                        dearest = max(dearest, int(_BESIDE[near]))
            costs[row, column] = dearest


@kernel
def add_walls(
    cells: NDArray[np.bool_], scale: float, shift: float, walls: Bytes, costs: Costs
) -> None:
    """Puts a given map into a robot's map.

    Args:
        cells: Shape (height, width), True = occupied.
        scale: Cells of the robot's map in one pixel.
        shift: Where pixel 0 is in the robot's map, both in x and in y.
        walls: Shape (side, side), overwritten.
        costs: Shape (side, side), raised.
    """
    height, width = cells.shape
    # Cells on each side that belong to the same pixel, if cells are smaller.
    more = math.ceil(max(scale - 1.0, 0.0) / 2.0)
    for y in range(-1, height + 1):
        for x in range(-1, width + 1):
            free = 0 <= x < width and 0 <= y < height and not cells[y, x]
            at_x, at_y = int(x * scale + shift + 0.5), int(y * scale + shift + 0.5)
            for to_y in range(at_y - more, at_y + more + 1):
                for to_x in range(at_x - more, at_x + more + 1):
                    _give(walls, costs, to_x, to_y, free)


@subkernel
def _give(walls: Bytes, costs: Costs, x: int, y: int, free: bool) -> None:
    """Notes what a given map says of a cell; of several pixels in it, a wall counts."""
    side = walls.shape[0]
    if x < RING or y < RING or x >= side - RING or y >= side - RING:
        return
    if free:
        if walls[y, x] == UNKNOWN:
            walls[y, x] = _FREE
    elif walls[y, x] <= 0:
        walls[y, x] = _SURE
        raise_costs(costs, x, y)


@kernel
def look_around(
    rows: NDArray[np.int64],
    poses: Array,
    samples: Array,
    walls: NDArray[np.int8],
    visits: NDArray[np.uint8],
    seen: NDArray[np.float32],
) -> None:
    """What the maps hold around the robots, in sectors and rings.

    Args:
        rows: Robots.
        poses: Shape (n, 3).
        samples: Shape (bins, points, 2): places ahead and along the y axis.
        walls: See `add_scans`.
        visits: See `add_scans`.
        seen: Shape (n, 2, bins), overwritten: 1 if there is a wall, else minus the
            known share; and how often the robot was there, in [0, 1].
    """
    side = walls.shape[1]
    bins, points = samples.shape[0], samples.shape[1]
    for i in rows:
        x, y, heading = poses[i]
        cosine, sine = math.cos(heading), math.sin(heading)
        for k in range(bins):
            known, been, wall = 0, 0.0, False
            for p in range(points):
                ahead, aside = samples[k, p]
                at_x = cell_of(x + cosine * ahead - sine * aside, side)
                at_y = cell_of(y + sine * ahead + cosine * aside, side)
                if at_x < 0 or at_y < 0:
                    continue
                held = walls[i, at_y, at_x]
                if held != UNKNOWN:
                    known += 1
                    wall = wall or held > 0
                been += visits[i, at_y, at_x]
            seen[i, 0, k] = 1.0 if wall else -known / points
            seen[i, 1, k] = been / (been + points)
