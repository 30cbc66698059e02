"""Places where the people of a crowd go, and their ways there."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import read_only
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import OccupancyGrid, clearance
from tdac_envs.grid.plan import distance_field
from tdac_envs.movers.walls import Cells, cells_of, segments_of

DESTINATIONS = 8
"""Number of places on a map between which people walk."""


class Destinations(NamedTuple):
    """What people know of a map; read-only.

    Attributes:
        walls: From `walls.segments_of`.
        first: From `walls.cells_of`.
        listed: From `walls.cells_of`.
        fields: Shape (places, rows, columns), float32: length of the shortest path to
            each place from each node, px; inf where there is none. Node (row, column)
            is the pixel (column * spacing, row * spacing).
        spacing: Shape (1,), float64: distance of the nodes, px.
    """

    walls: NDArray[np.float64]
    first: Cells
    listed: Cells
    fields: NDArray[np.float32]
    spacing: NDArray[np.float64]

    @classmethod
    def none(cls) -> Destinations:
        """No places."""
        return cls(
            np.zeros((0, 7)), np.zeros((0, 0), np.int64), np.zeros(0, np.int64),
            np.zeros((0, 0, 0), np.float32), np.ones(1),
        )  # fmt: skip

    def nodes(self) -> NDArray[np.float64]:
        """The nodes from which there is a way to all places, shape (n, 2), px."""
        rows, columns = np.nonzero(np.isfinite(self.fields[0]))
        nodes = np.column_stack([columns, rows]).astype(np.float64)
        nodes *= self.spacing[0]
        return nodes


@lru_cache(maxsize=4)
def destinations_of(grid: OccupancyGrid, radius: float, reach: float) -> Destinations:
    """Places for people on a map, far from each other.

    Args:
        grid: The map.
        radius: The largest radius of a person, px.
        reach: Distance from which walls count, px.

    Raises:
        TaskError: The largest room has no space for a walk.
    """
    clear = clearance(grid.cells)
    # Nodes are so near to each other that a body fits all the way between two.
    spacing = max(int(radius / 3.0), 1)
    room = clear[::spacing, ::spacing]
    free = _largest(room >= radius + 0.5 * spacing)
    goals = _goals(free, room >= 2.0 * radius + 0.5 * spacing)
    if len(goals) < 2:
        raise TaskError(
            f"a crowd of {radius:g} px radius has no room to walk; the largest "
            f"clearance is {float(clear.max()):.1f} px"
        )
    fields = [spacing * distance_field(free, goal) for goal in goals]
    walls = segments_of(grid.cells)
    first, listed = cells_of(walls, grid.cells.shape, reach)
    return Destinations(
        read_only(walls), read_only(first), read_only(listed),
        read_only(np.array(fields), np.float32),
        read_only(np.array([float(spacing)])),
    )  # fmt: skip


def _largest(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected part."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        free.astype(np.uint8), connectivity=4
    )
    if len(stats) == 1:
        return free
    largest: NDArray[np.bool_] = labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    return largest


def _goals(free: NDArray[np.bool_], wide: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Nodes (column, row) far from each other, with room for two if there are such."""
    among = free & wide if (free & wide).sum() >= 4 * DESTINATIONS else free
    if not among.any():
        return []
    row, column = (int(each[0]) for each in np.nonzero(among))
    nearest, goals = distance_field(free, (column, row)), []
    for _ in range(DESTINATIONS):
        nearest[~among] = 0.0
        row, column = divmod(int(nearest.argmax()), free.shape[1])
        if nearest[row, column] <= 0.0:
            break
        goals.append((column, row))
        field = distance_field(free, goals[-1])
        nearest = np.minimum(nearest, field) if len(goals) > 1 else field
    return goals
