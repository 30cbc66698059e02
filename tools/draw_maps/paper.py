"""Bundled maps on paper: the felt-pen maze and the brush spiral."""

from __future__ import annotations

import numpy as np

from tools.draw_maps.ink import Colour, Image, arc, pen, scan, sheet

_PAPER: Colour = (250, 248, 241)
_INK: Colour = (38, 36, 42)
_RED: Colour = (205, 38, 44)
_BLUE: Colour = (32, 62, 178)

_MAZE = """
+--+--+--+--+--+--+--+--+--+--+
|           |              |  |
+--+--+--+  +  +--+--+  +  +  +
|           |  |        |     |
+  +--+--+--+  +  +--+--+--+  +
|  |           |     |        |
+  +  +--+--+--+--+  +  +--+--+
|  |  |           |           |
+  +--+  +--+--+  +  +--+--+  +
|              |  |           |
+--+  +  +--+  +  +--+--+  +  +
|  |  |  |  |  |        |  |  |
+  +  +  +  +  +--+--+  +--+  +
|     |     |        |  |     |
+  +--+--+--+--+--+  +  +  +  +
|                    |     |  |
+--+--+--+--+--+--+--+--+--+--+
"""


def _runs(art: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The first and last lattice point of each straight wall of an ASCII maze."""
    rows = art.strip("\n").split("\n")
    runs = []
    for y, row in enumerate(rows[::2]):
        marks = [row[k + 1 : k + 2] == "-" for k in range(0, len(row), 3)]
        runs += [((a, y), (b, y)) for a, b in _stretches(marks)]
    for x in range(len(rows[0]) // 3 + 1):
        marks = [row.ljust(3 * x + 1)[3 * x] == "|" for row in rows[1::2]]
        runs += [((x, a), (x, b)) for a, b in _stretches([*marks, False])]
    return runs


def _stretches(marks: list[bool]) -> list[tuple[int, int]]:
    """The half-open ranges of the list that are True."""
    edges = np.flatnonzero(np.diff([False, *marks, False]))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def draw_maze(rng: np.random.Generator) -> Image:
    """A maze in two felt pens."""
    pitch, left, top = 72.0, 65.0, 37.0
    page = sheet(850, 650, _PAPER)
    strokes = [
        [(left + pitch * x, top + pitch * y) for x, y in run] for run in _runs(_MAZE)
    ]
    # Narrows the only passage to the goal to less than three body radii.
    strokes.append([(left + 3 * pitch, top + 5 * pitch), (262.0, top + 5 * pitch)])
    for stroke in strokes:
        colour = _RED if rng.random() < 0.5 else _BLUE
        pen(page, rng, stroke, width=11, wobble=1.4, colour=colour)
    return scan(page, rng, 1.2)


def draw_spiral(rng: np.random.Generator) -> Image:
    """A spiral in black brush with a nearly closed ring at its centre."""
    page = sheet(700, 700, (247, 244, 236))
    centre, turns, outer, inner = 350.0, 2.9, 332.0, 142.0
    angles = np.linspace(0.0, 2 * np.pi * turns, 600)
    radii = np.linspace(outer, inner, 600)
    x, y = centre + radii * np.cos(angles), centre + radii * np.sin(angles)
    track = list(zip(x.tolist(), y.tolist(), strict=True))
    pen(page, rng, track, width=10, wobble=1.5, colour=_INK)
    ring = arc((centre, centre), 46, 133, 443)
    pen(page, rng, ring, width=9, wobble=0.6, colour=_INK)
    return scan(page, rng, 1.5)
