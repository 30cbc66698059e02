"""Furniture of a room: cupboards and sofas at walls, tables where there is room."""

from __future__ import annotations

import numpy as np

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.generators.draft import fill_disc, whole_pixels
from tdac_envs.ladder.random_stream import RandomStream

Box = tuple[int, int, int, int]
"""Columns x0 to x1 and rows y0 to y1, as (x0, y0, x1, y1), the ends excluded."""

_TRIES = 8
_PIECES_AT_WALLS, _TABLES = 3, 2


def furnish(
    random: RandomStream,
    cells: BoolGrid,
    reserved: BoolGrid,
    room: Box,
    chance: float,
    lane: int,
    body: float,
) -> None:
    """Puts furniture into a room; a body passes everywhere beside it.

    Args:
        random: Random numbers.
        cells: Shape (height, width), bool; is changed.
        reserved: Shape (height, width), bool: floor in front of doors, to be kept free.
        room: The room.
        chance: Chance of each piece.
        lane: Width of floor that stays free around a piece, px.
        body: Diameter of the body, px.
    """
    for _ in range(_PIECES_AT_WALLS):
        if random.chance(chance):
            _at_wall(random, cells, reserved, room, lane, body)
    for _ in range(_TABLES):
        if random.chance(chance):
            _table(random, cells, reserved, room, lane, body)


def _at_wall(
    random: RandomStream,
    cells: BoolGrid,
    reserved: BoolGrid,
    room: Box,
    lane: int,
    body: float,
) -> None:
    """A cupboard along a wall, a deep bed, or an L-shaped sofa in a corner."""
    for _ in range(_TRIES):
        depth = whole_pixels(random.uniform(0.35, 0.9), body)
        length = whole_pixels(random.uniform(0.8, 2.2), body)
        in_corner, left, top, upright = (random.chance(0.5) for _ in range(4))
        size = (depth, length) if upright else (length, depth)
        x0, y0, x1, y1 = room
        spare_x, spare_y = x1 - x0 - size[0], y1 - y0 - size[1]
        if spare_x < lane or spare_y < lane:
            continue
        x = x0 if left else x1 - size[0]
        y = y0 if top else y1 - size[1]
        if not in_corner and upright:
            y = _within(random, y0, y1, size[1], lane)
        elif not in_corner:
            x = _within(random, x0, x1, size[0], lane)
        box = (x, y, x + size[0], y + size[1])
        if not _is_free(cells, reserved, room, box, lane):
            continue
        _fill(cells, box)
        if in_corner and random.chance(0.35):
            arm = (
                (depth, depth + length // 2)
                if not upright
                else (depth + length // 2, depth)
            )
            ax = x0 if left else x1 - arm[0]
            ay = y0 if top else y1 - arm[1]
            other = (ax, ay, ax + arm[0], ay + arm[1])
            if not _touches(reserved, other) and _leaves_lane(room, other, lane):
                _fill(cells, other)
        return


def _within(random: RandomStream, begin: int, end: int, size: int, lane: int) -> int:
    """Where a piece begins along its wall: with a lane at both ends, if possible."""
    low, high = begin + lane, end - lane - size
    return random.integer(low, high) if low <= high else begin


def _table(
    random: RandomStream,
    cells: BoolGrid,
    reserved: BoolGrid,
    room: Box,
    lane: int,
    body: float,
) -> None:
    """A round or rectangular table with a lane on all sides."""
    for _ in range(_TRIES):
        width, height = (whole_pixels(random.uniform(0.5, 1.6), body) for _ in range(2))
        is_round = random.chance(0.4)
        if is_round:
            height = width
        x0, y0, x1, y1 = room
        spare_x, spare_y = x1 - x0 - width - 2 * lane, y1 - y0 - height - 2 * lane
        if spare_x < 0 or spare_y < 0:
            continue
        x = x0 + lane + random.integer(0, spare_x)
        y = y0 + lane + random.integer(0, spare_y)
        box = (x, y, x + width, y + height)
        if not _is_free(cells, reserved, room, box, lane):
            continue
        if is_round:
            fill_disc(
                cells, 16 * x + 8 * (width - 1), 16 * y + 8 * (width - 1), 8 * width
            )
        else:
            _fill(cells, box)
        return


def _is_free(
    cells: BoolGrid, reserved: BoolGrid, room: Box, box: Box, lane: int
) -> bool:
    """Whether a piece blocks no door and is a lane away from all other pieces."""
    x0, y0 = max(box[0] - lane, room[0]), max(box[1] - lane, room[1])
    x1, y1 = min(box[2] + lane, room[2]), min(box[3] + lane, room[3])
    return not _touches(reserved, box) and not cells[y0:y1, x0:x1].any()


def _leaves_lane(room: Box, box: Box, lane: int) -> bool:
    """Whether there is a lane between a piece in a corner and the walls opposite."""
    width = room[2] - room[0] - (box[2] - box[0])
    return width >= lane and room[3] - room[1] - (box[3] - box[1]) >= lane


def _touches(marked: BoolGrid, box: Box) -> bool:
    return bool(np.any(marked[box[1] : box[3], box[0] : box[2]]))


def _fill(cells: BoolGrid, box: Box) -> None:
    cells[box[1] : box[3], box[0] : box[2]] = True
