"""The e-puck's infra-red sensors: where they are, what they see, what they read.

Numbers are those of Webots' E-puck PROTO (R2020a to R2025a). The sensors are numbered
clockwise as seen from above: ps0 to ps3 on the right side, ps4 to ps7 on the left.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.epuck.prisms import (
    FACTOR,
    HIGH,
    LOW,
    MID_X,
    MID_Y,
    REACH,
    ROUND,
    Array,
    Index,
)

N_SENSORS = 8
RANGE = 0.07
"""Length of a ray, m."""
HEIGHT, ELEVATION = 0.033, 0.16
"""Of a ray's origin above the ground, m; by how much it points up, rad."""
PLACES = np.array(
    [
        (0.030, -0.010, -0.3008),
        (0.022, -0.025, -0.8008),
        (0.000, -0.031, -1.5708),
        (-0.030, -0.015, -2.6440),
        (-0.030, 0.015, 2.6392),
        (0.000, 0.031, 1.5708),
        (0.022, 0.025, 0.7992),
        (0.030, 0.010, 0.2992),
    ]
)
"""Shape (8, 3): x forward and y left, m, and azimuth, rad, counter-clockwise."""
TABLE = np.array(
    [
        (0.0, 4095.0, 0.002),
        (0.005, 2133.33, 0.003),
        (0.01, 1465.73, 0.007),
        (0.015, 601.46, 0.0406),
        (0.02, 383.84, 0.01472),
        (0.03, 234.93, 0.0241),
        (0.04, 158.03, 0.0287),
        (0.05, 120.0, 0.04225),
        (0.06, 104.09, 0.03065),
        (0.07, 67.19, 0.04897),
    ]
)
"""Shape (10, 3): distance, m; value; its relative standard deviation."""
LARGEST = 4200.0
"""Above any value with its noise."""
_COS, _SIN = math.cos(ELEVATION), math.sin(ELEVATION)
_WAYS = np.column_stack([np.cos(PLACES[:, 2]), np.sin(PLACES[:, 2])])
FARTHEST = 0.11
"""No ray gets farther from the robot's axle than this, m."""

# Ground sensors: see down from here, m.
GROUND_PLACES = np.array([(0.03, 0.01), (0.03, 0.0), (0.03, -0.01)])
GROUND_HEIGHT, GROUND_RANGE = 0.003, 0.016
GROUND_TABLE = np.array([(0.0, 1000.0, 0.002), (0.016, 300.0, 0.004)])


@subkernel
def _interpolated(table: Array, distance: float, column: int) -> float:
    """Linear between the rows of a table, the end values beyond it."""
    last = table.shape[0] - 1
    if distance <= table[0, 0]:
        return float(table[0, column])
    for row in range(last):
        if distance < table[row + 1, 0]:
            share = (distance - table[row, 0]) / (table[row + 1, 0] - table[row, 0])
            low, high = table[row, column], table[row + 1, column]
            return float(low + share * (high - low))
    return float(table[last, column])


@subkernel
def response(distance: float) -> float:
    """What a sensor reads, without noise, of a thing of reflectance 1.

    Args:
        distance: Along the ray, m; divide it by a thing's reflectance.
    """
    return _interpolated(TABLE, distance, 1)


@subkernel
def spread(distance: float) -> float:
    """Relative standard deviation of a reading; `distance` as for `response`."""
    return _interpolated(TABLE, distance, 2)


@subkernel
def crossing(
    points: Array,
    first: Index,
    extent: Array,
    part: int,
    x: float,
    y: float,
    way_x: float,
    way_y: float,
    near: float,
    far: float,
) -> float:
    """Where between `near` and `far` a line first is within a part's footprint.

    Returns:
        The parameter of the line (x, y) + t (way_x, way_y); inf where it is nowhere.
    """
    begin, end = first[part], first[part + 1]
    if end - begin == 1:
        off_x, off_y = x - points[begin, 0], y - points[begin, 1]
        square = way_x * way_x + way_y * way_y
        along = off_x * way_x + off_y * way_y
        rest = off_x * off_x + off_y * off_y - extent[part, ROUND] ** 2
        if square == 0.0:
            return near if rest <= 0.0 and near <= far else math.inf
        root = along * along - square * rest
        if root < 0.0:
            return math.inf
        root = math.sqrt(root)
        near = max(near, (-along - root) / square)
        far = min(far, (-along + root) / square)
        return near if near <= far else math.inf
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        out_x, out_y = points[j, 1] - points[i, 1], points[i, 0] - points[j, 0]
        outside = out_x * (x - points[i, 0]) + out_y * (y - points[i, 1])
        speed = out_x * way_x + out_y * way_y
        if speed < 0.0:
            near = max(near, -outside / speed)
        elif speed > 0.0:
            far = min(far, -outside / speed)
        elif outside > 0.0:
            return math.inf
        if near > far:
            return math.inf
    return near


