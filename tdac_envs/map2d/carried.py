"""A robot on a map, moved by another physics, in metres and with y up."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words
from tdac_envs.core.compiled import kernel
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.stepping import (
    AXLE,
    CONTACT,
    DT,
    FORWARD,
    HEADING,
    REMAINING,
    TOUCHED,
    TURN,
    apply_command,
    finish_step,
)
from tdac_envs.map2d.kernels import arc_of, arrays_at, ground_speeds, observe
from tdac_envs.map2d.robot import Map2DArrays
from tdac_envs.map2d.setup import Map2DSetup
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.physics.body import BodySpec, disc_body
from tdac_envs.physics.boxes import scene_on
from tdac_envs.physics.moved import Pose, arc_between, rim_speeds

UNSCALED_RADIUS = 0.1
"""Body radius of a robot on a map without a resolution, m."""
_WALLS = 2.0
"""Height of walls, in heights of the robot."""


class Carried:
    """A robot on a map whose body is moved by MuJoCo.

    The seam is here: pixels become metres, and y, which points down in the picture,
    points up. So left stays left, and headings change their sign.

    Args:
        setup: Configuration of the environment.
        task: A task on the map.

    Raises:
        TaskError: MuJoCo is not installed, there are movers, the map needs too many
            boxes, or MuJoCo cannot measure the rays.
    """

    def __init__(self, setup: Map2DSetup, task: Map2DTask) -> None:
        from tdac_envs.physics.engine import MujocoBody

        if setup.has_movers:
            raise TaskError("physics 'mujoco' has no movers; leave them out")
        if setup.physics.measures:
            _check_rays(setup)
        self._metres = metres_of(setup, task)
        body = setup.physics.body_like(body_of(task, self._metres))
        cells = task.terrain.grid.cells
        self.body = MujocoBody(scene_on(cells, self._metres, _WALLS * body.top), body)
        self._level = body.top
        self._directions = setup.directions

    def reset(self, start: Pose) -> None:
        """Begins an episode at a pose: px, px, rad."""
        self.body.reset(self._out(start))

    def step(self, words: Words, robot: Map2DArrays, task: Map2DTask) -> None:
        """Runs one step.

        Args:
            words: Addresses of the arrays; see `kernels.begin`.
            robot: Arrays of the robot.
            task: The task of the episode.
        """
        state, dt = robot.state, task.dt
        turn_wheels(words)
        forward, turn = state[FORWARD : TURN + 1].tolist()
        axle = task.robot.axle_length
        left, right = rim_speeds(forward, -turn, axle, dt)
        x, y, heading = state[: HEADING + 1].tolist()
        moved = self.body.step(left * self._metres, right * self._metres, dt)
        state[: HEADING + 1] = end = self._back(moved.pose)
        state[FORWARD], state[TURN] = arc_between((x, y, heading), end)
        robot.outcome[TOUCHED] = robot.outcome[CONTACT] = moved.touched
        finish(words)

    def calls(
        self,
        begin: Callable[[], None],
        words: Words,
        robot: Map2DArrays,
        task: Map2DTask,
        is_measured: bool,
    ) -> list[Callable[[], None]]:
        """What begins an episode, and what drives a step, with MuJoCo's body.

        Args:
            begin: What begins an episode with the exact body.
            words: Addresses of the arrays; see `kernels.begin`.
            robot: The arrays of the robot.
            task: Its task.
            is_measured: Whether MuJoCo measures the ranges, too.
        """
        both: list[Callable[[], None]] = [begin]
        both.append(partial(self.step, words, robot, task))
        if not is_measured:
            return both

        def measured(call: Callable[[], None]) -> None:
            call()
            self.measure(robot, task)

        return [partial(measured, call) for call in both]

    def measure(self, robot: Map2DArrays, task: Map2DTask) -> None:
        """Replaces the ranges by those that MuJoCo measures, at the robot's top."""
        own, (x, y, heading) = task.robot, self._out(robot.state[: HEADING + 1])
        cos, sin = math.cos(heading), math.sin(heading)
        ahead, aside = (
            self._metres * part for part in own.scanner_offset or (0.0, 0.0)
        )
        begin = x + cos * ahead + sin * aside, y + sin * ahead - cos * aside
        origins = np.tile((*begin, self._level), (own.n_rays, 1))
        near, right = self._directions
        level = np.zeros(own.n_rays)
        ways = np.array([cos * near + sin * right, sin * near - cos * right, level])
        found = self.body.ranges(origins, ways.T.copy(), own.range_max * self._metres)
        robot.ranges[:] = found / self._metres

    def _out(self, pose: Pose | NDArray[np.float64]) -> Pose:
        x, y, heading = map(float, pose)
        return x * self._metres, -y * self._metres, -heading

    def _back(self, pose: Pose) -> Pose:
        x, y, heading = pose
        wrapped = math.pi if heading == -math.pi else -heading
        return x / self._metres, -y / self._metres, wrapped


def _check_rays(setup: Map2DSetup) -> None:
    """Checks that MuJoCo can measure the rays.

    Raises:
        TaskError: It cannot.
    """
    if setup.sonar is not None:
        raise TaskError("sensor 'sonar': MuJoCo measures rays alone; take 'rays'")
    robot = setup.nominal.robot
    if math.hypot(*(robot.scanner_offset or (0.0, 0.0))) > robot.radius:
        raise TaskError(
            "scanner_offset: MuJoCo measures rays that begin within the body alone"
        )


def carried_by(setup: Map2DSetup, task: Map2DTask) -> Carried | None:
    """What moves the robot in place of the compiled step; None for the latter."""
    return None if setup.physics.is_exact else Carried(setup, task)


def metres_of(setup: Map2DSetup, task: Map2DTask) -> float:
    """Size of a pixel for the physics, m.

    The one that is given, or that of the map if it has one; otherwise the one with
    which the body's radius is `UNSCALED_RADIUS`.
    """
    own = setup.physics.resolution or setup.pixel_size
    return UNSCALED_RADIUS / task.robot.radius if own is None else own


def body_of(task: Map2DTask, metres: float) -> BodySpec:
    """The body of the robot of a task, of which only radius and axle are known."""
    robot = task.robot
    return disc_body(robot.radius * metres, robot.axle_length * metres)


@kernel
def turn_wheels(words: Words) -> None:
    """Begins a step: sets the wheels' speeds and the arc that they would drive."""
    own = arrays_at(words)
    constants, state, queue, wheel_speeds, outcome = (
        own[4], own[5], own[6], own[8], own[10],
    )  # fmt: skip
    apply_command(constants, state, queue, wheel_speeds, outcome)
    left, right = ground_speeds(constants, state, wheel_speeds)
    forward, turn = arc_of(left, right, constants[AXLE], constants[DT])
    state[FORWARD], state[TURN] = forward, turn


@kernel
def finish(words: Words) -> None:
    """Completes the step after the motion, once `outcome[TOUCHED]` is set."""
    own = arrays_at(words)
    constants, state, outcome = own[4], own[5], own[10]
    before = outcome[REMAINING]
    observe(own[0], own[1], own[2], own[3], constants, state, own[7], own[9], outcome)
    finish_step(constants, state, outcome, before)
