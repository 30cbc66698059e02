"""The e-puck's infra-red sensors: positions, rays and readings.

The numbers are those of Webots' E-puck PROTO (R2020a to R2025a). Seen from above, the
sensors are numbered clockwise: ps0 to ps3 on the right side, ps4 to ps7 on the left.
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
"""Height of a ray's origin above the ground, m, and elevation of the ray, rad."""
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
"""Shape (8, 3): x (forward) and y (left), m, and azimuth (counter-clockwise), rad."""
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
"""Shape (10, 3): distance, m; reading; relative standard deviation of the reading."""
LARGEST = 4200.0
"""Upper limit of a noisy reading."""
_COS, _SIN = math.cos(ELEVATION), math.sin(ELEVATION)
_DIRECTIONS = np.column_stack([np.cos(PLACES[:, 2]), np.sin(PLACES[:, 2])])
FARTHEST = 0.11
"""Bound on the distance of any point of a ray from the robot's centre, m."""

# Ground sensors, which look straight down: x, y; height and range; all in m.
GROUND_PLACES = np.array([(0.03, 0.01), (0.03, 0.0), (0.03, -0.01)])
GROUND_HEIGHT, GROUND_RANGE = 0.003, 0.016
GROUND_TABLE = np.array([(0.0, 1000.0, 0.002), (0.016, 300.0, 0.004)])


def rays_at(x: float, y: float, heading: float, floor: float) -> tuple[Array, Array]:
    """Origins (m) and directions (unit vectors) of ps0 to ps7, each of shape (8, 3)."""
    cos, sin = math.cos(heading), math.sin(heading)
    turn = np.array([(cos, sin), (-sin, cos)])
    tall = np.full(N_SENSORS, floor + HEIGHT), np.full(N_SENSORS, _SIN)
    origins, along = PLACES[:, :2] @ turn + (x, y), _COS * _DIRECTIONS @ turn
    return np.column_stack([origins, tall[0]]), np.column_stack([along, tall[1]])


@subkernel
def _interpolated(table: Array, distance: float, column: int) -> float:
    """Interpolates a table linearly in its first column; constant beyond its ends."""
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
    """Reading of a sensor, without noise.

    Args:
        distance: Distance along the ray divided by the object's reflectance, m.
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
    dir_x: float,
    dir_y: float,
    near: float,
    far: float,
) -> float:
    """The first crossing of a line with the footprint of a part.

    Returns:
        The least t in [near, far] for which (x, y) + t (dir_x, dir_y) is in the
        footprint; inf if there is none.
    """
    begin, end = first[part], first[part + 1]
    if end - begin == 1:
        off_x, off_y = x - points[begin, 0], y - points[begin, 1]
        square = dir_x * dir_x + dir_y * dir_y
        along = off_x * dir_x + off_y * dir_y
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
        speed = out_x * dir_x + out_y * dir_y
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
    """Whether no footprint intersects the straight line between two points."""
    dir_x, dir_y = to_x - x, to_y - y
    for k in range(extent.shape[0]):
        if crossing(points, first, extent, k, x, y, dir_x, dir_y, 0.0, 1.0) <= 1.0:
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
    """Whether each part overlaps the height range of the rays, shape (n,), bool."""
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
    """Computes the readings of ps0 to ps7, without noise.

    A ray rises from 33 mm to 44 mm above the floor and misses parts that lie below or
    above it. The reading follows from the distance to the nearest part hit, divided by
    the part's reflectance.

    Args:
        points: Vertices of the visible parts; see `tdac_envs.epuck.gaps`.
        first: See `points`.
        extent: See `points`.
        listed: Indices of the parts to check.
        begin: First entry of `listed` to check.
        end: End of these entries.
        floor: Height of the ground, m.
        state: Begins with x, y and heading.
        readings: Shape (8,), overwritten.
        hits: Shape (8, 3), overwritten: length of the ray to the hit, at most 0.07 m;
            reflectance of the part hit; relative standard deviation of the reading.
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
            dir_x = _COS * (cos * _DIRECTIONS[i, 0] - sin * _DIRECTIONS[i, 1])
            dir_y = _COS * (sin * _DIRECTIONS[i, 0] + cos * _DIRECTIONS[i, 1])
            near, far = max(enter, 0.0), min(leave, hits[i, 0])
            at = crossing(
                points, first, extent, k, ray_x, ray_y, dir_x, dir_y, near, far
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
    """Computes the readings of gs0 to gs2 (left to right), without noise.

    They see the floor, whose reflectance is 1, or a flat object on it. Arguments as for
    `sense`; `readings` and `spreads` (standard deviations) have shape (3,).
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
