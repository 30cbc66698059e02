"""Bundled maps of a street, furnished rooms and a playroom, from above."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from tools.draw_maps.ink import (
    Area,
    Colour,
    Image,
    Point,
    Points,
    box,
    disc,
    line,
    polygon,
    scan,
    sheet,
    wall,
)

_ROAD: Colour = (224, 223, 219)
_PAVING: Colour = (236, 234, 228)
_LAWN: Colour = (198, 218, 176)
_TREES: tuple[Colour, ...] = ((62, 104, 58), (74, 118, 62), (54, 92, 60))
_ROOFS: tuple[Colour, ...] = (
    (150, 76, 56), (126, 64, 50), (98, 96, 102),
    (114, 90, 72), (76, 82, 94), (136, 94, 64),
)  # fmt: skip
_CARS: tuple[Colour, ...] = ((150, 34, 40), (40, 62, 110), (52, 54, 58), (34, 92, 96))


def _turned(points: Points) -> list[Point]:
    """The points turned by 7 degrees about the middle of the town."""
    cos, sin = math.cos(math.radians(7)), math.sin(math.radians(7))
    shifted = [(x - 450, y - 450) for x, y in points]
    return [(450 + x * cos - y * sin, 450 + x * sin + y * cos) for x, y in shifted]


def _plot(page: Image, area: Area, colour: Colour) -> None:
    """Fills a rectangle of the turned town."""
    left, top, right, bottom = area
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    polygon(page, _turned(corners), colour)


def _house(page: Image, rng: np.random.Generator, area: Area) -> None:
    """Draws a house: a ridged roof with one side in the light."""
    left, top, right, bottom = area
    colour = _ROOFS[int(rng.integers(len(_ROOFS)))]
    _plot(page, area, colour)
    shade = (colour[0] * 4 // 5, colour[1] * 4 // 5, colour[2] * 4 // 5)
    if right - left > bottom - top:
        _plot(page, (left, (top + bottom) / 2, right, bottom), shade)
    else:
        _plot(page, ((left + right) / 2, top, right, bottom), shade)


def _block(page: Image, rng: np.random.Generator, area: Area, depth: float) -> None:
    """Draws a closed block of houses, `depth` px deep, around a green court."""
    left, top, right, bottom = area
    _plot(page, (left - 5, top - 5, right + 5, bottom + 5), _PAVING)
    _plot(page, area, _LAWN)
    count = max(round((right - left) / 50), 2)
    for a, b in ((top, left), (bottom - depth, left)):
        edges = np.linspace(b, right, count + int(rng.integers(2))).tolist()
        for x0, x1 in pairwise(edges):
            _house(page, rng, (x0, a, x1, a + depth))
    for x in (left, right - depth):
        houses = max(round((bottom - top - 2 * depth) / 50), 1)
        edges = np.linspace(top + depth, bottom - depth, houses + 1).tolist()
        for y0, y1 in pairwise(edges):
            _house(page, rng, (x, y0, x + depth, y1))


def _tree(page: Image, rng: np.random.Generator, at: Point, radius: float) -> None:
    (x, y) = _turned([at])[0]
    disc(page, (x, y), radius, _TREES[int(rng.integers(len(_TREES)))])
    for _ in range(5):
        angle = rng.random() * 2 * math.pi
        leaf = (x + 0.6 * radius * math.cos(angle), y + 0.6 * radius * math.sin(angle))
        disc(page, leaf, 0.45 * radius, _TREES[int(rng.integers(len(_TREES)))])


def draw_street(rng: np.random.Generator) -> Image:
    """Blocks of houses along streets; the court of the middle one has a gateway."""
    page = sheet(900, 900, _ROAD)
    spans = ((-110, 48), (114, 254), (320, 580), (646, 786), (852, 1010))
    for middle in (81, 287, 613, 819):
        for at in range(-60, 960, 36):
            _plot(page, (middle - 1, at, middle + 1, at + 16), (244, 243, 240))
            _plot(page, (at, middle - 1, at + 16, middle + 1), (244, 243, 240))
    for top, bottom in spans:
        for left, right in spans:
            _block(page, rng, (left, top, right, bottom), 42)
    _plot(page, (641, 641, 791, 791), _LAWN)
    for tree in ((668, 668), (738, 676), (680, 744), (760, 750)):
        _tree(page, rng, tree, 15)
    # A gateway narrower than three body radii.
    _plot(page, (536, 434, 584, 467), _PAVING)
    for tree in ((386, 388), (514, 510), (386, 514)):
        _tree(page, rng, tree, 9)
    for x, y in (
        (330, 304),
        (480, 270),
        (600, 380),
        (270, 210),
        (630, 560),
        (430, 628),
    ):
        along = y in (304, 270, 628)
        half = (13, 6) if along else (6, 13)
        car = (x - half[0], y - half[1], x + half[0], y + half[1])
        _plot(page, car, _CARS[int(rng.integers(len(_CARS)))])
    return scan(page, rng, 0.25)


_PLASTER: Colour = (66, 58, 54)
_FLOORS: tuple[Colour, ...] = (
    (236, 222, 198), (226, 232, 236), (238, 230, 214), (228, 236, 226), (242, 236, 224),
    (236, 222, 198), (234, 226, 232), (226, 232, 236), (238, 230, 214),
)  # fmt: skip


def _furnish(page: Image) -> None:
    """Draws sofas, beds, tables and plants."""
    for left, top, right, bottom, colour in (
        (50, 60, 90, 170, (62, 84, 120)), (150, 40, 230, 72, (120, 78, 48)),
        (330, 46, 420, 82, (96, 104, 72)), (498, 195, 519, 262, (120, 78, 48)),
        (660, 44, 756, 150, (110, 66, 86)), (580, 44, 610, 80, (120, 78, 48)),
        (40, 468, 66, 518, (120, 78, 48)), (44, 640, 140, 756, (58, 96, 112)),
        (200, 724, 262, 758, (120, 78, 48)), (340, 724, 480, 758, (84, 84, 92)),
        (724, 330, 758, 460, (84, 84, 92)), (620, 640, 710, 700, (120, 78, 48)),
        (724, 560, 758, 620, (62, 84, 120)),
    ):  # fmt: skip
        box(page, (left, top, right, bottom), colour)
        light = (colour[0] * 6 // 5, colour[1] * 6 // 5, colour[2] * 6 // 5)
        box(page, (left + 5, top + 5, right - 5, bottom - 5), light)
    for at in ((60, 240), (505, 60), (750, 230), (60, 360), (300, 740), (750, 750)):
        disc(page, at, 12, (70, 110, 62))
        disc(page, at, 5, (48, 84, 50))
    for at in ((606, 668), (726, 668), (665, 628), (665, 714)):
        disc(page, at, 11, (96, 62, 40))


def draw_rooms(rng: np.random.Generator) -> Image:
    """A flat of nine furnished rooms; the middle one has a single narrow door."""
    page = sheet(800, 800, (250, 249, 247))
    edges = (30, 277, 523, 770)
    for k, colour in enumerate(_FLOORS):
        x, y = edges[k % 3], edges[k // 3]
        box(page, (x, y, x + 247, y + 247), colour)
        shade = (colour[0] - 8, colour[1] - 8, colour[2] - 8)
        for step in range(20, 247, 20):
            ends = [(step, 0), (step, 247)] if k % 2 else [(0, step), (247, step)]
            line(page, [(x + a, y + b) for a, b in ends], 0.8, shade)
    disc(page, (400, 400), 62, (226, 206, 196))
    disc(page, (400, 400), 50, (236, 220, 210))
    _furnish(page)
    line(page, [(30, 30), (770, 30), (770, 770), (30, 770)], 12, _PLASTER, closed=True)
    for at, doors in (
        (277, [(90, 150), (570, 630)]),
        (523, [(90, 150), (350, 390), (600, 660)]),
    ):
        wall(page, ((at, 30), (at, 770)), 8, _PLASTER, doors)
    for at, doors in ((277, [(150, 210), (600, 660)]), (523, [(600, 660)])):
        wall(page, ((30, at), (770, at)), 8, _PLASTER, doors)
    return scan(page, rng, 0.8)


_TOYS: tuple[Colour, ...] = (
    (196, 44, 48), (38, 78, 168), (34, 120, 70), (120, 56, 140), (196, 84, 30),
)  # fmt: skip
_BLOCKS: Colour = (134, 84, 46)
_PENS: tuple[Points, ...] = (
    ((250, 250), (420, 250), (420, 450), (250, 450)),
    ((660, 323), (660, 250), (500, 250), (500, 450), (660, 450), (660, 377)),
)


def _toy(page: Image, rng: np.random.Generator, at: Point) -> None:
    """Draws a ball, a building block or a book."""
    colour = _TOYS[int(rng.integers(len(_TOYS)))]
    dark = (colour[0] * 3 // 4, colour[1] * 3 // 4, colour[2] * 3 // 4)
    if rng.random() < 0.35:
        disc(page, at, 13, dark)
        disc(page, (at[0] - 2, at[1] - 2), 10, colour)
        return
    width, height = float(rng.integers(12, 24)), float(rng.integers(9, 15))
    turn = rng.random() * math.pi
    cos, sin = math.cos(turn), math.sin(turn)
    for scale, shade in ((1.0, dark), (0.75, colour)):
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        sized = [(scale * width * a, scale * height * b) for a, b in corners]
        turned = [
            (at[0] + a * cos - b * sin, at[1] + a * sin + b * cos) for a, b in sized
        ]
        polygon(page, turned, shade)


def draw_clutter(rng: np.random.Generator) -> Image:
    """A playroom floor: toys all over, and two pens built of wooden blocks."""
    page = sheet(900, 700, (226, 206, 168))
    for y in range(0, 700, 35):
        line(page, [(0, y), (900, y)], 0.8, (212, 190, 150))
        for x in range(30 + 97 * (y // 35) % 180, 900, 180):
            line(page, [(x, y), (x, y + 35)], 0.8, (212, 190, 150))
    line(page, [(0, 0), (899, 0), (899, 699), (0, 699)], 24, (92, 70, 56), closed=True)
    taken: list[Point] = [
        (x, y) for x in range(235, 690, 20) for y in range(235, 470, 20)
    ]
    while len(taken) < 276 + 26:
        at = (float(rng.integers(70, 830)), float(rng.integers(70, 630)))
        if all(math.hypot(at[0] - x, at[1] - y) > 84 for x, y in taken):
            _toy(page, rng, at)
            taken.append(at)
    for points in _PENS:
        line(page, points, 16, _BLOCKS)
        line(page, points, 11, (158, 104, 60))
    return scan(page, rng, 1.0)
