"""What is wanted of an e-puck: start, goal, and the shortest way between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import finite_numbers, finite_point, positive, steps_of
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import (
    MAX_DRAWS,
    Pose,
    generous_horizon,
    jittered_pose,
    wrapped,
)
from tdac_envs.epuck.ground import Ground, Point
from tdac_envs.epuck.kernels import AXLE_LENGTH, WHEEL_RADIUS
from tdac_envs.epuck.paths import (
    at_goal,
    check_stands,
    entry,
    field_to,
    path_down,
    route,
)
from tdac_envs.grid.plan import Path
from tdac_envs.worlds.bodies import BODY_RADIUS

TOLERANCE = 0.02
"""m, as the paper has it."""


@dataclass(frozen=True, slots=True, eq=False)
class EPuckTask:
    """A feasible task: drive the e-puck from start to goal and touch nothing.

    Attributes:
        ground: The world.
        start: Nominal start pose, m and rad.
        goal: Point (x, y), m.
        max_wheel_speed: rad/s.
        goal_tolerance: m.
        dt: Duration of a step, s.
        horizon: Steps before the episode is cut off.
        field: Length of the shortest path for the body from each grid point to the
            goal, m; see `paths.route`.
        shortest: d0, length of that path from the nominal start, m.
    """

    env_id: ClassVar = "TDAC-EPuck-v0"

    ground: Ground
    start: Pose
    goal: Point
    max_wheel_speed: float
    goal_tolerance: float
    dt: float
    horizon: int
    field: NDArray[np.float32]
    shortest: float

    def __reduce__(self) -> tuple[Any, ...]:
        rest = (self.max_wheel_speed, self.goal_tolerance, self.dt, self.horizon)
        return _restored, (self.ground, self.start, self.goal, *rest)

    @property
    def body_radius(self) -> float:
        """Of the disc, m."""
        return BODY_RADIUS

    @property
    def axle_length(self) -> float:
        """Distance between the wheels, m."""
        return AXLE_LENGTH

    @property
    def full_step(self) -> float:
        """Way of one step at full speed, m."""
        return self.max_wheel_speed * WHEEL_RADIUS * self.dt

    def jittered(self, random: np.random.Generator) -> Pose:
        """A start of the jitter variation; see `jittered_start`."""
        return jittered_start(self, random)

    def path_from(self, start: Pose) -> Path:
        """Shortest path for the body, shape (n, 2), m; empty where there is none."""
        path = path_down(self.ground, self.field, start[:2])
        return np.vstack([path, self.goal]) if len(path) else path

    def moved(self, start: Pose, goal: Point | None = None) -> EPuckTask:
        """The same task with another start (and goal); horizon and tolerance kept.

        Raises:
            TaskError: No path joins the new start and goal.
        """
        goal = self.goal if goal is None else goal
        field = self.field
        if goal != self.goal:
            field = route(self.ground, start[:2], goal)
        start = start._replace(heading=wrapped(start.heading))
        shortest = way(self.ground, field, start[:2])
        return replace(self, start=start, goal=goal, field=field, shortest=shortest)


def make_task(
    ground: Ground,
    start: Sequence[float],
    goal: Sequence[float],
    *,
    max_wheel_speed: float,
    dt: float,
    goal_tolerance: float = TOLERANCE,
    horizon: int | None = None,
) -> EPuckTask:
    """Checks that a task is feasible and completes it.

    Args:
        ground: The world.
        start: Pose, m and rad.
        goal: Point (x, y), m.
        max_wheel_speed: rad/s.
        dt: Duration of a step, s.
        goal_tolerance: m.
        horizon: Steps; by default max(2500, 6 * d0 / (v_max * dt)).

    Raises:
        TaskError: A number is not usable, start or goal cannot hold the body, no path
            joins them, or the start is already within the tolerance; the message says
            which and what to do.
    """
    begin = Pose(*finite_numbers("start", start, 3))
    begin = begin._replace(heading=wrapped(begin.heading))
    end = finite_point("goal", goal)
    tolerance = positive("goal_tolerance", goal_tolerance)
    limit, dt = positive("max_wheel_speed", max_wheel_speed), positive("dt", dt)
    check_stands(ground, "start", begin.x, begin.y)
    check_stands(ground, "goal", *end)
    field = route(ground, begin[:2], end)
    if at_goal(ground, end, tolerance, begin.x, begin.y):
        raise TaskError(
            f"the start is already at the goal: {math.dist(begin[:2], end):.3f} m "
            f"apart with a tolerance of {tolerance:g} m; move one of them"
        )
    shortest = way(ground, field, begin[:2])
    task = EPuckTask(ground, begin, end, limit, tolerance, dt, 1, field, shortest)
    steps = default_horizon(task) if horizon is None else horizon
    return replace(task, horizon=steps_of(steps))


def default_horizon(task: EPuckTask) -> int:
    """Steps for a task: six times what its shortest path takes, or 2500."""
    return generous_horizon(task.shortest, task.full_step)


def way(ground: Ground, field: NDArray[np.float32], at: Point) -> float:
    """Length of the shortest path from a place by a field of `route`, m."""
    begin = entry(ground, field, at)
    if begin is None:
        return math.inf
    column, row = begin
    return float(field[row, column]) + math.dist(at, ground.at(column, row))


def jittered_start(task: EPuckTask, random: np.random.Generator) -> Pose:
    """A feasible start within one body radius of the nominal, heading +- 0.5 rad."""
    return jittered_pose(
        task.start, BODY_RADIUS, random, lambda pose: _may_start(task, pose)
    )


def mixed_start(task: EPuckTask, random: np.random.Generator) -> Pose:
    """A jittered start or, in every second episode on average, any feasible one.

    These are drawn from the grid points connected to the goal.
    """
    if random.random() < 0.5:
        return jittered_start(task, random)
    ground = task.ground
    connected = np.flatnonzero(np.isfinite(task.field))
    for _ in range(MAX_DRAWS):
        start = ground.at(*_place(task, int(random.choice(connected))))
        heading = wrapped(random.uniform(-math.pi, math.pi))
        if not at_goal(ground, task.goal, task.goal_tolerance, *start):
            return Pose(*start, heading)
    return task.start


def random_task(task: EPuckTask, random: np.random.Generator) -> EPuckTask:
    """The same world with any feasible start and goal; horizon kept.

    Both are drawn from the grid points connected to the nominal goal.
    """
    ground = task.ground
    connected = np.flatnonzero(np.isfinite(task.field))
    for _ in range(MAX_DRAWS):
        ends = [_place(task, int(random.choice(connected))) for _ in range(2)]
        heading = wrapped(random.uniform(-math.pi, math.pi))
        goal, start = (ground.at(*end) for end in ends)
        if not at_goal(ground, goal, task.goal_tolerance, *start):
            field = field_to(ground, ends[0])
            shortest = float(field[ends[1][::-1]])
            return replace(
                task,
                start=Pose(*start, heading),
                goal=goal,
                field=field,
                shortest=shortest,
            )
    return task


def _place(task: EPuckTask, index: int) -> tuple[int, int]:
    row, column = divmod(index, task.field.shape[1])
    return column, row


def _may_start(task: EPuckTask, pose: Pose) -> bool:
    ground = task.ground
    return (
        ground.gap(pose.x, pose.y) >= BODY_RADIUS + 1e-3
        and entry(ground, task.field, pose[:2]) is not None
        and not at_goal(ground, task.goal, task.goal_tolerance, pose.x, pose.y)
    )


def _restored(ground: Ground, start: Pose, goal: Point, *rest: Any) -> EPuckTask:
    """A task from its pickle, which leaves out what can be computed."""
    limit, tolerance, dt, horizon = rest
    field = route(ground, start[:2], goal)
    shortest = way(ground, field, start[:2])
    return EPuckTask(
        ground, start, goal, limit, tolerance, dt, horizon, field, shortest
    )
