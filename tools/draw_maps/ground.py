"""Bundled maps of a cave and a warehouse, from above."""

from __future__ import annotations

import cv2
import numpy as np

from tools.draw_maps.ink import (
    FINE,
    Colour,
    Image,
    Points,
    box,
    line,
    scan,
    sheet,
    smooth_noise,
    write,
)

_CAVE_TUNNELS: tuple[tuple[float, Points], ...] = (
    (60, [
        (130, 200), (290, 92), (420, 80), (560, 100), (720, 120), (810, 250),
        (800, 440), (730, 570), (560, 615), (400, 600), (210, 620), (105, 490),
        (85, 330), (130, 200),
    ]),
    (58, [(420, 80), (395, 130), (370, 180)]),
    (52, [(85, 330), (250, 290), (400, 272), (560, 232), (610, 215)]),
    (54, [(560, 100), (610, 215), (690, 260), (810, 250)]),
    (50, [(690, 260), (650, 330)]),
    (56, [(105, 490), (190, 430), (235, 400)]),
    (52, [(800, 440), (710, 430), (650, 470)]),
    (38, [(650, 470), (590, 500)]),
    (52, [(590, 500), (510, 490), (430, 430)]),
)  # fmt: skip
_CAVE_HALLS = (
    (370, 180, 46), (430, 425, 84), (235, 390, 44), (730, 570, 66), (130, 200, 58),
    (645, 345, 36),
)  # fmt: skip


def draw_cave(rng: np.random.Generator) -> Image:
    """A cave survey: ragged tunnels in brown rock."""
    plan = np.full((700, 900), 255, np.uint8)
    for width, points in _CAVE_TUNNELS:
        cv2.polylines(plan, [np.array(points, np.int32)], False, 0, int(width))
    for x, y, radius in _CAVE_HALLS:
        cv2.circle(plan, (x, y), radius, 0, -1)
    into_rock = cv2.distanceTransform(plan, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    into_air = cv2.distanceTransform(255 - plan, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    ragged = 6.0 * smooth_noise(rng, 900, 700, 34) + 1.8 * smooth_noise(
        rng, 900, 700, 9
    )
    depth = (into_rock - into_air + ragged).astype(np.float32)
    fine = cv2.resize(depth, (900 * FINE, 700 * FINE), interpolation=cv2.INTER_LINEAR)
    page = sheet(900, 700, (232, 222, 200))
    page[fine > -3] = (196, 180, 150)
    page[fine > 0] = (54, 42, 36)
    page[fine > 5] = (90, 72, 60)
    page[fine > 26] = (78, 60, 48)
    return scan(page, rng, 0.3)


_FLOOR: Colour = (226, 227, 225)
_STEEL: Colour = (38, 62, 112)
_BEAM: Colour = (206, 92, 30)
_CARTONS: tuple[Colour, ...] = (
    (150, 110, 70),
    (134, 96, 60),
    (112, 84, 58),
    (88, 96, 92),
)


def _rack(
    page: Image, rng: np.random.Generator, left: float, right: float, y: float
) -> None:
    """Draws a row of pallet racking, 28 px deep, with cartons in its bays."""
    box(page, (left, y, right, y + 28), _STEEL)
    x = left + 4
    while x + 18 < right:
        for top in (y + 3, y + 15):
            if rng.random() < 0.85:
                carton = _CARTONS[int(rng.integers(len(_CARTONS)))]
                box(page, (x, top, x + float(rng.integers(12, 18)), top + 10), carton)
        x += 20
    line(page, [(left, y), (right, y)], 1.5, _BEAM)
    line(page, [(left, y + 28), (right, y + 28)], 1.5, _BEAM)


def _pallet(page: Image, x: float, y: float, width: float, height: float) -> None:
    """Draws a loaded pallet with its top left corner at (x, y)."""
    box(page, (x, y, x + width, y + height), (120, 82, 44))
    box(page, (x + 3, y + 3, x + width - 3, y + height - 3), (150, 106, 62))
    line(page, [(x, y), (x + width, y + height)], 1.2, (92, 62, 34))


def draw_warehouse(rng: np.random.Generator) -> Image:
    """A warehouse: six rows of racking, one aisle closed at its far end."""
    page = sheet(1000, 600, _FLOOR)
    for x in (84, 920):
        line(page, [(x, 40), (x, 560)], 2, (232, 206, 120))
    line(
        page,
        [(16, 16), (984, 16), (984, 584), (16, 584)],
        14,
        (62, 64, 68),
        closed=True,
    )
    for y in (84, 166, 248, 330, 412, 494):
        _rack(page, rng, 140, 860, y)
    box(page, (820, 350, 860, 420), (70, 74, 80))
    for y in range(354, 418, 8):
        line(page, [(824, y), (856, y)], 2, (120, 124, 130))
    _pallet(page, 150, 356, 24, 24)
    for x, y in ((300, 190), (700, 276), (420, 438), (640, 110), (946, 500)):
        _pallet(page, x, y, 24, 18)
    for y in (46, 136, 218, 300, 382, 464, 550):
        write(page, f"A{y // 80 + 1}", (115, y), 9, (178, 180, 180))
    write(page, "DISPATCH", (500, 50), 12, (186, 188, 188))
    return scan(page, rng, 0.8)
