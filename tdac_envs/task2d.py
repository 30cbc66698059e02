"""What is wanted on a map: start, goal, body, and the shortest way between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from numbers import Integral
from typing import Any, NamedTuple

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
from tdac_envs.kernels import first_contact, pad, path_distance, sees
from tdac_envs.params import RobotParams
from tdac_envs.plan import Path, descend, distance_field

MAX_TOLERANCE = 20.0
MIN_HORIZON = 2500
JITTER_HEADING = 0.5
MAX_DRAWS = 1000


class Pose(NamedTuple):
    """Where the robot is: x (column, px), y (row, px), heading (rad)."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """A grid and what is computed from it once; 10 bytes a pixel, read-only.

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

    def __reduce__(self) -> tuple[Any, ...]:
        return Terrain.of, (self.grid,)

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Terrain:
        """The terrain of a grid; equal grids share the one used last."""
        return _terrain(grid)


# A map is often loaded by several envs, or again and again in one process.
@lru_cache(maxsize=4)
def _terrain(grid: OccupancyGrid) -> Terrain:
    padded, padded_clear = pad(grid.cells, clearance(grid.cells))
    padded.flags.writeable = padded_clear.flags.writeable = False
    return Terrain(grid, padded_clear[1:-1, 1:-1], padded, padded_clear)


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

    def __reduce__(self) -> tuple[Any, ...]:
        rest = (self.robot, self.goal_tolerance, self.dt, self.horizon)
        return _restored, (self.terrain, self.start, self.goal, *rest)

    def path_from(self, start: Pose) -> Path:
        """Shortest path for the body, shape (n, 2); starts at the given point.

        Empty where there is none.
        """
        radius = self.robot.radius
        first = _entry(self.terrain, self.field, start.x, start.y, radius)
        if first is None:
            return np.empty((0, 2))
        free = body_free(self.terrain.clear, radius)
        path = descend(free, np.asarray(self.field, np.float64), first)
        return np.vstack([[start.x, start.y], path, self.goal])

    def moved(self, start: Pose, goal: tuple[float, float] | None = None) -> Map2DTask:
        """The same task with another start (and goal); horizon and tolerance kept.

        Raises:
            TaskError: No path joins the new start and goal.
        """
        field, radius = self.field, self.robot.radius
        if goal is None or goal == self.goal:
            goal = self.goal
        else:
            field = _route(self.terrain, start, goal, radius)
        start = start._replace(heading=_wrapped(start.heading))
        shortest = _way(self.terrain, field, start)
        return replace(self, start=start, goal=goal, field=field, shortest=shortest)


