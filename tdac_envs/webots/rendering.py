"""Renders images of prisms by casting one ray through each pixel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.epuck.prisms import HIGH, LOW, MID_X, MID_Y, ROUND, Array, Index

# Rows of `view`: position of the camera; direction through the centre of the upper left
# pixel, scaled so that its forward component is 1; steps to the next column and to the
# next row; forward direction.
POSITION, CORNER, RIGHT, DOWN, FORWARD = range(5)

# Columns of `paint`: colour; colour of every second square; a corner of the first
# square; direction of its first side; lengths of its sides.
COLOUR, OTHER, CORNER_X, CORNER_Y, COS, SIN, LENGTH, WIDTH, N_PAINT = (
    0, 3, 6, 7, 8, 9, 10, 11, 12
)  # fmt: skip

# Direction to the light, chosen so that all sides of a box differ in brightness.
_LIGHT = np.array((0.5, 0.2, 0.84))
_LIGHT_X, _LIGHT_Y, _LIGHT_Z = (_LIGHT / np.linalg.norm(_LIGHT)).tolist()
_DARKEST = 0.6
"""Brightness of a surface that faces directly away from the light."""
_COPLANAR = 1.0 + 1e-9
"""Factor on the depth: of two surfaces in one plane, the later one is visible."""


def look_through(
    place: Array, axes: Array, field_of_view: float, width: int, height: int
) -> Array:
    """The `view` of a camera, shape (5, 3).

    Args:
        place: Position, m, shape (3,).
        axes: Forward, left and up directions as columns, shape (3, 3).
        field_of_view: Horizontal field of view, rad.
        width: Width of the image, pixels.
        height: Height of the image, pixels.
    """
    forward, left, up = axes.T
    pixel = 2.0 * math.tan(field_of_view / 2.0) / width
    right, down = -pixel * left, -pixel * up
    corner = forward - (width - 1) / 2.0 * right - (height - 1) / 2.0 * down
    return np.array([place, corner, right, down, forward])


@subkernel
def brightness(x: float, y: float, z: float) -> float:
    """Brightness in [0.6, 1] of a surface with the normal (x, y, z), of length 1."""
    facing = x * _LIGHT_X + y * _LIGHT_Y + z * _LIGHT_Z
    return float(_DARKEST + (1.0 - _DARKEST) * (0.5 + 0.5 * facing))


@subkernel
def _entry(
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
) -> tuple[float, float, float]:
    """Where a line enters the footprint of a part; compare `infrared.crossing`.

    Returns:
        The least t in [near, far] at which the line is in the footprint, or inf; and
        x and y of the normal there, of any length, 0 if the line is inside at `near`.
    """
    begin, end = first[part], first[part + 1]
    out_x, out_y = 0.0, 0.0
    if end - begin == 1:
        off_x, off_y = x - points[begin, 0], y - points[begin, 1]
        square = dir_x * dir_x + dir_y * dir_y
        along = off_x * dir_x + off_y * dir_y
        rest = off_x * off_x + off_y * off_y - extent[part, ROUND] ** 2
        root = along * along - square * rest
        if root < 0.0 or square == 0.0:
            return math.inf, out_x, out_y
        root = math.sqrt(root)
        enter = (-along - root) / square
        if enter > near:
            near = enter
            out_x, out_y = off_x + enter * dir_x, off_y + enter * dir_y
        far = min(far, (-along + root) / square)
        return (near if near <= far else math.inf), out_x, out_y
    for i in range(begin, end):
        j = i + 1 if i + 1 < end else begin
        side_x, side_y = points[j, 1] - points[i, 1], points[i, 0] - points[j, 0]
        outside = side_x * (x - points[i, 0]) + side_y * (y - points[i, 1])
        speed = side_x * dir_x + side_y * dir_y
        if speed < 0.0:
            if -outside / speed > near:
                near, out_x, out_y = -outside / speed, side_x, side_y
        elif speed > 0.0:
            far = min(far, -outside / speed)
        elif outside > 0.0:
            return math.inf, out_x, out_y
        if near > far:
            return math.inf, out_x, out_y
    return near, out_x, out_y


@subkernel
def _along(view: Array, row: int, x: float, y: float, z: float) -> float:
    """Scalar product of a row of `view` and a vector."""
    return float(x * view[row, 0] + y * view[row, 1] + z * view[row, 2])


@subkernel
def _window(
    points: Array, first: Index, extent: Array, part: int, view: Array, near: float
) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of a part in the image; infinite if it is very close."""
    begin, end = first[part], first[part + 1]
    is_disc = end - begin == 1
    corners = 4 if is_disc else end - begin
    left, top, right, bottom = math.inf, math.inf, -math.inf, -math.inf
    across = _along(view, RIGHT, view[RIGHT, 0], view[RIGHT, 1], view[RIGHT, 2])
    corner = view[CORNER]
    first_column = _along(view, RIGHT, corner[0], corner[1], corner[2]) / across
    first_row = _along(view, DOWN, corner[0], corner[1], corner[2]) / across
    behind = 0
    for n in range(2 * corners):
        if is_disc:
            x = extent[part, MID_X] + extent[part, ROUND] * (1 - n % 2 * 2)
            y = extent[part, MID_Y] + extent[part, ROUND] * (1 - n // 2 % 2 * 2)
        else:
            x, y = points[begin + n % corners, 0], points[begin + n % corners, 1]
        z = extent[part, LOW] if n < corners else extent[part, HIGH]
        x, y, z = x - view[0, 0], y - view[0, 1], z - view[0, 2]
        away = _along(view, FORWARD, x, y, z)
        if away <= near:
            behind += 1
            continue
        column = _along(view, RIGHT, x, y, z) / (across * away) - first_column
        row = _along(view, DOWN, x, y, z) / (across * away) - first_row
        left, right = min(left, column), max(right, column)
        top, bottom = min(top, row), max(bottom, row)
    if 0 < behind < 2 * corners:
        return -math.inf, -math.inf, math.inf, math.inf
    return left, top, right, bottom


@subkernel
def _colour_at(paint: Array, x: float, y: float) -> int:
    """First column in `paint` of the colour of a point."""
    x, y = x - paint[CORNER_X], y - paint[CORNER_Y]
    ahead = math.floor((paint[COS] * x + paint[SIN] * y) / paint[LENGTH])
    aside = math.floor((paint[COS] * y - paint[SIN] * x) / paint[WIDTH])
    return OTHER if (ahead + aside) % 2 == 1 else COLOUR


@subkernel
def _draw_sky(view: Array, sky: Array, image: NDArray[np.uint8]) -> None:
    """Fills the image with the sky, whose colour depends on the ray's elevation."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            x = view[CORNER, 0] + column * view[RIGHT, 0] + row * view[DOWN, 0]
            y = view[CORNER, 1] + column * view[RIGHT, 1] + row * view[DOWN, 1]
            z = view[CORNER, 2] + column * view[RIGHT, 2] + row * view[DOWN, 2]
            rise = z / math.sqrt(x * x + y * y + z * z)
            end = 0 if rise > 0.0 else 2
            share = min(abs(rise) * (1.5 if end == 0 else 8.0), 1.0)
            for channel in range(3):
                level = share * sky[end, channel] + (1.0 - share) * sky[1, channel]
                image[row, column, 2 - channel] = round(255.0 * level)
            image[row, column, 3] = 255


@kernel
def render(
    points: Array,
    first: Index,
    extent: Array,
    paint: Array,
    view: Array,
    sky: Array,
    near: float,
    depth: Array,
    image: NDArray[np.uint8],
) -> None:
    """Renders prisms into an image.

    Args:
        points: See `Prisms`.
        first: See `Prisms`.
        extent: See `Prisms`.
        paint: Shape (n, 12): colours of the parts in [0, 1]; see `COLOUR`.
        view: Shape (5, 3); see `look_through`.
        sky: Shape (3, 3): colours above, at and below the horizon, in [0, 1].
        near: Distance of the near plane, m.
        depth: Shape (height, width), overwritten: distance along the view's forward
            direction, m; inf for sky.
        image: Shape (height, width, 4), overwritten: blue, green, red, 255.
    """
    rows, columns = depth.shape
    depth[:] = math.inf
    _draw_sky(view, sky, image)
    x, y, z = view[POSITION, 0], view[POSITION, 1], view[POSITION, 2]
    for k in range(extent.shape[0]):
        left, top, right, bottom = _window(points, first, extent, k, view, near)
        left, right = max(left - 1.0, 0.0), min(right + 2.0, float(columns))
        top, bottom = max(top - 1.0, 0.0), min(bottom + 2.0, float(rows))
        if left >= right or top >= bottom:
            continue
        for row in range(int(top), int(bottom)):
            for column in range(int(left), int(right)):
                dx = view[CORNER, 0] + column * view[RIGHT, 0] + row * view[DOWN, 0]
                dy = view[CORNER, 1] + column * view[RIGHT, 1] + row * view[DOWN, 1]
                dz = view[CORNER, 2] + column * view[RIGHT, 2] + row * view[DOWN, 2]
                enter, leave = near, depth[row, column] * _COPLANAR
                if dz != 0.0:
                    one, two = (extent[k, LOW] - z) / dz, (extent[k, HIGH] - z) / dz
                    enter, leave = max(enter, min(one, two)), min(leave, max(one, two))
                elif z < extent[k, LOW] or z > extent[k, HIGH]:
                    continue
                if enter > leave:
                    continue
                at, out_x, out_y = _entry(
                    points, first, extent, k, x, y, dx, dy, enter, leave
                )
                if at == math.inf:
                    continue
                depth[row, column] = at
                length = math.sqrt(out_x * out_x + out_y * out_y)
                if length > 0.0:
                    light = brightness(out_x / length, out_y / length, 0.0)
                else:
                    light = brightness(0.0, 0.0, -1.0 if dz > 0.0 else 1.0)
                own = _colour_at(paint[k], x + at * dx, y + at * dy)
                for channel in range(3):
                    level = 255.0 * light * paint[k, own + channel]
                    image[row, column, 2 - channel] = round(level)
