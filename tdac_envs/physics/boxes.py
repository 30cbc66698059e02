"""The walls of an occupancy grid as few boxes, in metres."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError

if TYPE_CHECKING:
    # Loaded with the first scene: a map without it needs no code of worlds.
    from tdac_envs.physics.scene import Scene
    from tdac_envs.worlds.footprint import Rectangle

Cells = NDArray[np.bool_]
Point = tuple[float, float]
Edges = tuple[int, int, int, int]
"""First column, first row, last column + 1, last row + 1 of a rectangle of pixels."""
MOST_BOXES = 20_000
"""Largest number of boxes of a map."""
_FENCE = 1.0
"""Width of the walls around a map, m."""


def rectangles(cells: Cells) -> list[Edges]:
    """Rectangles that cover the occupied cells of a grid, each cell once.

    Runs of equal columns in successive rows become one rectangle.

    Args:
        cells: Shape (height, width), True where occupied.

    Returns:
        First column, first row, last column + 1, last row + 1 of each.
    """
    done: list[Edges] = []
    open_: dict[tuple[int, int], int] = {}
    for row, line in enumerate(cells):
        edges = np.flatnonzero(np.diff(line.astype(np.int8), prepend=0, append=0))
        runs = set(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
        done += [
            (a, open_.pop((a, b)), b, row) for a, b in [*open_] if (a, b) not in runs
        ]
        for run in runs:
            open_.setdefault(run, row)
    done += [(a, top, b, len(cells)) for (a, b), top in open_.items()]
    return sorted(done)


def scene_on(
    cells: Cells, metres: float, height: float, *, fenced: bool = True
) -> Scene:
    """The scene of a map: x to the right, y up, the centre of pixel (0, 0) at (0, 0).

    Pixel (i, j) is at (i, -j) times `metres`. Everything outside of the map is solid.

    Args:
        cells: Shape (height, width), True where occupied.
        metres: Size of a pixel, m.
        height: Height of the walls, m.
        fenced: Whether there are walls around the map.

    Raises:
        TaskError: The map needs too many boxes.
    """
    from tdac_envs.physics.scene import Prism, Scene

    found = rectangles(cells)
    if len(found) > MOST_BOXES:
        raise TaskError(
            f"physics 'mujoco': the obstacles of the map are {len(found)} boxes, more "
            f"than {MOST_BOXES}; use a coarser map"
        )
    if fenced:
        rows, columns = cells.shape
        found += fence(rows, columns, metres)
    return Scene(tuple(Prism(_box(one, metres), 0.0, height) for one in found))


def fence(rows: int, columns: int, metres: float) -> list[Edges]:
    """Walls around a map, 1 m wide; see `rectangles`."""
    wide = fence_width(metres)
    return [
        (-wide, -wide, columns + wide, 0),
        (-wide, rows, columns + wide, rows + wide),
        (-wide, 0, 0, rows),
        (columns, 0, columns + wide, rows),
    ]


def fence_width(metres: float) -> int:
    """Width of the walls around a map, px of so many metres."""
    return max(round(_FENCE / metres), 1)


def middle_and_sides(one: Edges, metres: float) -> tuple[Point, float, float]:
    """Middle (m, y up) of a rectangle of pixels, and its sides along x and y, m."""
    left, top, right, bottom = (metres * (edge - 0.5) for edge in one)
    return ((left + right) / 2, -(top + bottom) / 2), right - left, bottom - top


def _box(one: Edges, metres: float) -> Rectangle:
    from tdac_envs.worlds.footprint import Rectangle

    middle, along, across = middle_and_sides(one, metres)
    return Rectangle(*middle, 0.0, along, across)
