"""Floors of rooms with doors and furniture."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.generators.draft import (
    Band,
    GeneratorParameters,
    Share,
    WorldDraft,
    as_places,
    pixels,
    whole_pixels,
)
from tdac_envs.ladder.generators.furniture import furnish
from tdac_envs.ladder.random_stream import RandomStream


class Rooms(GeneratorParameters):
    """Parameters of rooms."""

    name: Literal["rooms"] = "rooms"
    sides: Band = Field((2.8, 6.0), description="Side of a room, body diameters.")
    doors: Band = Field((1.15, 1.6), description="Width, body diameters.")
    walls: Band = Field((0.15, 0.3), description="Thickness, body diameters.")
    loops: Share = Field(0.15, description="Share of the other walls with a door.")
    furniture: Share = Field(0.7, description="Chance of each of a room's pieces.")


class Room(NamedTuple):
    """A rectangle of floor: columns x0 to x1 and rows y0 to y1, the ends excluded."""

    x0: int
    y0: int
    x1: int
    y1: int


class Door(NamedTuple):
    """An opening between two rooms, and its middle."""

    hole: Room
    rooms: tuple[int, int]


def draw(random: RandomStream, params: Rooms, body: float) -> WorldDraft:
    """Draws a floor of rooms, all of which are connected by doors.

    Args:
        random: Random numbers.
        params: Size and shape.
        body: Diameter of the body, px.
    """
    wall = pixels(random, params.walls, body)
    # The walls outside differ, so that the same rooms do not lie at the same places.
    outside = [wall + random.integer(0, round(body / 2)) for _ in range(4)]
    right, bottom = params.width - outside[2], params.height - outside[3]
    rooms = _rooms(
        random, params, Room(outside[0], outside[1], right, bottom), wall, body
    )
    cells = np.ones((params.height, params.width), np.bool_)
    for x0, y0, x1, y1 in rooms:
        cells[y0:y1, x0:x1] = False
    reserved = np.zeros_like(cells)
    lane = whole_pixels(params.doors[0], body)
    for x0, y0, x1, y1 in (
        door.hole for door in _doors(random, params, rooms, wall, body)
    ):
        cells[y0:y1, x0:x1] = False
        reserved[max(y0 - lane, 0) : y1 + lane, max(x0 - lane, 0) : x1 + lane] = True
    for room in rooms:
        furnish(random, cells, reserved, room, params.furniture, lane, body)
    return WorldDraft(cells, as_places(_places(random, cells, rooms, lane)))


def _rooms(
    random: RandomStream, params: Rooms, whole: Room, wall: int, body: float
) -> list[Room]:
    """Halves a rectangle again and again, until no part is too large."""
    least, most = (whole_pixels(side, body) for side in params.sides)
    parts, rooms = [whole], []
    while parts:
        room = parts.pop()
        sides = room.x1 - room.x0, room.y1 - room.y0
        may = [axis for axis in (0, 1) if sides[axis] >= 2 * least + wall]
        must = [axis for axis in may if sides[axis] > most]
        if not may or (not must and random.chance(0.5)):
            rooms.append(room)
            continue
        axis = (
            max(must or may, key=lambda k: sides[k]) if random.chance(0.8) else may[-1]
        )
        begin = room[axis] + random.integer(least, sides[axis] - least - wall)
        first, second = list(room), list(room)
        first[axis + 2], second[axis] = begin, begin + wall
        parts += [Room(*second), Room(*first)]
    return rooms


def _doors(
    random: RandomStream, params: Rooms, rooms: list[Room], wall: int, body: float
) -> list[Door]:
    """A door per edge of a random spanning tree, and some more for loops."""
    least = whole_pixels(params.doors[0], body)
    found = [
        (hole, (a, b))
        for a in range(len(rooms))
        for b in range(a + 1, len(rooms))
        if (hole := _shared_wall(rooms[a], rooms[b], wall, least)) is not None
    ]
    group, doors = list(range(len(rooms))), []
    for hole, (a, b) in random.shuffled(found):
        if group[a] != group[b] or random.chance(params.loops):
            old, new = group[b], group[a]
            group = [new if member == old else member for member in group]
            width = pixels(random, params.doors, body)
            doors.append(Door(_narrowed(random, hole, wall, width), (a, b)))
    return doors


def _shared_wall(one: Room, other: Room, wall: int, least: int) -> Room | None:
    """The wall between two rooms, if it is long enough for a door and its jambs."""
    margin = 2
    for axis in (0, 1):
        for a, b in ((one, other), (other, one)):
            if a[axis + 2] + wall != b[axis]:
                continue
            begin = max(a[1 - axis], b[1 - axis]) + margin
            end = min(a[3 - axis], b[3 - axis]) - margin
            if end - begin >= least:
                hole = [0, 0, 0, 0]
                hole[axis], hole[axis + 2] = a[axis + 2], b[axis]
                hole[1 - axis], hole[3 - axis] = begin, end
                return Room(*hole)
    return None


def _narrowed(random: RandomStream, hole: Room, wall: int, width: int) -> Room:
    """A piece of this width of a wall, at a random place."""
    x0, y0, x1, y1 = hole
    along_x = y1 - y0 == wall and (x1 - x0 != wall or x1 - x0 >= y1 - y0)
    begin, end = (x0, x1) if along_x else (y0, y1)
    width = min(width, end - begin)
    begin += random.integer(0, end - begin - width)
    if along_x:
        return Room(begin, y0, begin + width, y1)
    return Room(x0, begin, x1, begin + width)


def _places(
    random: RandomStream, cells: BoolGrid, rooms: list[Room], lane: int
) -> list[tuple[int, int]]:
    """Up to two free points per room, half a lane from its walls."""
    places = []
    for x0, y0, x1, y1 in rooms:
        for _ in range(6):
            half = lane // 2 + 1
            x = random.integer(x0 + half, max(x1 - half, x0 + half))
            y = random.integer(y0 + half, max(y1 - half, y0 + half))
            window = cells[
                max(y - half, 0) : y + half + 1, max(x - half, 0) : x + half + 1
            ]
            if not window.any():
                places.append((x, y))
    return places
