"""One judged episode: the environment steps, the controller only answers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Outcome, Rollout, Trajectory
from tdac_agent.sandbox import (
    Child,
    ControllerFault,
    ControllerTimeout,
    EnvRefusalError,
)
from tdac_agent.sandbox.waiting import Line
from tdac_agent.storage.plain import shown
from tdac_agent.tasks.setting import JudgedEnv
from tdac_envs.drive.env import Observation
from tdac_envs.drive.task import Pose

# A policy is cut off when its mean call is this many times too slow.
SLOW_FACTOR = 2.0
SLOW_AFTER_CALLS = 50
LARGEST = 1e30


class Driver(Protocol):
    """What answers observations: a `Child`, or a policy of ours in this process."""

    def reset(self, observation: Observation) -> object:
        """Take the first observation of an episode."""

    def policy(self, observation: Observation) -> Any:
        """Return what should be wheel speeds."""

    def waited(self) -> float:
        """Return for how many seconds it has stood in line for a CPU so far."""


@dataclass(slots=True)
class Record:
    """Steps an environment and writes down what happened.

    Attributes:
        env: The judge's environment.
        start: Start pose; None for the one that the environment draws.
        max_steps: Steps after which the episode is stopped.
        truncates: Whether the last step says `truncated`; else the controller has to
            know its `max_steps`.
        collisions_before: Collisions that are counted when the episode begins.
        seed: Of the environment's random numbers.
    """

    env: JudgedEnv
    start: Pose | None
    max_steps: int
    truncates: bool = False
    collisions_before: int = 0
    seed: int | None = None
    outcome: Outcome | None = None
    _poses: list[NDArray[np.float64]] = field(default_factory=list)
    _actions: list[NDArray[np.float32]] = field(default_factory=list)
    _distances: list[float] = field(default_factory=list)
    _ranges: list[NDArray[np.float32]] = field(default_factory=list)
    _rooms: list[float] = field(default_factory=list)
    _collisions: int = 0

    def reset(self) -> tuple[Observation, dict[str, Any]]:
        """Puts the robot on its start; a second reset is refused.

        Raises:
            EnvRefusalError: The episode is under way.
        """
        if self._poses:
            raise EnvRefusalError("reset() is allowed once, at the beginning")
        options = None if self.start is None else {"start": self.start}
        observation, info = self.env.reset(seed=self.seed, options=options)
        return observation, self._note(observation, info)

    def step(
        self, action: Any
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Steps once.

        Raises:
            EnvRefusalError: Before reset, after the end, or no two finite numbers.
        """
        if not self._poses:
            raise EnvRefusalError("step() before reset()")
        if self.outcome is not None:
            raise EnvRefusalError("step() after the episode ended")
        wheels = as_wheels(action)
        if wheels is None:
            raise EnvRefusalError(wrong_action(action))
        observation, reward, terminated, truncated, info = self.env.step(wheels)
        self._actions.append(wheels)
        info = self._note(observation, info)
        if info["collision"]:
            self.outcome = "collision"
        elif info["is_success"]:
            self.outcome = "reached"
        elif truncated:
            self.outcome = "out of time"
        elif len(self._actions) >= self.max_steps:
            self.outcome = "stopped"
            truncated = self.truncates
        return observation, reward, terminated, truncated, info

    def trajectory(self) -> Trajectory:
        """What was recorded so far."""
        return Trajectory(
            np.array(self._poses, np.float64).reshape(-1, 3),
            np.array(self._actions, np.float32).reshape(-1, 2).clip(-1.0, 1.0),
            np.array(self._distances, np.float64),
            np.array(self._ranges, np.float32),
            self._collisions,
            self.env.nominal.dt,
        )

    def rooms(self) -> NDArray[np.float64]:
        """Distance from the robot's centre to what is solid, as `Rollout` has it."""
        return np.array(self._rooms, np.float64)

    def _note(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        """Writes a moment down; returns what the controller may know of it."""
        self._poses.append(self.env.pose())
        self._distances.append(info["path_distance"])
        self._ranges.append(observation[self.env.readings])
        self._rooms.append(info["clearance"])
        self._collisions = self.collisions_before + info["collisions"]
        return {**info, "collisions": self._collisions}


def as_wheels(action: Any) -> NDArray[np.float32] | None:
    """An answer of `policy` as two finite numbers, or None where it is not that."""
    if type(action) is tuple and len(action) == 2:
        left, right = action
        if type(left) is float and type(right) is float:
            finite = abs(left) < LARGEST and abs(right) < LARGEST
            return np.array(action, np.float32) if finite else None
    if isinstance(action, np.ndarray):
        if action.shape != (2,) or action.dtype.kind not in "fiu":
            return None
        action = action.tolist()
    if not isinstance(action, tuple | list) or len(action) != 2:
        return None
    for value in action:
        number = isinstance(value, int | float | np.integer | np.floating)
        if not number or isinstance(value, bool):
            return None
    try:
        wheels = np.array([float(value) for value in action])
    except OverflowError:
        return None
    return wheels.astype(np.float32) if np.abs(wheels).max() < LARGEST else None


def wrong_action(action: Any) -> str:
    """Says what is wrong with an answer of `policy`, in bounded length."""
    return f"policy must return two finite numbers (left, right), got {shown(action)}"


def run_policy(
    child: Driver, record: Record, name: str, *, held_out: bool, deadline: float
) -> Rollout:
    """Drives an episode by `policy(obs)`.

    Args:
        child: With the controller imported, or a policy of ours.
        record: Steps the environment.
        name: Of the episode.
        held_out: Whether feedback may tell only pass or fail of it.
        deadline: When to stop at the latest, by `time.monotonic`.
    """
    calls: list[float] = []
    own = Line("thread-self")

    def kept_waiting() -> float:
        # On a starved machine this process, too, gets a CPU long after an answer.
        return child.waited() + own.waited()

    waited = 0.0
    error: str | ControllerFault | EnvRefusalError | None = None
    try:
        observation, _ = record.reset()
        child.reset(observation)
        waited = kept_waiting()
        while record.outcome is None:
            began = time.perf_counter()
            action = child.policy(observation)
            calls.append(time.perf_counter() - began)
            observation = record.step(action)[0]
            error = _too_slow(calls, record.env.nominal.dt, kept_waiting, waited)
            if time.monotonic() > deadline:
                error = "stopped: the verification as a whole took too long"
            if error is not None:
                break
    except (ControllerFault, EnvRefusalError) as fault:
        error = fault
    mean = _mean_call(calls, kept_waiting, waited)
    return _rollout(record, name, held_out, error, calls, mean)


def run_own_loop(
    child: Child, record: Record, name: str, *, timeout: float, deadline: float
) -> Rollout:
    """Lets the controller's `run_episode` step the judge's environment.

    Its `max_steps` is out of reach where the environment itself truncates.

    Args:
        child: With the controller imported.
        record: Steps the environment.
        name: Of the episode.
        timeout: Seconds that the controller itself may take.
        deadline: When to stop at the latest, by `time.monotonic`.
    """
    max_steps = 2 * record.max_steps if record.truncates else record.max_steps
    error: str | ControllerFault | None = None
    returned = None
    try:
        returned = child.run_episode(record, max_steps, timeout, deadline)
    except ControllerFault as fault:
        error = fault
    if error is None and record.outcome is None:
        error = _ended_early(record, max_steps)
    return _rollout(record, name, False, error, returned=returned)


def not_driven(record: Record, name: str, fault: ControllerFault) -> Rollout:
    """The episode of a controller that cannot be imported."""
    record.reset()
    return _rollout(record, name, False, fault)


def _ended_early(record: Record, max_steps: int) -> str:
    done = record.trajectory().steps
    return (
        f"run_episode returned after {done} steps, before the episode ended "
        f"and before max_steps = {max_steps}"
    )


def _too_slow(
    calls: list[float], dt: float, kept_waiting: Callable[[], float], waited: float
) -> str | None:
    if len(calls) < SLOW_AFTER_CALLS or len(calls) % SLOW_AFTER_CALLS:
        return None
    if math.fsum(calls) <= SLOW_FACTOR * dt * len(calls):
        return None
    mean = _mean_call(calls, kept_waiting, waited)
    if mean <= SLOW_FACTOR * dt:
        return None
    return f"policy takes {1000 * mean:.0f} ms a call, {1000 * dt:.0f} ms are allowed"


def _mean_call(
    calls: list[float], kept_waiting: Callable[[], float], waited: float
) -> float:
    """Seconds of a call, without what was stood in line for a CPU.

    Args:
        calls: Seconds of each.
        kept_waiting: Seconds that policy and judge have stood in line so far.
        waited: The same before the first call.
    """
    line = max(0.0, kept_waiting() - waited)
    return max(0.0, math.fsum(calls) - line) / max(1, len(calls))


def late(times: NDArray[np.float64]) -> float:
    """99th percentile; `np.percentile` loads more than all else here takes."""
    last = len(times) - 1
    return float(np.interp(0.99 * last, np.arange(last + 1), np.sort(times)))


def _rollout(
    record: Record,
    name: str,
    held_out: bool,
    error: str | Exception | None,
    calls: Sequence[float] = (),
    mean_call: float = 0.0,
    returned: Any = None,
) -> Rollout:
    times = 1000 * np.array(calls) if calls else np.zeros(1)
    task = record.env.nominal
    slow = mean_call > task.dt
    return Rollout(
        name=name,
        held_out=held_out,
        outcome="error" if error is not None else record.outcome or "stopped",
        trajectory=record.trajectory(),
        goal=task.goal,
        radius=task.body_radius,
        tolerance=task.goal_tolerance,
        error=None if error is None else str(error),
        call_ms=(1000 * mean_call, late(times)),
        returned=returned,
        rooms=record.rooms(),
        calls=np.array(calls, np.float64),
        timed_out=isinstance(error, ControllerTimeout) or slow,
        may_pass=slow or (isinstance(error, ControllerFault) and error.may_pass),
    )
