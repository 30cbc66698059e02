"""Who may drive in an evaluation: controllers, learned policies, and four of ours."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tdac_agent.episodes.episode import Driver
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import JudgedEnv
from tdac_agent.verification.suite.reference import Point, steer
from tdac_envs.drive.env import Observation
from tdac_envs.learning.guidance import Route, route_to_goal
from tdac_envs.learning.wrappers import Frame

Kind = Literal[
    "controller", "sb3", "reference", "random", "go-to-goal", "follow-guidance"
]
# A random action is kept for so long, s: wheels that tremble lead nowhere.
HOLD = 1.0
_ARRIVED = 1e-4  # of the body's radius
# Bearing at which one turns on the spot, rad, and wheel fraction for each rad.
_ON_THE_SPOT, _GAIN = 0.7, 1.2


@dataclass(frozen=True, slots=True)
class Contender:
    """A policy, as a job names it.

    Attributes:
        kind: What it is.
        file: Of a controller, or of a policy of stable-baselines3.
        wrappers: Names of the wrappers that such a policy sees the world through.
    """

    kind: Kind
    file: Path | None = None
    wrappers: tuple[str, ...] = ()

    @property
    def knows(self) -> str:
        """What it may know: `sensors` (with pose and goal), and what beside them."""
        if self.kind == "controller":
            return "+ map"
        if self.kind == "follow-guidance" or "guidance" in self.wrappers:
            return "+ guidance"
        if self.kind == "reference":
            return "privileged"
        return "nothing" if self.kind == "random" else "sensors"


class Reference:
    """Drives the oracle's path on the true pose; privileged.

    Args:
        env: Of the episode.
    """

    def __init__(self, env: JudgedEnv) -> None:
        self._env = env
        self._about = environment(env.nominal.env_id)
        self._path: list[Point] = []

    def reset(self, observation: Observation) -> None:  # noqa: ARG002
        """Plans from where the robot really is."""
        x, y, _ = self._env.pose().tolist()
        self._path = self._about.reference_path(self._env.task, x, y)[1:]

    def policy(self, observation: Observation) -> tuple[float, float]:  # noqa: ARG002
        """A turn in place, or a straight drive."""
        x, y, heading = self._env.pose().tolist()
        task = self._env.task
        near = _ARRIVED * task.body_radius
        while len(self._path) > 1 and math.dist((x, y), self._path[0]) < near:
            self._path.pop(0)
        to_x, to_y = self._path[0]
        # Steering is told with y down.
        sign = -1.0 if self._about.units.up else 1.0
        pose = (x, sign * y, sign * heading)
        return steer(pose, (to_x, sign * to_y), task.full_step, task.axle_length)

    def waited(self) -> float:
        """It waits for nothing."""
        return 0.0


class Steered:
    """Drives at a place that it is told in each step, whatever is in between.

    Args:
        env: Of the episode.
        guided: Whether that is the next way-point of the reference route; else it is
            the goal.
    """

    def __init__(self, env: JudgedEnv, *, guided: bool) -> None:
        self._env, self._guided = env, guided
        plain: Any = env
        self._frame = Frame.of(plain)
        self._route: Route | None = None

    def reset(self, observation: Observation) -> None:  # noqa: ARG002
        """Has the route computed."""
        if self._guided:
            plain: Any = self._env.task
            self._route = route_to_goal(plain)

    def policy(self, observation: Observation) -> tuple[float, float]:
        """Turns to the place, and drives the faster the better it is aligned."""
        pose, goal = observation["pose"], observation["goal"]
        place = goal if self._route is None else self._route.ahead(pose[None])[0]
        ahead, left = self._frame.seen(pose, place).tolist()
        bearing = math.atan2(left, ahead)
        turn = min(max(_GAIN * bearing, -1.0), 1.0)
        speed = max(0.0, 1.0 - abs(bearing) / _ON_THE_SPOT)
        largest = max(1.0, speed + abs(turn))
        return (speed - turn) / largest, (speed + turn) / largest

    def waited(self) -> float:
        """It waits for nothing."""
        return 0.0


class Random:
    """Uniform wheel speeds, drawn anew every second.

    Args:
        env: Of the episode.
        seed: Of the episode.
    """

    def __init__(self, env: JudgedEnv, seed: int) -> None:
        # Not the numbers that the environment draws its start from.
        self._dice = np.random.default_rng([seed, 1])
        self._hold = max(1, round(HOLD / env.nominal.dt))
        self._calls = 0
        self._wheels = (0.0, 0.0)

    def reset(self, observation: Observation) -> None:
        """Needs to know nothing."""

    def policy(self, observation: Observation) -> tuple[float, float]:  # noqa: ARG002
        """The wheel speeds drawn last."""
        if self._calls % self._hold == 0:
            left, right = self._dice.uniform(-1.0, 1.0, 2).tolist()
            self._wheels = left, right
        self._calls += 1
        return self._wheels

    def waited(self) -> float:
        """It waits for nothing."""
        return 0.0


def _learned(contender: Contender, env: JudgedEnv) -> Driver:
    from tdac_agent.episodes.learned import Learned

    assert contender.file is not None
    return Learned(contender.file, contender.wrappers, env)


_OURS: dict[str, Callable[[Contender, JudgedEnv, int], Driver]] = {
    "reference": lambda _, env, __: Reference(env),
    "random": lambda _, env, seed: Random(env, seed),
    "go-to-goal": lambda _, env, __: Steered(env, guided=False),
    "follow-guidance": lambda _, env, __: Steered(env, guided=True),
    "sb3": lambda contender, env, _: _learned(contender, env),
}


def driver_of(contender: Contender, env: JudgedEnv, seed: int) -> Driver:
    """A driver for one episode of a contender that runs in this process.

    Raises:
        ControllerFault: A learned policy cannot be used in this environment.
    """
    return _OURS[contender.kind](contender, env, seed)
