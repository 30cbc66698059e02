"""The navigation task on a map: start, goal, robot and shortest path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import (
    finite_numbers,
    finite_point,
    horizon_steps,
    positive,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import (
    Pose,
    check_full_step,
    default_horizon,
    jittered_pose,
    wrap_heading,
)
from tdac_envs.grid.grid import body_free
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.plan import Path, descend
from tdac_envs.grid.shortcuts import taut
from tdac_envs.map2d.straight import is_line_free
from tdac_envs.map2d.terrain import (
    Terrain,
    at_goal,
    check_body_fits,
    field_to,
    may_start,
    path_entry,
    path_length_from,
    route,
    widest_connected_radius,
)
from tdac_envs.mapping.params import RobotParams
from tdac_envs.movers.state import Movers

__all__ = [
    "Map2DTask",
    "Terrain",
    "at_goal",
    "make_task",
    "widest_connected_radius",
]

MAX_TOLERANCE = 20.0
SAFE = 1e-3
"""Clearance of a shortcut beyond the body, px."""


@dataclass(frozen=True, slots=True, eq=False)
class Map2DTask:
    """A feasible task: drive a disc from start to goal without touching anything.

    Attributes:
        terrain: The map.
        start: Nominal start pose, px and rad.
        goal: Point (x, y), px.
        robot: Body, wheels and sensor of the robot.
        goal_tolerance: Distance at which the goal is reached, px.
        dt: Duration of a step, s.
        horizon: Number of steps before truncation.
        field: Shape (height, width), float32: length of the shortest grid path for
            the body from each pixel to the goal, px; inf if there is none.
        shortest: d0, the length of the shortest grid path from the nominal start, px;
            see `path_from`.
        movers: The movers at the start of the episode; None without movers.
        world_facts: What `info` says about the world of a task set; None elsewhere.
    """

    env_id: ClassVar = "TDAC-Map2D-v0"

    terrain: Terrain
    start: Pose
    goal: tuple[float, float]
    robot: RobotParams
    goal_tolerance: float
    dt: float
    horizon: int
    field: NDArray[np.float32]
    shortest: float
    movers: Movers | None = None
    world_facts: dict[str, Any] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        rest = self.robot, self.goal_tolerance, self.dt, self.horizon
        ends = self.terrain, self.start, self.goal
        return _restored, (*ends, *rest, self.movers, self.world_facts)

    @property
    def body_radius(self) -> float:
        """Body radius, px."""
        return self.robot.radius

    @property
    def axle_length(self) -> float:
        """Distance between the wheels, px."""
        return self.robot.axle_length

    @property
    def full_step(self) -> float:
        """Distance of one step at full speed, px."""
        return self.robot.max_wheel_speed * self.dt

    def jittered(self, random: np.random.Generator) -> Pose:
        """A feasible start within a body radius of the nominal one, heading +- 0.5."""
        may_start = partial(_may_start, self)
        return jittered_pose(self.start, self.robot.radius, random, may_start)

    def point(self, index: int) -> tuple[float, float]:
        """The pixel (x, y) at an index of the flattened field."""
        row, column = divmod(index, self.field.shape[1])
        return float(column), float(row)

    def field_to(self, index: int) -> NDArray[np.float32]:
        """`field` for a goal at the pixel of an index."""
        x, y = map(int, self.point(index))
        return field_to(self.terrain, (x, y), self.robot.radius)

    def is_at_goal(self, x: float, y: float, goal: tuple[float, float]) -> bool:
        """Whether a robot at (x, y) has reached a goal, px."""
        return at_goal(self.terrain, goal, self.goal_tolerance, x, y)

    def with_ends(
        self, start: Sequence[float] | None = None, goal: Sequence[float] | None = None
    ) -> Map2DTask:
        """This task with another start and goal, which are checked.

        Args:
            start: (x, y) or (x, y, heading); by default its own.
            goal: (x, y); by default its own.

        Raises:
            TaskError: The task is not feasible.
        """
        return make_task(
            self.terrain,
            (*(self.start if start is None else start), self.start.heading)[:3],
            self.goal if goal is None else goal,
            self.robot,
            dt=self.dt,
            goal_tolerance=self.goal_tolerance,
            horizon=self.horizon,
        )

    def path_from(self, start: Pose) -> Path:
        """Shortest grid path from `start` to the goal, shape (n, 2), px; may be empty.

        It steps from pixel to pixel, so it is up to 8 % longer than `shortest_path`.
        """
        radius = self.robot.radius
        first = path_entry(self.terrain, self.field, start.x, start.y, radius)
        if first is None:
            return np.empty((0, 2))
        free = body_free(self.terrain.clear, radius)
        path = descend(free, np.asarray(self.field, np.float64), first)
        return np.vstack([[start.x, start.y], path, self.goal])

    def shortest_path(self, start: Pose) -> Path:
        """The shortest path from `start` to the goal that is printed and drawn.

        It is the grid path after every shortcut that the body can take.

        Returns:
            Its corners, shape (n, 2), px; empty if there is no path.
        """
        return np.array(self.pulled(self.path_from(start))).reshape(-1, 2)

    def pulled(self, path: Path, safe: float = SAFE) -> list[tuple[float, float]]:
        """The corners of a path after every shortcut that the body can take.

        Args:
            path: Shape (n, 2), px.
            safe: Clearance of a shortcut beyond the body, px.
        """
        clear, radius = self.terrain.padded_clear, self.robot.radius + safe
        return taut(path, lambda begin, end: is_line_free(clear, begin, end, radius))

    def fresh_movers(self) -> Movers:
        """New arrays of the movers at the start of an episode."""
        return Movers.none() if self.movers is None else self.movers.fresh()

    def moved(self, start: Pose, goal: tuple[float, float] | None = None) -> Map2DTask:
        """This task with another start (and goal), but the same horizon and tolerance.

        Raises:
            TaskError: No path joins the new start and goal.
        """
        field, radius = self.field, self.robot.radius
        if goal is None or goal == self.goal:
            goal = self.goal
        else:
            field = route(self.terrain, start[:2], goal, radius)
        start = start._replace(heading=wrap_heading(start.heading))
        shortest = path_length_from(self.terrain, field, start.x, start.y)
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
    units: MapUnits = PIXELS,
) -> Map2DTask:
    """Makes a task and checks that it is feasible.

    Args:
        terrain: The map.
        start: Pose, px and rad.
        goal: Point (x, y), px.
        robot: Body, wheels and sensor of the robot.
        dt: Duration of a step, s.
        goal_tolerance: Distance at which the goal is reached, px; by default
            min(20, d0 / 4), and on a map with a resolution min(body radius, d0 / 4).
        horizon: Number of steps; by default max(2500, 6 * d0 / (v_max * dt)).
        units: Units of messages.

    Raises:
        TaskError: A number is not valid, the body does not fit at start or goal, no
            path joins them, or the start is already within the tolerance.
    """
    begin = Pose(*finite_numbers("start", start, 3))
    begin = begin._replace(heading=wrap_heading(begin.heading))
    end = finite_point("goal", goal)
    dt = positive("dt", dt)
    check_full_step(dt, robot.max_wheel_speed, "px")
    check_body_fits(terrain, "start", begin.x, begin.y, robot.radius, units)
    check_body_fits(terrain, "goal", *end, robot.radius, units)
    field = route(terrain, begin[:2], end, robot.radius, units)
    shortest = path_length_from(terrain, field, begin.x, begin.y)
    if goal_tolerance is None:
        paper = terrain.grid.resolution is None
        tolerance = min(MAX_TOLERANCE if paper else robot.radius, 0.25 * shortest)
    else:
        tolerance = positive("goal_tolerance", goal_tolerance)
    if at_goal(terrain, end, tolerance, begin.x, begin.y):
        raise TaskError(
            "the start is already at the goal: "
            f"{units.length(math.dist(begin[:2], end), 1)} apart with a tolerance of "
            f"{units.length(tolerance, 1)}; move one of them"
        )
    if horizon is None:
        horizon = default_horizon(shortest, robot.max_wheel_speed * dt)
    steps = horizon_steps(horizon)
    return Map2DTask(terrain, begin, end, robot, tolerance, dt, steps, field, shortest)


def _may_start(task: Map2DTask, pose: Pose) -> bool:
    terrain = task.terrain
    return may_start(
        terrain.padded_clear,
        terrain.leaps,
        task.field,
        *map(float, (pose.x, pose.y, task.robot.radius)),
        *map(float, (*task.goal, task.goal_tolerance)),
    )


def _restored(
    terrain: Terrain, start: Pose, goal: tuple[float, float], *rest: Any
) -> Map2DTask:
    """Restores a pickled task and recomputes what the pickle leaves out."""
    robot, tolerance, dt, horizon, *further = rest
    field = route(terrain, start[:2], goal, robot.radius)
    shortest = path_length_from(terrain, field, start.x, start.y)
    return Map2DTask(
        terrain, start, goal, robot, tolerance, dt, horizon, field, shortest, *further
    )
