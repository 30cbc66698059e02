"""Free positions of an e-puck in a world, and its shortest paths."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only
from tdac_envs.core.errors import TaskError, offer
from tdac_envs.epuck.contact import first_touch
from tdac_envs.epuck.ground import Ground, Point
from tdac_envs.epuck.infrared import sees
from tdac_envs.grid.plan import Path, descend, distance_field
from tdac_envs.worlds.bodies import BODY_RADIUS


def at_goal(ground: Ground, goal: Point, tolerance: float, x: float, y: float) -> bool:
    """Whether (x, y) is within the tolerance of the goal with nothing in between."""
    gap, solid = math.hypot(goal[0] - x, goal[1] - y), ground.solid
    if gap > tolerance:
        return False
    return gap < ground.gap(x, y) or sees(*solid.arrays(), *map(float, (x, y, *goal)))


def check_body_fits(ground: Ground, name: str, x: float, y: float) -> None:
    """Checks that an e-puck fits at (x, y), the point called `name`.

    Raises:
        TaskError: The point is outside the world, in an obstacle or too near to one;
            the message begins with the nearest free position.
    """
    point = f"{name} ({x:g}, {y:g})"
    left, low, right, high = ground.bounds
    if not (left <= x <= right and low <= y <= high):
        raise TaskError(
            f"{point} lies outside the world, which reaches from ({left:.2f}, "
            f"{low:.2f}) to ({right:.2f}, {high:.2f})"
        )
    room = ground.gap(x, y)
    if room >= BODY_RADIUS:
        return
    problem = "lies in an obstacle"
    if room > 0.0:
        problem = (
            f"is {1e3 * room:.1f} mm from an obstacle, too near for a body of "
            f"{1e3 * BODY_RADIUS:g} mm radius"
        )
    problem = f"{point} {problem}"
    rows, columns = np.nonzero(ground.free(BODY_RADIUS))
    if rows.size == 0:
        raise TaskError(f"{problem}; an e-puck fits nowhere")
    u, v = (x - left) / ground.spacing, (y - low) / ground.spacing
    nearest = int(np.argmin((columns - u) ** 2 + (rows - v) ** 2))
    near_x, near_y = ground.at(int(columns[nearest]), int(rows[nearest]))
    place = f"({near_x:.3f}, {near_y:.3f})"
    raise TaskError(offer(name, place, "the nearest free position", problem))


def path_entry(
    ground: Ground, field: NDArray[np.float32], at: Point
) -> tuple[int, int] | None:
    """The nearest grid point (column, row) reachable in a straight line, or None.

    Args:
        ground: The world.
        field: Shape (height, width): finite at the grid points to choose from.
        at: Position of the body, m.
    """
    solid, (left, low, _, _) = ground.solid, ground.bounds
    u, v = (at[0] - left) / ground.spacing, (at[1] - low) / ground.spacing
    numbers = (*at, u, v, left, low, ground.spacing, BODY_RADIUS)
    cell = _entry_cell(*solid.arrays(), read_only(field), *map(float, numbers))
    if cell < 0:
        return None
    row, column = divmod(cell, field.shape[1])
    return column, row


@kernel
def _entry_cell(
    points: NDArray[np.float64],
    first: NDArray[np.int64],
    extent: NDArray[np.float64],
    field: NDArray[np.float32],
    x: float,
    y: float,
    u: float,
    v: float,
    left: float,
    low: float,
    spacing: float,
    radius: float,
) -> int:
    """Flat index of the point of `path_entry`, at most 3 from (u, v); -1 if none."""
    height, width = field.shape
    column, row = math.floor(u + 0.5), math.floor(v + 0.5)
    before, found = -1.0, -1
    while True:
        # The next grid point in the order of distance, column and row.
        best, cell = math.inf, -1
        for i in range(max(column - 3, 0), min(column + 4, width)):
            for j in range(max(row - 3, 0), min(row + 4, height)):
                off = (i - u) * (i - u) + (j - v) * (j - v)
                later = off > before or (off == before and i * height + j > found)
                if later and off < best:
                    best, cell = off, i * height + j
        if cell < 0:
            return -1
        before, found = best, cell
        i, j = cell // height, cell % height
        if field[j, i] < math.inf:
            off_x, off_y = left + i * spacing - x, low + j * spacing - y
            heading = math.atan2(off_y, off_x)
            length = math.sqrt(off_x * off_x + off_y * off_y)
            touch = first_touch(
                points, first, extent, x, y, heading, length, 0.0, radius
            )  # fmt: skip
            if touch > 1.0:
                return int(j * width + i)


def open_field(open_: NDArray[np.bool_]) -> NDArray[np.float32]:
    """A field for `path_entry`: 0 at the grid points to choose from, inf elsewhere."""
    return np.where(open_, np.float32(0.0), np.float32(math.inf))


def _nearest(ground: Ground, at: Point) -> tuple[int, int]:
    """The grid point (column, row) nearest to a position."""
    left, low, _, _ = ground.bounds
    height, width = ground.clear.shape
    column, row = (
        round((at[0] - left) / ground.spacing),
        round((at[1] - low) / ground.spacing),
    )
    return min(max(column, 0), width - 1), min(max(row, 0), height - 1)


def route(ground: Ground, start: Point, goal: Point) -> NDArray[np.float32]:
    """Length of the shortest path to the goal from each grid point, m.

    Paths follow the grid in eight directions. Apart from some mm at corners, they are
    at most 8.3 %, and on average 5 %, longer than the true shortest path.

    Returns:
        Shape (height, width), float32, read-only; inf if there is no path.

    Raises:
        TaskError: No path joins start and goal; the message gives the reason.
    """
    end = path_entry(ground, open_field(ground.free(BODY_RADIUS)), goal)
    if end is not None:
        field = field_to(ground, end)
        if path_entry(ground, field, start) is not None:
            return field
    reason = _walled_off(ground, start, goal) or _too_narrow(ground, start, goal)
    raise TaskError(
        f"no free path for a body of {1e3 * BODY_RADIUS:g} mm radius from start "
        f"({start[0]:g}, {start[1]:g}) to goal ({goal[0]:g}, {goal[1]:g}): {reason}"
    )


def _too_narrow(ground: Ground, start: Point, goal: Point) -> str:
    widest = widest_body(ground, start, goal)
    if widest <= 0.0:
        return "they are in separate rooms"
    return f"the widest body that gets through has a radius of {1e3 * widest:.1f} mm"


def _walled_off(ground: Ground, start: Point, goal: Point) -> str:
    """Message if an arena's wall separates start and goal; empty otherwise."""
    for arena in ground.world.arenas:
        inside = [arena.inside.contains(*place) for place in (start, goal)]
        if arena.has_wall and inside[0] != inside[1]:
            left, low, right, high = arena.inside.bounds
            return (
                f"the {'goal' if inside[0] else 'start'} is outside the arena's wall, "
                f"which reaches from ({left:g}, {low:g}) to ({right:g}, {high:g})"
            )
    return ""


