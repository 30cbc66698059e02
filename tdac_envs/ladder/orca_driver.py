"""A privileged driver among people: ORCA with the true velocities of all movers.

It knows the map, the pose, its own wheels, and where each mover is and goes. A world
with a crowd is admitted if it arrives; its time is a reference for results.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.drive.rewards import RewardWeights
from tdac_envs.drive.stepping import (
    AXLE,
    DT,
    GAIN_LEFT,
    GAIN_RIGHT,
    MAX_SPEED,
)
from tdac_envs.drive.stepping import RADIUS as BODY
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.contact import arc_contact
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.setup import Map2DSetup
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.crowd import next_node
from tdac_envs.movers.orca import N_PLANE, add_neighbour, chosen_velocity
from tdac_envs.movers.state import RADIUS, VX, VY, X, Y
from tdac_envs.movers.walls import MOST_WALLS, Cells, cells_of, segments_of, wall_planes

Array = NDArray[np.float64]

HORIZON = 2.0
"""The courses of movers are avoided for this time, s."""
WALL_HORIZON = 0.3
"""No wall is reached within this time, s."""
MARGIN = 1.5
"""Distance that is kept from movers, px: turns take time."""
LOOK = 10
"""The robot heads for the place that is so many pixels farther on its way."""
LEVELS = 13
"""Speeds that are tried for each wheel."""
HOLD = 4
"""Steps for which wheel speeds are tried."""
FACING = 0.5
"""What it costs to face away from the velocity, as a part of the way."""
_BESIDE = 3  # pixels around the robot in which its way may begin


class OrcaDrive(NamedTuple):
    """A drive to the goal: its duration, steps, and its length, px."""

    steps: int
    driven: float


class OrcaDriver:
    """Chooses the actions of an episode from the whole state of an environment.

    Args:
        env: The environment, after `reset`.
    """

    def __init__(self, env: Map2DEnv) -> None:
        task, robot = env.task, env.task.robot
        fastest = robot.max_wheel_speed
        cells = task.terrain.grid.cells
        walls = segments_of(cells)
        reach = robot.radius + WALL_HORIZON * fastest + 1.0
        first, listed = cells_of(walls, cells.shape, reach)
        self._env, self._last = env, env.pose()
        maps = walls, first, listed, task.field[None], task.terrain.padded_clear
        self._map = tuple(read_only(array) for array in maps)
        self._goal = np.array(task.goal)

    def action(self) -> NDArray[np.float32]:
        """The next action, shape (2,)."""
        env, pose, out = self._env, self._env.pose(), np.zeros(2)
        velocity = (pose[:2] - self._last[:2]) / env.task.dt
        self._last = pose
        movers, (walls, first, listed, fields, clear) = env.movers, self._map
        _choose(
            walls, first, listed, fields, clear, movers.traits, movers.now,
            env.robot.constants, pose, velocity, self._goal, out,
        )  # fmt: skip
        return out.astype(np.float32)


def drive_by_orca(
    task: Map2DTask, disturbances: Disturbances, noise: np.random.Generator
) -> OrcaDrive | None:
    """The driver's way to the goal; None if it does not reach it.

    Args:
        task: The task with its movers, which are only read.
        disturbances: Those of the episode.
        noise: Random numbers of the episode's disturbances.
    """
    env = Map2DEnv.of(
        Map2DSetup(
            nominal=task,
            variation="nominal",
            fixed_horizon=True,
            on_collision="terminate",
            motor_lag=0.0,
            delay=0,
            disturbances=disturbances,
            weights=RewardWeights(),
            source=None,
            range_noise=0.0,
            range_dropout=0.0,
        )
    )
    env.np_random = noise
    env.reset()
    driver, driven, last = OrcaDriver(env), 0.0, env.pose()
    for step in range(1, task.horizon + 1):
        _, _, terminated, _, info = env.step(driver.action())
        driven, last = driven + math.dist(env.pose()[:2], last[:2]), env.pose()
        if terminated:
            return OrcaDrive(step, driven) if info["is_success"] else None
    return None


@subkernel
def _way(fields: FloatGrid, x: float, y: float, goal: Array) -> tuple[float, float]:
    """The place on the way to the goal for which to head, px."""
    rows, columns = fields.shape[1:]
    row, column = int(y + 0.5), int(x + 0.5)
    least, i, j = math.inf, column, row
    for b in range(max(row - _BESIDE, 0), min(row + _BESIDE + 1, rows)):
        for a in range(max(column - _BESIDE, 0), min(column + _BESIDE + 1, columns)):
            length = fields[0, b, a] + math.hypot(a - x, b - y)
            if length < least:
                least, i, j = length, a, b
    for _ in range(LOOK):
        next_i, next_j = next_node(fields, 0, i, j)
        if next_i == i and next_j == j:
            return goal[0], goal[1]
        i, j = next_i, next_j
    return float(i), float(j)


@kernel
def _choose(
    walls: Array, first: Cells, listed: Cells, fields: FloatGrid, clear: FloatGrid,
    traits: Array, now: Array, constants: Array, pose: Array, velocity: Array,
    goal: Array, out: Array,
) -> None:  # fmt: skip
    """Chooses wheel speeds that come near to the velocity of ORCA, and touch nothing.

    Args:
        walls: From `walls.segments_of`.
        first: From `walls.cells_of`.
        listed: From `walls.cells_of`.
        fields: `Map2DTask.field` as the field of the only place; see `Places`.
        clear: `Terrain.padded_clear`.
        traits: `Movers.traits`.
        now: `Movers.now`.
        constants: `Map2DArrays.constants`.
        pose: Pose of the robot, px and rad.
        velocity: Its velocity in the last step, px/s.
        goal: px.
        out: Shape (2,), all 0; overwritten with the action.
    """
    x, y, heading = pose[0], pose[1], pose[2]
    radius, fastest, dt = constants[BODY], constants[MAX_SPEED], constants[DT]
    planes = np.empty((2 * (MOST_WALLS + traits.shape[0]), N_PLANE))
    number = wall_planes(
        walls, first, listed, x, y, radius, fastest, WALL_HORIZON, planes
    )
    count = number
    for m in range(traits.shape[0]):
        count = add_neighbour(
            planes, count, now[m, X] - x, now[m, Y] - y, velocity[0], velocity[1],
            now[m, VX], now[m, VY], radius + traits[m, RADIUS] + MARGIN, 1.0, HORIZON,
            dt,
        )  # fmt: skip
    to_x, to_y = _way(fields, x, y, goal)
    off = math.hypot(to_x - x, to_y - y)
    want = fastest / off if off > 0.0 else 0.0
    vx, vy = chosen_velocity(
        planes, number, count, fastest, want * (to_x - x), want * (to_y - y)
    )
    ahead = HOLD * dt
    speed, least = math.hypot(vx, vy), math.inf
    for i in range(LEVELS):
        for j in range(LEVELS):
            left, right = 2.0 * i / (LEVELS - 1) - 1.0, 2.0 * j / (LEVELS - 1) - 1.0
            fast_left = min(max(left * constants[GAIN_LEFT], -1.0), 1.0) * fastest
            fast_right = min(max(right * constants[GAIN_RIGHT], -1.0), 1.0) * fastest
            forward = 0.5 * (fast_left + fast_right) * dt
            turn = (fast_left - fast_right) / constants[AXLE] * dt
            at_x, at_y, facing, touch = x, y, heading, 0.0
            for step in range(HOLD):
                if arc_contact(clear, at_x, at_y, facing, forward, turn, radius) <= 1.0:
                    touch += HOLD - step
                    break
                at_x += forward * math.cos(facing + 0.5 * turn)
                at_y += forward * math.sin(facing + 0.5 * turn)
                facing += turn
                time = (step + 1) * dt
                for m in range(traits.shape[0]):
                    far = math.hypot(
                        now[m, X] + time * now[m, VX] - at_x,
                        now[m, Y] + time * now[m, VY] - at_y,
                    )
                    if far < radius + traits[m, RADIUS] + 0.3 * MARGIN:
                        touch += HOLD - step
            off = math.hypot(at_x - x - ahead * vx, at_y - y - ahead * vy)
            if speed > 0.0:
                turned = math.cos(facing) * vx + math.sin(facing) * vy
                off += FACING * (speed - abs(turned)) * ahead
            off += 1e3 * touch
            if off < least:
                least, out[0], out[1] = off, left, right
