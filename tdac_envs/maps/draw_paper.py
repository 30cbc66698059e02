"""Bundled maps on paper: the felt-pen maze."""

from __future__ import annotations

import numpy as np

from tdac_envs.maps.draw_ink import (
    Colour,
    Image,
    Points,
    blank,
    finish,
    lay,
    paper,
    pen,
    soften,
)

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
    """The straight walls of an ASCII maze, end to end, in lattice points."""
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
    """A maze in two felt pens on a scanned sheet."""
    pitch, left, top = 72.0, 65.0, 37.0
    image = paper(rng, 850, 650, (250, 248, 241), 1.2)
    strokes: list[Points] = [
        [(left + pitch * x, top + pitch * y) for x, y in run] for run in _runs(_MAZE)
    ]
    # Narrows the only way to the goal to less than three body radii.
    strokes.append([(left + 3 * pitch, top + 5 * pitch), (262.0, top + 5 * pitch)])
    masks = {_RED: blank(850, 650), _BLUE: blank(850, 650)}
    for stroke in strokes:
        colour = _RED if rng.random() < 0.5 else _BLUE
        pen(masks[colour], rng, stroke, 11.0, 1.4)
    for colour, mask in masks.items():
        lay(image, soften(mask), colour)
    return finish(image)
