"""The navigation task of an e-puck: start, goal and shortest path."""

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
from tdac_envs.epuck.contact import first_touch
from tdac_envs.epuck.ground import Ground, Point
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.epuck.paths import (
    at_goal,
    check_body_fits,
    field_to,
    path_down,
    path_entry,
    route,
)
from tdac_envs.grid.plan import Path
from tdac_envs.grid.shortcuts import taut
from tdac_envs.worlds.bodies import BODY_RADIUS

TOLERANCE = 0.02
"""Default goal tolerance, m, as in the paper."""


@dataclass(frozen=True, slots=True, eq=False)
class EPuckTask:
    """A feasible task: drive an e-puck from start to goal without touching anything.

    Attributes:
        ground: The world.
        start: Nominal start pose, m and rad.
        goal: Point (x, y), m.
        max_wheel_speed: Wheel speed at action 1, rad/s.
        goal_tolerance: Distance at which the goal is reached, m.
        dt: Duration of a step, s.
        horizon: Number of steps before truncation.
        field: Length of the shortest grid path for the body from each grid point to
            the goal, m; see `paths.route`.
        shortest: d0, the length of the shortest grid path from the nominal start, m;
            see `path_from`.
        world_facts: What `info` says about the world of a task set; None elsewhere.
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
    world_facts: dict[str, Any] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        rest = (self.max_wheel_speed, self.goal_tolerance, self.dt, self.horizon)
        return _restored, (self.ground, self.start, self.goal, *rest, self.world_facts)

    @property
    def body_radius(self) -> float:
        """Body radius, m."""
        return BODY_RADIUS

    @property
    def axle_length(self) -> float:
        """Effective axle of the robot in this world, m; see `EPuck.axle_length`."""
        return self.ground.world.robot.axle_length

    @property
    def full_step(self) -> float:
        """Distance of one step at full speed, m."""
        return self.max_wheel_speed * WHEEL_RADIUS * self.dt

    def jittered(self, random: np.random.Generator) -> Pose:
        """A feasible start within a body radius of the nominal one, heading +- 0.5."""
        may_start = partial(_may_start, self)
        return jittered_pose(self.start, BODY_RADIUS, random, may_start)

    def point(self, index: int) -> Point:
        """The grid point, m, at an index of the flattened field."""
        row, column = divmod(index, self.field.shape[1])
        return self.ground.at(column, row)

    def field_to(self, index: int) -> NDArray[np.float32]:
        """`field` for a goal at the grid point of an index."""
        row, column = divmod(index, self.field.shape[1])
        return field_to(self.ground, (column, row))

    def is_at_goal(self, x: float, y: float, goal: Point) -> bool:
        """Whether a robot at (x, y) has reached a goal, m."""
        return at_goal(self.ground, goal, self.goal_tolerance, x, y)

    def with_ends(
        self, start: Sequence[float] | None = None, goal: Sequence[float] | None = None
    ) -> EPuckTask:
        """This task with another start and goal, which are checked.

        Args:
            start: (x, y) or (x, y, heading); by default its own.
            goal: (x, y); by default its own.

        Raises:
            TaskError: The task is not feasible.
        """
        begin = tuple(self.start if start is None else start)
        return make_task(
            self.ground,
            finite_numbers("start", (*begin, self.start.heading)[:3], 3),
            self.goal if goal is None else goal,
            max_wheel_speed=self.max_wheel_speed,
            dt=self.dt,
            goal_tolerance=self.goal_tolerance,
            horizon=self.horizon,
        )

    def path_from(self, start: Pose) -> Path:
        """Shortest grid path from `start` to the goal, shape (n, 2), m; may be empty.

        It steps from grid point to grid point, so it is up to 8 % longer than
        `shortest_path`.
        """
        path = path_down(self.ground, self.field, start[:2])
        return np.vstack([path, self.goal]) if len(path) else path

    def shortest_path(self, start: Pose) -> Path:
        """The shortest path from `start` to the goal that is printed and drawn.

        It is the grid path after every shortcut that the body can take.

        Returns:
            Its corners, shape (n, 2), m; empty if there is no path.
        """
        return np.array(self.pulled(self.path_from(start))).reshape(-1, 2)

    def pulled(self, path: Path) -> list[Point]:
        """The corners of a path, in m, after every shortcut that the body can take."""
        return taut(path, self._is_line_free)

    def _is_line_free(self, begin: Point, end: Point) -> bool:
        """Whether the body can drive straight between two points."""
        (x, y), (to_x, to_y) = begin, end
        solid, heading = self.ground.solid, math.atan2(to_y - y, to_x - x)
        length = math.hypot(to_x - x, to_y - y)
        touch = first_touch(*solid.arrays(), x, y, heading, length, 0.0, BODY_RADIUS)
        return bool(touch > 1.0)

    def moved(self, start: Pose, goal: Point | None = None) -> EPuckTask:
        """This task with another start (and goal), but the same horizon and tolerance.

        Raises:
            TaskError: No path joins the new start and goal.
        """
        goal = self.goal if goal is None else goal
        field = self.field
        if goal != self.goal:
            field = route(self.ground, start[:2], goal)
        start = start._replace(heading=wrap_heading(start.heading))
        shortest = path_length_from(self.ground, field, start[:2])
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
    """Makes a task and checks that it is feasible.

    Args:
        ground: The world.
        start: Pose, m and rad.
        goal: Point (x, y), m.
        max_wheel_speed: Wheel speed at action 1, rad/s.
        dt: Duration of a step, s.
        goal_tolerance: Distance at which the goal is reached, m.
        horizon: Number of steps; by default max(2500, 6 * d0 / (v_max * dt)).

    Raises:
        TaskError: A number is not valid, the body does not fit at start or goal, no
            path joins them, or the start is already within the tolerance.
    """
    begin = Pose(*finite_numbers("start", start, 3))
    begin = begin._replace(heading=wrap_heading(begin.heading))
    end = finite_point("goal", goal)
    tolerance = positive("goal_tolerance", goal_tolerance)
    limit, dt = positive("max_wheel_speed", max_wheel_speed), positive("dt", dt)
    check_full_step(dt, limit * WHEEL_RADIUS, "m")
    check_body_fits(ground, "start", begin.x, begin.y)
    check_body_fits(ground, "goal", *end)
    field = route(ground, begin[:2], end)
    if at_goal(ground, end, tolerance, begin.x, begin.y):
        raise TaskError(
            f"the start is already at the goal: {math.dist(begin[:2], end):.3f} m "
            f"apart with a tolerance of {tolerance:g} m; move one of them"
        )
    shortest = path_length_from(ground, field, begin[:2])
    task = EPuckTask(ground, begin, end, limit, tolerance, dt, 1, field, shortest)
    if horizon is None:
        horizon = default_horizon(shortest, task.full_step)
    return replace(task, horizon=horizon_steps(horizon))


def path_length_from(ground: Ground, field: NDArray[np.float32], at: Point) -> float:
    """Length of the shortest path from a point, m, given a field of `route`."""
    begin = path_entry(ground, field, at)
    if begin is None:
        return math.inf
    column, row = begin
    return float(field[row, column]) + math.dist(at, ground.at(column, row))


def _may_start(task: EPuckTask, pose: Pose) -> bool:
    ground = task.ground
    return (
        ground.gap(pose.x, pose.y) >= BODY_RADIUS + 1e-3
        and path_entry(ground, task.field, pose[:2]) is not None
        and not task.is_at_goal(pose.x, pose.y, task.goal)
    )


def _restored(ground: Ground, start: Pose, goal: Point, *rest: Any) -> EPuckTask:
    """Restores a pickled task and recomputes what the pickle leaves out."""
    limit, tolerance, dt, horizon, world_facts = rest
    field = route(ground, start[:2], goal)
    shortest = path_length_from(ground, field, start[:2])
    return EPuckTask(
        ground, start, goal, limit, tolerance, dt, horizon, field, shortest, world_facts
    )