@lru_cache(maxsize=4)
def field_to(ground: Ground, goal: tuple[int, int]) -> NDArray[np.float32]:
    """The field of `route` for a goal at a grid point (column, row)."""
    steps = distance_field(ground.free(BODY_RADIUS), goal)
    field = (steps * ground.spacing).astype(np.float32)
    field.flags.writeable = False
    return field


def path_down(ground: Ground, field: NDArray[np.float32], start: Point) -> Path:
    """The shortest path from a position, given a field of `route`, shape (n, 2), m.

    It ends at the grid point of the goal. It is empty if there is no path.
    """
    begin = path_entry(ground, field, start)
    if begin is None:
        return np.empty((0, 2))
    steps = np.asarray(field, np.float64) / ground.spacing
    path = descend(ground.free(BODY_RADIUS), _exact(steps), begin)
    return np.vstack([start, path * ground.spacing + ground.bounds[:2]])


def _exact(steps: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(steps < 1e-6, 0.0, steps)


def widest_body(ground: Ground, start: Point, goal: Point) -> float:
    """Radius of the largest disc that can move from start to goal, m; 0 if none can.

    It is as accurate as the grid spacing.
    """
    ends = [_nearest(ground, point)[::-1] for point in (start, goal)]
    low, high = 0.0, float(min(ground.clear[end] for end in ends))

    def joined(radius: float) -> bool:
        free = (ground.clear > radius).astype(np.uint8)
        _, labels = cv2.connectedComponents(free, connectivity=4)
        return bool(labels[ends[0]] == labels[ends[1]] != 0)

    if not joined(0.0):
        return 0.0
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
    return low
