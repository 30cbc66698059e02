"""What is wanted on a map: start, goal, body, and the shortest way between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.errors import TaskError
from tdac_envs.grid import (
    BoolGrid,
    FloatGrid,
    OccupancyGrid,
    body_free,
    clearance,
    clearance_at,
)
from tdac_envs.kernels import pad, path_distance, sees
from tdac_envs.params import RobotParams
from tdac_envs.plan import Path, descend, distance_field

MAX_TOLERANCE = 20.0
MIN_HORIZON = 2500
JITTER_HEADING = 0.5


class Pose(NamedTuple):
    """Where the robot is: x (column, px), y (row, px), heading (rad)."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """A grid and what is computed from it once.

    Attributes:
        grid: The map.
        clear: Shape (height, width), float32, from `grid.clearance`.
        padded: `grid.cells` with an occupied border, for the kernels.
        padded_clear: `clear` with a border of zeros, for the kernels.
    """

    grid: OccupancyGrid
    clear: FloatGrid
    padded: BoolGrid
    padded_clear: FloatGrid

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Terrain:
        """Computes the clearance of a grid."""
        clear = clearance(grid.cells)
        return cls(grid, clear, *pad(grid.cells, clear))


@dataclass(frozen=True, slots=True, eq=False)
class Map2DTask:
    """A feasible task: drive the disc from start to goal and touch nothing.

    Attributes:
        terrain: The map.
        start: Nominal start pose.
        goal: Point (x, y), px.
        robot: Body, wheels and sensor.
        goal_tolerance: px.
        dt: Duration of a step, s.
        horizon: Steps before the episode is cut off.
        field: Shape (height, width), float32: length of the shortest path for the
            body from each pixel to the goal, px; inf where there is none.
        shortest: d0, length of that path from the nominal start, px.
    """

    terrain: Terrain
    start: Pose
    goal: tuple[float, float]
    robot: RobotParams
    goal_tolerance: float
    dt: float
    horizon: int
    field: NDArray[np.float32]
    shortest: float

    def path_from(self, start: Pose) -> Path:
        """Shortest path for the body, shape (n, 2); starts at the given point."""
        free = body_free(self.terrain.clear, self.robot.radius)
        first = _entry(self.field, start.x, start.y)
        if first is None:
            return np.empty((0, 2))
        path = descend(free, np.asarray(self.field, np.float64), first)
        return np.vstack([[start.x, start.y], path, self.goal])

    def moved(self, start: Pose, goal: tuple[float, float] | None = None) -> Map2DTask:
        """The same task with another start (and goal); horizon and tolerance kept."""
        if goal is not None and goal != self.goal:
            field, shortest = _route(self.terrain, start, goal, self.robot.radius)
        else:
            field, goal = self.field, self.goal
            shortest = path_distance(field, start.x, start.y, math.inf)
        return replace(self, start=start, goal=goal, field=field, shortest=shortest)


def make_task(
    terrain: Terrain,
    start: Pose,
    goal: tuple[float, float],
    robot: RobotParams,
    *,
    dt: float = 0.05,
    goal_tolerance: float | None = None,
    horizon: int | None = None,
) -> Map2DTask:
    """Checks that a task is feasible and completes it.

    Args:
        terrain: The map.
        start: Pose, px and rad.
        goal: Point (x, y), px.
        robot: Body, wheels and sensor.
        dt: Duration of a step, s.
        goal_tolerance: px; by default min(20, d0 / 4).
        horizon: Steps; by default max(2500, 6 * d0 / (v_max * dt)).

    Raises:
        TaskError: Start or goal cannot hold the body, no path joins them, or the
            start is already within the tolerance; the message says which and what
            to do.
    """
    _check_stands(terrain, "start", start.x, start.y, robot.radius)
    _check_stands(terrain, "goal", *goal, robot.radius)
    field, shortest = _route(terrain, start, goal, robot.radius)
    tolerance = goal_tolerance
    if tolerance is None:
        tolerance = min(MAX_TOLERANCE, 0.25 * shortest)
    if at_goal(terrain, goal, tolerance, start.x, start.y):
        raise TaskError(
            f"the start is already at the goal: {math.dist(start[:2], goal):.1f} px "
            f"apart with a tolerance of {tolerance:.1f} px; move one of them"
        )
    step = robot.max_wheel_speed * dt
    steps = horizon or max(MIN_HORIZON, math.ceil(6.0 * shortest / step))
    return Map2DTask(
        terrain, start, goal, robot, tolerance, dt, steps, field, shortest
    )


def at_goal(
    terrain: Terrain, goal: tuple[float, float], tolerance: float, x: float, y: float
) -> bool:
    """Whether (x, y) is within the tolerance and no wall stands in between."""
    if math.hypot(goal[0] - x, goal[1] - y) > tolerance:
        return False
    return bool(sees(terrain.padded, terrain.padded_clear, x, y, *goal))


def jittered_start(task: Map2DTask, random: np.random.Generator) -> Pose:
    """A feasible start within one body radius of the nominal one, heading +- 0.5 rad.

    The disc that is drawn from shrinks slowly, so that a start in a tight place
    ends the search, too.
    """
    reach = task.robot.radius
    while True:
        distance = reach * math.sqrt(random.random())
        bearing = random.uniform(-math.pi, math.pi)
        heading = task.start.heading + random.uniform(-JITTER_HEADING, JITTER_HEADING)
        pose = Pose(
            task.start.x + distance * math.cos(bearing),
            task.start.y + distance * math.sin(bearing),
            math.remainder(heading, 2 * math.pi),
        )
        if _may_start(task, pose):
            return pose
        reach *= 0.98


def random_task(task: Map2DTask, random: np.random.Generator) -> Map2DTask:
    """The same map and robot with any feasible start and goal.

    The goal is drawn from the free pixels connected to the nominal goal.
    """
    connected = np.argwhere(np.isfinite(task.field))
    while True:
        goal_y, goal_x = connected[random.integers(len(connected))]
        start_y, start_x = connected[random.integers(len(connected))]
        heading = random.uniform(-math.pi, math.pi)
        start = Pose(float(start_x), float(start_y), heading)
        drawn = task.moved(start, (float(goal_x), float(goal_y)))
        if _may_start(drawn, start):
            return drawn


def _may_start(task: Map2DTask, pose: Pose) -> bool:
    body = math.sqrt(task.robot.radius**2 + 0.5)
    cells = task.terrain.grid.cells
    return (
        clearance_at(cells, pose.x, pose.y, body) >= body
        and _entry(task.field, pose.x, pose.y) is not None
        and not at_goal(task.terrain, task.goal, task.goal_tolerance, pose.x, pose.y)
    )


def _entry(
    field: NDArray[np.float32], x: float, y: float, reach: int = 2
) -> tuple[int, int] | None:
    """The pixel near (x, y) through which the shortest path goes, if any."""
    height, width = field.shape
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    best, entry = math.inf, None
    for j in range(max(row - reach, 0), min(row + reach + 1, height)):
        for i in range(max(column - reach, 0), min(column + reach + 1, width)):
            # A nearer pixel is preferred: the straight hop there must be free.
            through = float(field[j, i]) + 2.0 * math.hypot(x - i, y - j)
            if through < best:
                best, entry = through, (i, j)
    return entry


def _check_stands(
    terrain: Terrain, name: str, x: float, y: float, radius: float
) -> None:
    grid = terrain.grid
    point = f"{name} ({x:g}, {y:g})"
    if not (-0.5 <= x <= grid.width - 0.5 and -0.5 <= y <= grid.height - 0.5):
        raise TaskError(
            f"{point} lies outside the map of {grid.width} x {grid.height} px"
        )
    if grid.is_occupied(x, y):
        problem = "lies in an obstacle"
    elif (room := clearance_at(grid.cells, x, y, radius)) < radius:
        problem = f"is {room:.1f} px from a wall, too near for a body of {radius:g} px"
    else:
        return
    raise TaskError(f"{point} {problem}; {_nearest_place(terrain, x, y, radius)}")


def _nearest_place(terrain: Terrain, x: float, y: float, radius: float) -> str:
    rows, columns = np.nonzero(body_free(terrain.clear, radius))
    if rows.size == 0:
        return f"the body fits nowhere; the widest place is {terrain.clear.max():.1f} px"
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return f"the nearest free pixel is ({columns[nearest]}, {rows[nearest]})"


def _route(
    terrain: Terrain, start: Pose, goal: tuple[float, float], radius: float
) -> tuple[NDArray[np.float32], float]:
    free = body_free(terrain.clear, radius)
    height, width = free.shape
    column, row = math.floor(goal[0] + 0.5), math.floor(goal[1] + 0.5)
    # A goal that just holds the body may have no roomy pixel at its very centre.
    near = [
        (abs(i - goal[0]) + abs(j - goal[1]), i, j)
        for j in range(max(row - 2, 0), min(row + 3, height))
        for i in range(max(column - 2, 0), min(column + 3, width))
        if free[j, i]
    ]
    if near:
        _, i, j = min(near)
        field = distance_field(free, (i, j)).astype(np.float32)
        if _entry(field, start.x, start.y) is not None:
            return field, float(path_distance(field, start.x, start.y, math.inf))
    widest = widest_connected_radius(terrain.clear, (start.x, start.y), goal)
    reason = f"the widest body that gets through has a radius of {widest:.1f} px"
    if widest <= 0.0:
        reason = "they are in separate rooms"
    raise TaskError(
        f"no free path for a body of {radius:g} px from start ({start.x:g}, "
        f"{start.y:g}) to goal ({goal[0]:g}, {goal[1]:g}): {reason}"
    )


def widest_connected_radius(
    clear: FloatGrid, start: tuple[float, float], goal: tuple[float, float]
) -> float:
    """Largest disc, px, that gets from start to goal; 0 where nothing does.

    By bisection over the connected components of the clearance.
    """
    import cv2

    ends = [(math.floor(y + 0.5), math.floor(x + 0.5)) for x, y in (start, goal)]
    low, high = 0.0, float(min(clear[ends[0]], clear[ends[1]]))

    def joined(radius: float) -> bool:
        free = body_free(clear, radius).astype(np.uint8)
        _, labels = cv2.connectedComponents(free, connectivity=4)
        return bool(labels[ends[0]] == labels[ends[1]] != 0)

    if not joined(0.0):
        return 0.0
    while high - low > 0.05:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if joined(middle) else (low, middle)
    return low
