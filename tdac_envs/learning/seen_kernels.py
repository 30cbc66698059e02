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
    most = float(side - 1 - MARGIN)
    for i in rows:
        x, y, heading = poses[i]
        x = min(max(x, float(MARGIN)), most)
        y = min(max(y, float(MARGIN)), most)
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
                cell_x = int(from_x + reach * dx + 0.5)
                cell_y = int(from_y + reach * dy + 0.5)
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
    last_x, last_y, far = -1, -1, 0.0
    while far <= reach:
        cell_x, cell_y = int(x + far * dx + 0.5), int(y + far * dy + 0.5)
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
    for y in range(-1, height + 1):
        for x in range(-1, width + 1):
            inside = 0 <= x < width and 0 <= y < height
            to_x, to_y = int(x * scale + shift + 0.5), int(y * scale + shift + 0.5)
            if inside and not cells[y, x]:
                if walls[to_y, to_x] == UNKNOWN:
                    walls[to_y, to_x] = _FREE
            elif walls[to_y, to_x] <= 0:
                walls[to_y, to_x] = _SURE
                raise_costs(costs, to_x, to_y)


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
                at_x = int(x + cosine * ahead - sine * aside + 0.5)
                at_y = int(y + sine * ahead + cosine * aside + 0.5)
                if at_x < 0 or at_y < 0 or at_x >= side or at_y >= side:
                    continue
                held = walls[i, at_y, at_x]
                if held != UNKNOWN:
                    known += 1
                    wall = wall or held > 0
                been += visits[i, at_y, at_x]
            seen[i, 0, k] = 1.0 if wall else -known / points
            seen[i, 1, k] = been / (been + points)
