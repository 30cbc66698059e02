"""Drivers of the policies that run in the judge's process: learned ones, baselines."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from tdac_agent.episodes.episode import Driver
from tdac_agent.sandbox import ControllerFault
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import JudgedEnv
from tdac_agent.tasks.units import Point
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.suite.reference import steer
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.env import Observation
from tdac_envs.learning.guidance import GuidedRoute, route_to_goal
from tdac_envs.learning.seen_map import Waypoints
from tdac_envs.learning.wrappers import Frame

# Duration of a random action, s: jittering wheels would not move the robot.
HOLD = 1.0
_ARRIVED = 1e-4  # distance at which a waypoint is reached, body radii
# Bearing above which it turns on the spot, rad; gain, wheel fraction per rad.
_ON_THE_SPOT, _GAIN = 0.7, 1.2


class ReferenceDriver:
    """Drives the oracle's path by the true pose; privileged."""

    def __init__(self, env: JudgedEnv) -> None:
        self._env = env
        self._about = environment(env.nominal.env_id)
        self._path: list[Point] = []

    def reset(self, observation: Observation) -> None:  # noqa: ARG002
        """Plans from the true pose."""
        x, y, _ = self._env.pose().tolist()
        self._path = self._about.reference_path(self._env.task, x, y)[1:]

    def policy(self, observation: Observation) -> tuple[float, float]:  # noqa: ARG002
        """Wheel speeds of a turn in place, or of a straight drive."""
        x, y, heading = self._env.pose().tolist()
        task = self._env.task
        near = _ARRIVED * task.body_radius
        while len(self._path) > 1 and math.dist((x, y), self._path[0]) < near:
            self._path.pop(0)
        to_x, to_y = self._path[0]
        # `steer` expects y to point down.
        sign = -1.0 if self._about.units.up else 1.0
        pose = (x, sign * y, sign * heading)
        return steer(pose, (to_x, sign * to_y), task.full_step, task.axle_length)

    def waited(self) -> float:
        """Always 0: it runs in this process."""
        return 0.0


class SteeringDriver:
    """Drives straight at a target, whatever is in between.

    The target is the goal, or the next waypoint of the reference route if `guided`.
    """

    def __init__(self, env: JudgedEnv, *, guided: bool) -> None:
        self._env, self._guided = env, guided
        plain: Any = env
        self._frame = Frame.of(plain)
        self._route: GuidedRoute | None = None

    def reset(self, observation: Observation) -> None:  # noqa: ARG002
        """Computes the route, if it is guided."""
        if self._guided:
            plain: Any = self._env.task
            self._route = route_to_goal(plain)

    def policy(self, observation: Observation) -> tuple[float, float]:
        """Turns to the target, and drives faster the better it is aligned."""
        pose, goal = observation["pose"], observation["goal"]
        place = goal if self._route is None else self._route.ahead(pose[None])[0]
        ahead, left = self._frame.seen(pose, place).tolist()
        return _steered(ahead, left)

    def waited(self) -> float:
        """Always 0: it runs in this process."""
        return 0.0


class WaypointDriver:
    """Drives to the next point on the way that is found on a map of its own.

    With what a policy with the wrapper `waypoints` observes, and no learning.
    """

    def __init__(self, env: JudgedEnv) -> None:
        plain: Any = env
        try:
            self._env = Waypoints(plain)
        except TaskError as error:
            raise ControllerFault(str(error), "import") from error

    def reset(self, observation: Observation) -> None:
        """Does nothing: a map begins with its episode."""

    def policy(self, observation: Observation) -> tuple[float, float]:
        """Turns to the point, and drives faster the better it is aligned."""
        ahead, left = self._env.observation(observation)["waypoints"][0].tolist()
        return _steered(ahead, left)

    def waited(self) -> float:
        """Always 0: it runs in this process."""
        return 0.0


class RandomDriver:
    """Uniform wheel speeds, drawn anew every second."""

    def __init__(self, env: JudgedEnv, seed: int) -> None:
        # Independent of the generator with which the environment draws its start.
        self._random = np.random.default_rng([seed, 1])
        self._hold = max(1, round(HOLD / env.nominal.dt))
        self._calls = 0
        self._wheels = (0.0, 0.0)

    def reset(self, observation: Observation) -> None:
        """Does nothing."""

    def policy(self, observation: Observation) -> tuple[float, float]:  # noqa: ARG002
        """The wheel speeds drawn last."""
        if self._calls % self._hold == 0:
            left, right = self._random.uniform(-1.0, 1.0, 2).tolist()
            self._wheels = left, right
        self._calls += 1
        return self._wheels

    def waited(self) -> float:
        """Always 0: it runs in this process."""
        return 0.0


def _steered(ahead: float, left: float) -> tuple[float, float]:
    """Wheel speeds towards a place in the robot's frame."""
    bearing = math.atan2(left, ahead)
    turn = min(max(_GAIN * bearing, -1.0), 1.0)
    speed = max(0.0, 1.0 - abs(bearing) / _ON_THE_SPOT)
    largest = max(1.0, speed + abs(turn))
    return (speed - turn) / largest, (speed + turn) / largest


def _learned(policy: PolicySpec, env: JudgedEnv, seed: int) -> Driver:
    from tdac_agent.episodes.learned import Learned

    assert policy.file is not None
    return Learned(policy.file, policy.wrappers, env, seed)


_OURS: dict[str, Callable[[PolicySpec, JudgedEnv, int], Driver]] = {
    "reference": lambda _, env, __: ReferenceDriver(env),
    "random": lambda _, env, seed: RandomDriver(env, seed),
    "go-to-goal": lambda _, env, __: SteeringDriver(env, guided=False),
    "follow-guidance": lambda _, env, __: SteeringDriver(env, guided=True),
    "follow-waypoints": lambda _, env, __: WaypointDriver(env),
    "sb3": _learned,
}


def load(policy: PolicySpec) -> None:
    """Imports what the drivers of a policy need, for all processes that are forked."""
    if policy.kind == "sb3":
        # Without it, the driver of an episode tells what to install.
        with suppress(ImportError):
            import stable_baselines3.common.policies  # noqa: F401


def driver_of(policy: PolicySpec, env: JudgedEnv, seed: int) -> Driver:
    """Makes the driver of one episode, for a policy that runs in this process.

    Raises:
        ControllerFault: A learned policy does not fit this environment.
    """
    return _OURS[policy.kind](policy, env, seed)