def make_task(
    terrain: Terrain,
    start: Sequence[float],
    goal: Sequence[float],
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
        TaskError: A number is not usable, start or goal cannot hold the body, no path
            joins them, or the start is already within the tolerance; the message says
            which and what to do.
    """
    begin = Pose(*finite_numbers("start", start, 3))
    begin = begin._replace(heading=_wrapped(begin.heading))
    end = finite_point("goal", goal)
    dt = positive("dt", dt)
    _check_stands(terrain, "start", begin.x, begin.y, robot.radius)
    _check_stands(terrain, "goal", *end, robot.radius)
    field = _route(terrain, begin, end, robot.radius)
    shortest = _way(terrain, field, begin)
    if goal_tolerance is None:
        tolerance = min(MAX_TOLERANCE, 0.25 * shortest)
    else:
        tolerance = positive("goal_tolerance", goal_tolerance)
    if at_goal(terrain, end, tolerance, begin.x, begin.y):
        raise TaskError(
            f"the start is already at the goal: {math.dist(begin[:2], end):.1f} px "
            f"apart with a tolerance of {tolerance:.1f} px; move one of them"
        )
    steps = default_horizon(shortest, robot, dt)
    if horizon is not None:
        steps = whole_number("horizon", horizon, 1)
    return Map2DTask(terrain, begin, end, robot, tolerance, dt, steps, field, shortest)


def default_horizon(shortest: float, robot: RobotParams, dt: float) -> int:
    """Steps in which to drive `shortest` px: six times what it takes, or 2500."""
    steps = 6.0 * shortest / (robot.max_wheel_speed * dt)
    return max(MIN_HORIZON, math.ceil(min(steps, 2.0**62)))


def finite_numbers(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """The values as floats.

    Raises:
        TaskError: There are not `count` of them, or one is not a finite number.
    """
    try:
        numbers = tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise TaskError(f"expected {name} to be {count} finite numbers, got {values!r}")
    return numbers


def finite_point(name: str, values: Sequence[float]) -> tuple[float, float]:
    """The values as a point (x, y); raises as `finite_numbers` does."""
    x, y = finite_numbers(name, values, 2)
    return x, y


def finite(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a finite number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise TaskError(f"expected {name} to be a finite number, got {value!r}")
    return number


def positive(name: str, value: float) -> float:
    """The value as a float.

    Raises:
        TaskError: It is not a finite number above 0.
    """
    number = finite(name, value)
    if number <= 0.0:
        raise TaskError(f"expected {name} above 0, got {value!r}")
    return number


def whole_number(name: str, value: float, least: int) -> int:
    """The value as an int.

    Raises:
        TaskError: It is not a whole number, or below `least`.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise TaskError(
            f"expected {name} to be a whole number from {least}, got {value!r}"
        )
    return int(value)


def at_goal(
    terrain: Terrain, goal: tuple[float, float], tolerance: float, x: float, y: float
) -> bool:
    """Whether (x, y) is within the tolerance and no wall stands in between."""
    if math.hypot(goal[0] - x, goal[1] - y) > tolerance:
        return False
    return bool(sees(terrain.padded, terrain.padded_clear, x, y, *goal))


def jittered_start(task: Map2DTask, random: np.random.Generator) -> Pose:
    """A feasible start within one body radius of the nominal one, heading +- 0.5 rad.

    The disc that is drawn from shrinks slowly; where the body fits nowhere but at the
    nominal start, only the heading changes.
    """
    nominal, reach = task.start, task.robot.radius
    for _ in range(MAX_DRAWS):
        distance = reach * math.sqrt(random.random())
        bearing = random.uniform(-math.pi, math.pi)
        turn = random.uniform(-JITTER_HEADING, JITTER_HEADING)
        pose = Pose(
            nominal.x + distance * math.cos(bearing),
            nominal.y + distance * math.sin(bearing),
            _wrapped(nominal.heading + turn),
        )
        if _may_start(task, pose):
            return pose
        reach *= 0.98
    return nominal._replace(heading=pose.heading)


def random_task(task: Map2DTask, random: np.random.Generator) -> Map2DTask:
    """The same map and robot with any feasible start and goal; horizon kept.

    Both are drawn from the free pixels connected to the nominal goal. Where hardly
    any two of them are farther apart than the tolerance, it is the nominal task.
    """
    width = task.field.shape[1]
    connected = np.flatnonzero(np.isfinite(task.field))
    for _ in range(MAX_DRAWS):
        goal_y, goal_x = divmod(int(random.choice(connected)), width)
        start_y, start_x = divmod(int(random.choice(connected)), width)
        heading = _wrapped(random.uniform(-math.pi, math.pi))
        start, goal = Pose(start_x, start_y, heading), (float(goal_x), float(goal_y))
        if not at_goal(task.terrain, goal, task.goal_tolerance, start_x, start_y):
            field = _field_to(task.terrain, (goal_x, goal_y), task.robot.radius)
            shortest = float(field[start_y, start_x])
            return replace(task, start=start, goal=goal, field=field, shortest=shortest)
    return task


def _wrapped(heading: float) -> float:
    """The same direction in (-pi, pi], for a heading of any size."""
    wrapped = math.remainder(heading, 2.0 * math.pi)
    return math.pi if wrapped <= -math.pi else wrapped


def _may_start(task: Map2DTask, pose: Pose) -> bool:
    radius, terrain = task.robot.radius, task.terrain
    body = math.sqrt(radius**2 + 0.5)
    return (
        clearance_at(terrain.grid.cells, pose.x, pose.y, body) >= body
        and _entry(terrain, task.field, pose.x, pose.y, radius) is not None
        and not at_goal(terrain, task.goal, task.goal_tolerance, pose.x, pose.y)
    )


def _near(x: float, y: float, shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """The pixels (i, j) within 2 columns and rows of a point."""
    column, row = math.floor(x + 0.5), math.floor(y + 0.5)
    for j in range(max(row - 2, 0), min(row + 3, shape[0])):
        for i in range(max(column - 2, 0), min(column + 3, shape[1])):
            yield i, j


def _entry(
    terrain: Terrain, field: NDArray[np.float32], x: float, y: float, radius: float
) -> tuple[int, int] | None:
    """The pixel near (x, y) through which the shortest path goes, if any.

    The body gets there from (x, y) in a straight line.
    """
    # The pixels around the point come first, as in `path_distance`.
    found = [
        (
            max(abs(i - x), abs(j - y)) >= 1,
            field[j, i] + math.dist((x, y), (i, j)),
            i,
            j,
        )
        for i, j in _near(x, y, field.shape)
        if field[j, i] < math.inf
    ]
    for _, _, i, j in sorted(found):
        if _may_hop(terrain, (x, y), (i, j), radius):
            return i, j
    return None


def _may_hop(
    terrain: Terrain,
    begin: tuple[float, float],
    end: tuple[float, float],
    radius: float,
) -> bool:
    """Whether the body touches nothing on the straight line between two points."""
    touch = first_contact(
        terrain.padded,
        terrain.padded_clear,
        float(begin[0]),
        float(begin[1]),
        math.atan2(end[1] - begin[1], end[0] - begin[0]),
        math.dist(begin, end),
        0.0,
        radius,
    )
    return bool(touch > 1.0)


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
        return (
            f"the body fits nowhere; the widest place is {terrain.clear.max():.1f} px"
        )
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return f"the nearest free pixel is ({columns[nearest]}, {rows[nearest]})"


def _route(
    terrain: Terrain, start: Pose, goal: tuple[float, float], radius: float
) -> NDArray[np.float32]:
    """Way to the goal from each pixel; refused where the start has none."""
    free = body_free(terrain.clear, radius)
    # A goal that just holds the body may have no roomy pixel at its very centre.
    near = [(math.dist(goal, pixel), *pixel) for pixel in _near(*goal, free.shape)]
    for _, i, j in sorted(near):
        if free[j, i] and _may_hop(terrain, goal, (i, j), radius):
            field = _shared_field(terrain, (i, j), radius)
            if _entry(terrain, field, start.x, start.y, radius) is not None:
                return field
            break
    widest = widest_connected_radius(terrain.clear, (start.x, start.y), goal)
    reason = f"the widest body that gets through has a radius of {widest:.1f} px"
    if widest <= 0.0:
        reason = "they are in separate rooms"
    raise TaskError(
        f"no free path for a body of {radius:g} px from start ({start.x:g}, "
        f"{start.y:g}) to goal ({goal[0]:g}, {goal[1]:g}): {reason}"
    )


def _field_to(
    terrain: Terrain, goal: tuple[int, int], radius: float
) -> NDArray[np.float32]:
    free = body_free(terrain.clear, radius)
    field = distance_field(free, goal).astype(np.float32)
    field.flags.writeable = False
    return field


_shared_field = lru_cache(maxsize=4)(_field_to)


def _way(terrain: Terrain, field: NDArray[np.float32], start: Pose) -> float:
    cells, clear = terrain.padded, terrain.padded_clear
    return float(path_distance(cells, clear, field, start.x, start.y, math.inf))


def _restored(
    terrain: Terrain, start: Pose, goal: tuple[float, float], *rest: Any
) -> Map2DTask:
    """A task from its pickle, which leaves out what can be computed."""
    robot, tolerance, dt, horizon = rest
    field = _route(terrain, start, goal, robot.radius)
    shortest = _way(terrain, field, start)
    return Map2DTask(
        terrain, start, goal, robot, tolerance, dt, horizon, field, shortest
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
