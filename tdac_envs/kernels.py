"""Compiled geometry of TDAC-Map2D-v0: exact rays, exact motion, exact contact.

All functions work on a *padded* map: one occupied pixel is added on every side, so
that pixel (i, j) of the map is `padded[j + 1, i + 1]` and no ray needs a bounds test.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tdac_envs.grid import BoolGrid, FloatGrid

# From a point anywhere in a pixel, an obstacle is at most half a diagonal nearer
# than from the pixel's centre; the rest is for float32 rounding.
HALF_DIAGONAL = 0.7075
# A body that was stopped by an obstacle keeps this distance, px, so that the next
# step starts outside it.
CONTACT_GAP = 1e-6
_TWO_PI = 2.0 * math.pi


def pad(cells: BoolGrid, clear: FloatGrid) -> tuple[BoolGrid, FloatGrid]:
    """The cells and their clearance with the occupied border the kernels expect.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        clear: Shape (height, width), float32, from `grid.clearance`.

    Returns:
        Both with shape (height + 2, width + 2).
    """
    return np.pad(cells, 1, constant_values=True), np.pad(clear, 1)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def cast_ray(
    cells: BoolGrid,
    clear: FloatGrid,
    x: float,
    y: float,
    angle: float,
    range_max: float,
) -> float:
    """Distance from (x, y) along `angle` to the first occupied square, px.

    Grid traversal after Amanatides and Woo (1987), with leaps through open space by
    the clearance of the pixel under the ray. No hit gives `range_max`.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        x: Column in map pixels.
        y: Row in map pixels.
        angle: Direction, rad, from +x towards +y.
        range_max: Longest distance, px.
    """
    u, v = x + 1.5, y + 1.5
    i, j = int(math.floor(u)), int(math.floor(v))
    if i < 0 or j < 0 or j >= cells.shape[0] or i >= cells.shape[1] or cells[j, i]:
        return 0.0
    dx, dy = math.cos(angle), math.sin(angle)
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    ahead_x, ahead_y = (1 if dx > 0.0 else 0), (1 if dy > 0.0 else 0)
    inv_x = 1.0 / dx if dx != 0.0 else math.inf
    inv_y = 1.0 / dy if dy != 0.0 else math.inf
    t = 0.0
    while True:
        leap = clear[j, i] - HALF_DIAGONAL
        if leap > 1.0:
            t += leap
            if t >= range_max:
                return range_max
            i, j = int(math.floor(u + dx * t)), int(math.floor(v + dy * t))
        next_x = (i + ahead_x - u) * inv_x if dx != 0.0 else math.inf
        next_y = (j + ahead_y - v) * inv_y if dy != 0.0 else math.inf
        while True:
            # A ray along a border may meet, after a leap, one that lies behind it.
            if next_x < next_y:
                t = max(t, next_x)
                i += step_x
                next_x = (i + ahead_x - u) * inv_x
            else:
                t = max(t, next_y)
                j += step_y
                next_y = (j + ahead_y - v) * inv_y
            if t >= range_max:
                return range_max
            if cells[j, i]:
                return t
            if clear[j, i] > 3.0:
                break


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def cast_rays(
    cells: BoolGrid,
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    field_of_view: float,
    range_max: float,
    out: NDArray[np.float32],
) -> None:
    """Fills `out` with the fan of ranges; `out[0]` is the robot's leftmost ray.

    Ray i points at `heading - field_of_view / 2 + i * field_of_view / (n - 1)`; a
    single ray points ahead.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        x: Column in map pixels.
        y: Row in map pixels.
        heading: rad, from +x towards +y.
        field_of_view: Whole angle of the fan, rad.
        range_max: Range without a hit, px.
        out: Shape (n_rays,), float32, overwritten.
    """
    n = out.shape[0]
    first = heading - 0.5 * field_of_view if n > 1 else heading
    step = field_of_view / (n - 1) if n > 1 else 0.0
    for k in range(n):
        out[k] = cast_ray(cells, clear, x, y, first + k * step, range_max)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def wrap_angle(angle: float) -> float:
    """The same direction in (-pi, pi]."""
    wrapped = angle - _TWO_PI * math.floor((angle + math.pi) / _TWO_PI)
    return math.pi if wrapped <= -math.pi else wrapped


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def move(
    x: float, y: float, heading: float, forward: float, turn: float
) -> tuple[float, float, float]:
    """Pose after the exact arc of `forward` px and `turn` rad; heading unwrapped."""
    if abs(turn) < 1e-7:
        middle = heading + 0.5 * turn
        end_x = x + forward * math.cos(middle)
        end_y = y + forward * math.sin(middle)
    else:
        radius = forward / turn
        end_x = x + radius * (math.sin(heading + turn) - math.sin(heading))
        end_y = y - radius * (math.cos(heading + turn) - math.cos(heading))
    return end_x, end_y, heading + turn


@njit(cache=True, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def _square_distance2(x: float, y: float, i: int, j: int) -> float:
    dx = max(abs(x - i) - 0.5, 0.0)
    dy = max(abs(y - j) - 0.5, 0.0)
    return dx * dx + dy * dy


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _line_contact(
    x: float, y: float, vx: float, vy: float, i: int, j: int, r: float
) -> float:
    """Fraction of the straight step at which the disc touches square (i, j)."""
    best = 2.0
    for side in (-1.0, 1.0):
        if vx * side < 0.0:
            s = (i + side * (0.5 + r) - x) / vx
            if 0.0 <= s < best and abs(y + s * vy - j) <= 0.5:
                best = s
        if vy * side < 0.0:
            s = (j + side * (0.5 + r) - y) / vy
            if 0.0 <= s < best and abs(x + s * vx - i) <= 0.5:
                best = s
    a = vx * vx + vy * vy
    for side_x in (-0.5, 0.5):
        for side_y in (-0.5, 0.5):
            px, py = x - (i + side_x), y - (j + side_y)
            b = px * vx + py * vy
            root = b * b - a * (px * px + py * py - r * r)
            if b < 0.0 and root > 0.0:
                s = (-b - math.sqrt(root)) / a
                if 0.0 <= s < best:
                    best = s
    return best


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _arc_contact(
    x: float,
    y: float,
    cx: float,
    cy: float,
    turn: float,
    i: int,
    j: int,
    r: float,
) -> float:
    """As `_line_contact`, for the rotation by `turn` about the point (cx, cy)."""
    rho = math.hypot(x - cx, y - cy)
    begin = math.atan2(y - cy, x - cx)
    sign = 1.0 if turn > 0.0 else -1.0
    length = abs(turn)
    best = 2.0
    for side in (-1.0, 1.0):
        q = (i + side * (0.5 + r) - cx) / rho
        if abs(q) < 1.0:
            for branch in (-1.0, 1.0):
                alpha = branch * math.acos(q)
                inward = -sign * math.sin(alpha) * side < 0.0
                phi = (sign * (alpha - begin)) % _TWO_PI
                if inward and phi < best * length and phi <= length:
                    if abs(cy + rho * math.sin(alpha) - j) <= 0.5:
                        best = phi / length
        q = (j + side * (0.5 + r) - cy) / rho
        if abs(q) < 1.0:
            for branch in (-1.0, 1.0):
                alpha = 0.5 * math.pi + branch * math.acos(q)
                inward = sign * math.cos(alpha) * side < 0.0
                phi = (sign * (alpha - begin)) % _TWO_PI
                if inward and phi < best * length and phi <= length:
                    if abs(cx + rho * math.cos(alpha) - i) <= 0.5:
                        best = phi / length
    for side_x in (-0.5, 0.5):
        for side_y in (-0.5, 0.5):
            kx, ky = i + side_x, j + side_y
            d = math.hypot(kx - cx, ky - cy)
            if d == 0.0:
                continue
            q = (rho * rho + d * d - r * r) / (2.0 * rho * d)
            if abs(q) >= 1.0:
                continue
            for branch in (-1.0, 1.0):
                alpha = math.atan2(ky - cy, kx - cx) + branch * math.acos(q)
                px = cx + rho * math.cos(alpha) - kx
                py = cy + rho * math.sin(alpha) - ky
                towards = sign * (-math.sin(alpha) * px + math.cos(alpha) * py)
                phi = (sign * (alpha - begin)) % _TWO_PI
                if towards < 0.0 and phi < best * length and phi <= length:
                    best = phi / length
    return best


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def first_contact(
    cells: BoolGrid,
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
) -> float:
    """Fraction of a step at which a disc first touches an occupied square.

    Exact for the arc of constant wheel speeds: the centre's arc is intersected with
    every nearby square grown by the disc (four edges and four corner circles).

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        x: Column of the disc's centre, px.
        y: Row of the disc's centre, px.
        heading: rad, from +x towards +y.
        forward: Arc length of the step, px, negative backwards.
        turn: Change of heading over the step, rad.
        radius: Disc radius, px.

    Returns:
        In [0, 1]; 2.0 where the step is free. A disc that starts in touch and
        moves away or along is free.
    """
    length = abs(forward)
    column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
    if length == 0.0 or clear[row + 1, column + 1] > radius + length + HALF_DIAGONAL:
        return 2.0
    end_x, end_y, _ = move(x, y, heading, forward, turn)
    straight = abs(turn) < 1e-7
    vx, vy = end_x - x, end_y - y
    cx, cy = 0.0, 0.0
    if not straight:
        arc_radius = forward / turn
        cx = x - arc_radius * math.sin(heading)
        cy = y + arc_radius * math.cos(heading)
    near = (radius + 0.5 * length + 1e-6) ** 2
    reach = int(math.ceil(radius + length)) + 1
    best = 2.0
    for j in range(max(row - reach, -1), min(row + reach + 1, cells.shape[0] - 1)):
        for i in range(
            max(column - reach, -1), min(column + reach + 1, cells.shape[1] - 1)
        ):
            if not cells[j + 1, i + 1]:
                continue
            # Every point of the arc is within half its length of one of its ends.
            if (
                _square_distance2(x, y, i, j) > near
                and _square_distance2(end_x, end_y, i, j) > near
            ):
                continue
            if straight:
                touch = _line_contact(x, y, vx, vy, i, j, radius)
            else:
                touch = _arc_contact(x, y, cx, cy, turn, i, j, radius)
            if touch <= 1.0 and touch < best:
                best = touch
    return best


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def path_distance(field: FloatGrid, x: float, y: float, previous: float) -> float:
    """Length of the shortest path to the goal from any point, px.

    The least sum of the way to a nearby pixel and that pixel's distance. Where no
    pixel within 2 px has a path (the body is squeezed into a corner), `previous`.

    Args:
        field: Shape (height, width), float32, from `plan.distance_field`.
        x: Column, px.
        y: Row, px.
        previous: Value to fall back to.
    """
    height, width = field.shape
    column, row = int(math.floor(x)), int(math.floor(y))
    for ring in range(3):
        best = math.inf
        for j in range(max(row - ring, 0), min(row + ring + 2, height)):
            for i in range(max(column - ring, 0), min(column + ring + 2, width)):
                through = field[j, i] + math.hypot(x - i, y - j)
                best = min(best, through)
        if best < math.inf:
            return best
    return previous


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def sees(
    cells: BoolGrid, clear: FloatGrid, x: float, y: float, to_x: float, to_y: float
) -> bool:
    """Whether the segment between two points crosses no occupied square."""
    distance = math.hypot(to_x - x, to_y - y)
    if distance == 0.0:
        return True
    angle = math.atan2(to_y - y, to_x - x)
    return bool(cast_ray(cells, clear, x, y, angle, distance) >= distance)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def advance(
    cells: BoolGrid,
    clear: FloatGrid,
    state: NDArray[np.float64],
    left: float,
    right: float,
    axle: float,
    dt: float,
    radius: float,
) -> bool:
    """Moves the robot by one step at constant wheel speeds, up to a contact.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        state: x, y (px) and heading (rad); overwritten.
        left: Speed of the left wheel, px/s.
        right: Speed of the right wheel, px/s.
        axle: Distance of the wheels, px.
        dt: Duration, s.
        radius: Body radius, px.

    Returns:
        Whether the body touched an obstacle. It then stands `CONTACT_GAP` before
        the touching pose, with the heading it had there.
    """
    forward = 0.5 * (left + right) * dt
    # y points down, so a positive turn is clockwise on the screen.
    turn = (left - right) * dt / axle
    touch = first_contact(
        cells, clear, state[0], state[1], state[2], forward, turn, radius
    )
    fraction = 1.0
    if touch <= 1.0:
        fraction = max(touch - CONTACT_GAP / abs(forward), 0.0)
    x, y, heading = move(
        state[0], state[1], state[2], fraction * forward, fraction * turn
    )
    state[0], state[1], state[2] = x, y, wrap_angle(heading)
    return bool(touch <= 1.0)
