"""A simulated robot as its driver shows it: speeds in, scans and poses out, a timer.

It needs no DDS. Lengths are in metres of the map's frame, angles counter-clockwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.environments.map2d.setting import map_setting
from tdac_agent.ros2.package.motion import Wheels
from tdac_agent.ros2.package.scans import Layout
from tdac_agent.tasks.task import Task
from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv

MOST_STEPS = 1_000_000
"""Horizon of a drive, in which the robot may stand for any time."""
STANDS = 1e-6
"""Speed below which a wheel stands, as a fraction of the full speed."""


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What the robot's sensors say now.

    Attributes:
        pose: Shape (3,), as the localiser says: x, y, yaw.
        ranges: Shape (n,), float32; inf without a return, 0 below the least range of a
            scanner that reads so.
        wheels: Fractions of the wheels as driven.
    """

    pose: NDArray[np.float64]
    ranges: NDArray[np.float32]
    wheels: tuple[float, float]


class Robot:
    """The robot of a task, which obeys commands for as long as its timer says.

    Args:
        task: A task in metres.
        settings: Its settings, from `export.settings_of`.
        dead_man: Time after a command in which the robot obeys it, s.
        disturbed: Whether it has the errors of the task's robot: noise, slip, latency.
        seed: Seed of these errors, and of the start if it is disturbed.

    Attributes:
        time: Simulated time since the start of the drive, s.
        way: Length of the driven path, m.
        contact: What was touched, or an empty text.
        reached: Whether the goal is reached.
        cells: The occupied cells of its map, bool, `[y, x]`.
    """

    def __init__(
        self,
        task: Task,
        settings: dict[str, Any],
        *,
        dead_man: float,
        disturbed: bool = False,
        seed: int = 0,
    ) -> None:
        setting = map_setting(task.setting)
        options: dict[str, Any] = {"horizon": MOST_STEPS}
        if disturbed:
            own = task.disturbed_options(task.own_disturbance())
            options |= {**own, "variation": "jitter"}
        env = setting.make_env(**options)
        self._env = Map2DEnv.of(replace(env.setup, metric=setting.task_units.frame))
        self._scale = setting.task_units.per_pixel
        self.settings, self.dt = settings, float(settings["dt"])
        self.cells: NDArray[np.bool_] = setting.nominal.terrain.grid.cells
        self.dead_man = dead_man
        self._wheels = Wheels(settings["robot"], self.dt)
        self._seen, _ = self._env.reset(seed=seed)
        self._watch = self._env.watch_gap()
        self._watch.note()
        self.time, self.way, self.contact, self.reached = 0.0, 0.0, "", False
        self._command, self._until = (0.0, 0.0), 0.0

    @property
    def over(self) -> bool:
        """Whether the drive has ended: at the goal, or by a contact."""
        return self.reached or bool(self.contact)

    @property
    def stands(self) -> bool:
        """Whether both wheels stand."""
        return bool(np.abs(self._seen["wheel_speeds"]).max() < STANDS)

    @property
    def layout(self) -> Layout:
        """Header of its scans: the task's rays, which are evenly spaced."""
        robot = self.settings["robot"]
        angles = robot["ray_angles"]
        if len(angles) == 1:
            return Layout(1, angles[0], 0.01, _least(robot), robot["range_max"])
        turns = [math.remainder(b - a, math.tau) for a, b in pairwise(angles)]
        if max(turns) - min(turns) > 1e-6:
            raise TaskError(
                "the rays of this task are not evenly spaced, so no scan has them"
            )
        step = math.remainder(angles[1] - angles[0], math.tau)
        return Layout(len(angles), angles[0], step, _least(robot), robot["range_max"])

    def obey(self, v: float, omega: float) -> None:
        """Takes a command (m/s, rad/s), which holds until the timer ends it.

        Values that are not finite are no command.
        """
        if math.isfinite(v) and math.isfinite(omega):
            self._command, self._until = (v, omega), self.time + self.dead_man

    def step(self) -> None:
        """Drives for a control period."""
        if self.over:
            return
        obeys = self.time < self._until - 1e-9
        wheels = self._wheels.fractions(*self._command) if obeys else (0.0, 0.0)
        before = self._env.pose()
        action = np.array(wheels, np.float32)
        self._seen, _, _, _, info = self._env.step(action)
        self._watch.note()
        self.time += self.dt
        self.way += math.dist(before[:2], self._env.pose()[:2]) * self._scale
        self.contact = info["contact"] or ""
        self.reached = info["is_success"]

    def read(self) -> Reading:
        """The latest readings of the sensors."""
        most = np.float32(self.settings["robot"]["range_max"])
        ranges = self._seen["ranges"]
        left, right = map(float, self._seen["wheel_speeds"])
        return Reading(
            self._seen["pose"].astype(np.float64),
            np.where(ranges >= most, np.float32(np.inf), ranges),
            (left, right),
        )

    def twist(self) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) of the wheels as driven."""
        return self._wheels.twist(*self.read().wheels)

    def smallest_gap(self) -> float:
        """The smallest gap to an obstacle so far, m."""
        found = self._watch.smallest()
        return math.inf if found is None else found.gap * self._scale


def _least(robot: dict[str, Any]) -> float:
    return float(robot.get("range_min") or 0.0)
