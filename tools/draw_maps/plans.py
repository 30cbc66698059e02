"""Bundled maps drawn as plans: an office, a thin-walled gallery, a ship's deck."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from tools.draw_maps.ink import (
    Colour,
    Image,
    Point,
    arc,
    box,
    disc,
    line,
    scan,
    sheet,
    wall,
    write,
)

_WALL: Colour = (52, 54, 60)
_FAINT: Colour = (206, 208, 212)
_LABEL: Colour = (182, 184, 190)
_DESK: Colour = (128, 104, 84)

_NAVY: Colour = (17, 42, 92)
_GRID: Colour = (27, 55, 110)
_CHALK: Colour = (228, 236, 246)
_DIM: Colour = (66, 98, 156)


def _desk(page: Image, x: float, y: float, chair: float) -> None:
    """Draws a desk with a screen, and a chair `chair` px below (above if negative)."""
    box(page, (x - 24, y - 12, x + 24, y + 12), _WALL)
    box(page, (x - 22, y - 10, x + 22, y + 10), _DESK)
    box(page, (x - 10, y - 3, x + 10, y + 1), _WALL)
    disc(page, (x, y + chair), 6, (96, 110, 128))


def _swing(page: Image, hinge: Point, width: float, first: float) -> None:
    """Draws the faint quarter circle that a door leaf sweeps."""
    points = arc(hinge, width, first, first + 90)
    line(page, [hinge, *points], 1.2, _FAINT)


def _outer_rooms(page: Image) -> None:
    """Draws the rooms along the outer walls, one door each."""
    wall(page, ((34, 164), (780, 164)), 6, _WALL, _OFFICE_DOORS)
    for x in (220, 406, 594, 780):
        wall(page, ((x, 34), (x, 164)), 6, _WALL)
    wall(page, ((34, 536), (966, 536)), 6, _WALL, _OFFICE_DOORS_BELOW)
    for x in (260, 500, 740):
        wall(page, ((x, 536), (x, 666)), 6, _WALL)
    wall(page, ((810, 230), (810, 536)), 6, _WALL, [(60, 104)])
    wall(page, ((810, 230), (966, 230)), 6, _WALL)
    for x, y, first in ((54, 164, 0), (250, 164, 0), (620, 164, 0), (436, 164, 0)):
        _swing(page, (x, y - 3), 44, first - 90)
    for x in (80, 300, 640, 800):
        _swing(page, (x, 539), 44, 0)


_OFFICE_DOORS = [(20, 64), (216, 260), (402, 446), (586, 630)]
_OFFICE_DOORS_BELOW = [(46, 90), (266, 310), (606, 650), (766, 810)]


def draw_office(rng: np.random.Generator) -> Image:
    """One floor of an office: rooms along the outside, a core in the middle."""
    page = sheet(1000, 700, (249, 249, 247))
    line(page, [(34, 34), (966, 34), (966, 666), (34, 666)], 9, _WALL, closed=True)
    _outer_rooms(page)
    for ends, doors in (
        (((260, 230), (740, 230)), []),
        (((740, 230), (740, 470)), [(100, 144)]),
        (((260, 470), (740, 470)), [(224, 257)]),
        (((260, 230), (260, 470)), [(60, 104)]),
        (((420, 230), (420, 470)), []),
        (((580, 230), (580, 470)), []),
    ):
        wall(page, ends, 6, _WALL, doors)
    _swing(page, (484, 467), 33, -90)
    for x, y, chair in (
        (110, 60, 22), (310, 60, 22), (690, 60, 22), (890, 80, 22),
        (90, 260, 22), (90, 340, 22), (90, 420, 22),
        (140, 640, -22), (380, 640, -22), (560, 640, -22), (860, 640, -22),
        (900, 300, 22), (900, 460, 22), (660, 260, 22),
    ):  # fmt: skip
        _desk(page, x, y, chair)
    for y in (260, 300, 340, 380, 420):
        box(page, (346, y, 414, y + 12), _DESK)
    for text, x, y in (
        ("101", 160, 100), ("102", 350, 100), ("103", 560, 64), ("104", 730, 110),
        ("OPEN SPACE", 112, 200), ("LAB", 890, 380), ("ARCHIVE", 312, 248),
        ("MEETING", 500, 262), ("SERVER", 660, 400), ("KITCHEN", 170, 590),
        ("201", 400, 590), ("202", 560, 590), ("203", 880, 590), ("LIFT", 880, 190),
    ):  # fmt: skip
        write(page, text, (x, y), 11, _LABEL)
    return scan(page, rng, 0.7)


def _octagon(page: Image, radius: float, width: float, door: tuple[int, float]) -> None:
    """Draws a ring of the gallery; `door` is (side, width)."""
    angles = [math.radians(11 + 45 * k) for k in range(9)]
    corners = [(350 + radius * math.cos(a), 350 + radius * math.sin(a)) for a in angles]
    middle = radius * math.sin(math.radians(22.5))
    for side, ends in enumerate(pairwise(corners)):
        half = door[1] / 2 if side == door[0] else 0.0
        doors = [(middle - half, middle + half)] if half else []
        wall(page, ends, width, _WALL, doors)


def _spoke(page: Image, angle: float, inner: float, outer: float) -> None:
    """Draws a thin wall between two rings of the gallery; degrees and px."""
    x, y = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    ends = (350 + inner * x, 350 + inner * y), (350 + outer * x, 350 + outer * y)
    wall(page, ends, 1.5, _WALL)


def draw_thin_walls(rng: np.random.Generator) -> Image:
    """A gallery of nested octagons with walls one or two pixels thick."""
    page = sheet(700, 700, (252, 252, 252))
    for radius, width, door in (
        (335, 2.0, (0, 0)), (262, 1.5, (7, 60)),
        (187, 2.0, (3, 50)), (108, 1.5, (7, 28)),
    ):  # fmt: skip
        _octagon(page, radius, width, door)
    _spoke(page, 236, 262, 335)
    _spoke(page, 101, 108, 187)
    for angle in (11, 56, 281, 326):
        _spoke(page, angle, 310, 335)
    for x in (40, 660):
        line(page, [(x, 20), (x, 60)], 0.8, _FAINT)
    line(page, [(40, 40), (660, 40)], 0.8, _FAINT)
    write(page, "62.0", (350, 26), 9, _LABEL)
    write(page, "GALLERY  LEVEL 2", (590, 680), 9, _LABEL)
    for text, x, y in (("A", 270, 86), ("B", 350, 150), ("C", 350, 224)):
        write(page, text, (x, y), 12, _FAINT)
    return scan(page, rng, 0.4)


_HULL = [
    (40, 110), (70, 60), (640, 50), (800, 90), (900, 160), (965, 260),
    (900, 360), (800, 430), (640, 470), (70, 460), (40, 410),
]  # fmt: skip


def draw_light_on_dark(rng: np.random.Generator) -> Image:
    """The deck of a ship as a blueprint: light walls on dark blue."""
    page = sheet(1000, 520, _NAVY)
    for x in range(20, 1000, 20):
        line(page, [(x, 0), (x, 520)], 0.8, _GRID)
    for y in range(20, 520, 20):
        line(page, [(0, y), (1000, y)], 0.8, _GRID)
    line(page, [(20, 260), (985, 260)], 0.8, _DIM)
    line(page, _HULL, 6, _CHALK, closed=True)
    doors = [(52, 86), (152, 186), (252, 286), (352, 386), (452, 486)]
    wall(page, ((70, 122), (600, 122)), 3, _CHALK, doors)
    wall(page, ((70, 398), (600, 398)), 3, _CHALK, doors)
    for x in (70, 170, 270, 370, 470, 600):
        wall(page, ((x, 60), (x, 122)), 3, _CHALK)
        wall(page, ((x, 398), (x, 462)), 3, _CHALK)
    wall(page, ((300, 200), (700, 200)), 5, _CHALK)
    wall(page, ((300, 320), (700, 320)), 5, _CHALK)
    wall(page, ((700, 200), (700, 320)), 5, _CHALK)
    wall(page, ((300, 200), (300, 320)), 5, _CHALK, [(46, 74)])
    wall(page, ((500, 200), (500, 320)), 4, _CHALK, [(70, 104)])
    wall(page, ((762, 80), (762, 310)), 4, _CHALK)
    for x, y in ((400, 225), (400, 295)):
        box(page, (x - 40, y - 12, x + 40, y + 12), _CHALK)
        box(page, (x - 37, y - 9, x + 37, y + 9), _DIM)
    for text, x, y in (
        ("ENGINE ROOM", 400, 260), ("CONTROL", 610, 230), ("BRIDGE", 850, 230),
        ("AFT DECK", 180, 240), ("CABINS", 120, 92), ("CABINS", 120, 430),
        ("MV TORDALK  DECK 3  1:200", 870, 500),
    ):  # fmt: skip
        write(page, text, (x, y), 10, _DIM)
    return scan(page, rng, 0.8)