@subkernel
def in_sight(
    points: Array,
    first: Index,
    extent: Array,
    x: float,
    y: float,
    to_x: float,
    to_y: float,
) -> bool:
    """Whether no footprint lies on the straight line between two points."""
    way_x, way_y = to_x - x, to_y - y
    for k in range(extent.shape[0]):
        if crossing(points, first, extent, k, x, y, way_x, way_y, 0.0, 1.0) <= 1.0:
            return False
    return True


@kernel
def sees(
    points: Array,
    first: Index,
    extent: Array,
    x: float,
    y: float,
    to_x: float,
    to_y: float,
) -> bool:
    """`in_sight` for calls from Python."""
    return bool(in_sight(points, first, extent, x, y, to_x, to_y))


def at_ray_height(extent: Array, floor: float) -> NDArray[np.bool_]:
    """Which parts are neither too low nor too high for all rays, shape (n,)."""
    bottom = floor + HEIGHT
    return np.asarray(
        (extent[:, HIGH] >= bottom) & (extent[:, LOW] <= bottom + RANGE * _SIN + 1e-9)
    )


@subkernel
def sense(
    points: Array,
    first: Index,
    extent: Array,
    listed: Index,
    begin: int,
    end: int,
    floor: float,
    state: Array,
    readings: NDArray[np.float32],
    hits: Array,
) -> None:
    """Fills `readings` with those of ps0 to ps7, without noise.

    A ray rises from 33 mm to 44 mm above the floor: what is lower or higher is not
    seen. Of what it hits, the nearest part counts, as its distance divided by its
    reflectance.

    Args:
        points: See `tdac_envs.epuck.gaps`, as the next five.
        first: Of what is visible.
        extent: Of what is visible.
        listed: Numbers of the parts that may be in reach.
        begin: In `listed`.
        end: In `listed`.
        floor: Height of the ground, m.
        state: Begins with x, y and heading.
        readings: Shape (8,), overwritten.
        hits: Shape (8, 3), overwritten: way along the ray to what it hits or 0.07 m,
            that thing's reflectance, relative standard deviation of the reading.
    """
    x, y, heading = state[0], state[1], state[2]
    cos, sin = math.cos(heading), math.sin(heading)
    bottom = floor + HEIGHT
    for i in range(N_SENSORS):
        hits[i, 0], hits[i, 1] = RANGE, 1.0
    for n in range(begin, end):
        k = listed[n] if listed.shape[0] else n
        off_x, off_y = extent[k, MID_X] - x, extent[k, MID_Y] - y
        if math.sqrt(off_x * off_x + off_y * off_y) - extent[k, REACH] > FARTHEST:
            continue
        enter = (extent[k, LOW] - bottom) / _SIN
        leave = (extent[k, HIGH] - bottom) / _SIN
        for i in range(N_SENSORS):
            ray_x = x + cos * PLACES[i, 0] - sin * PLACES[i, 1]
            ray_y = y + sin * PLACES[i, 0] + cos * PLACES[i, 1]
            way_x = _COS * (cos * _WAYS[i, 0] - sin * _WAYS[i, 1])
            way_y = _COS * (sin * _WAYS[i, 0] + cos * _WAYS[i, 1])
            near, far = max(enter, 0.0), min(leave, hits[i, 0])
            at = crossing(
                points, first, extent, k, ray_x, ray_y, way_x, way_y, near, far
            )
            if at < hits[i, 0]:
                hits[i, 0], hits[i, 1] = at, extent[k, FACTOR]
    last = TABLE.shape[0] - 1
    for i in range(N_SENSORS):
        distance = hits[i, 0] / hits[i, 1]
        if distance >= RANGE:
            readings[i], hits[i, 2] = TABLE[last, 1], TABLE[last, 2]
        else:
            readings[i] = _interpolated(TABLE, distance, 1)
            hits[i, 2] = _interpolated(TABLE, distance, 2)


@kernel
def sense_ground(
    points: Array,
    first: Index,
    extent: Array,
    floor: float,
    state: Array,
    readings: NDArray[np.float32],
    spreads: Array,
) -> None:
    """Fills `readings` with those of gs0 to gs2 (left to right), without noise.

    They see the floor, of reflectance 1, or a flat thing that lies on it; arguments
    as for `sense`, with `readings` and `spreads` of shape (3,).
    """
    x, y, heading = state[0], state[1], state[2]
    cos, sin = math.cos(heading), math.sin(heading)
    for i in range(GROUND_PLACES.shape[0]):
        at_x = x + cos * GROUND_PLACES[i, 0] - sin * GROUND_PLACES[i, 1]
        at_y = y + sin * GROUND_PLACES[i, 0] + cos * GROUND_PLACES[i, 1]
        top, factor = floor, 1.0
        for k in range(extent.shape[0]):
            if top <= extent[k, HIGH] <= floor + GROUND_HEIGHT:
                inside = crossing(
                    points, first, extent, k, at_x, at_y, 0.0, 0.0, 0.0, 0.0
                )
                if inside == 0.0:
                    top, factor = extent[k, HIGH], extent[k, FACTOR]
        distance = (floor + GROUND_HEIGHT - top) / factor
        readings[i] = _interpolated(GROUND_TABLE, distance, 1)
        spreads[i] = _interpolated(GROUND_TABLE, distance, 2)
