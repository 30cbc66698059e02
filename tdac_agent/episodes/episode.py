"""A judged episode: the judge steps the environment, the controller only answers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Contact, Outcome, Rollout, Trajectory
from tdac_agent.sandbox import (
    Child,
    ControllerFault,
    ControllerTimeout,
    EnvRefusalError,
)
from tdac_agent.sandbox.waiting import RunQueue
from tdac_agent.storage.plain import shown
from tdac_agent.tasks.setting import JudgedEnv
from tdac_envs.drive.env import Observation
from tdac_envs.drive.gap_search import GapWatch
from tdac_envs.drive.smallest_gap import SmallestGap
from tdac_envs.drive.task import AT_START, Pose

# An episode is stopped if the mean policy call takes longer than this many steps.
SLOW_FACTOR = 2.0
SLOW_AFTER_CALLS = 50
LARGEST = 1e30


class Driver(Protocol):
    """A policy: a controller in a `Child`, or a trusted policy in this process."""

    def reset(self, observation: Observation) -> object:
        """Receives the first observation of an episode."""

    def policy(self, observation: Observation) -> Any:
        """Returns an unchecked action, which should be two wheel speeds."""

    def waited(self) -> float:
        """Returns its total run-queue wait time, s."""


@dataclass(slots=True)
class Record:
    """Steps an environment and records the episode.

    Attributes:
        env: The judge's environment.
        start: Start pose; None to let the environment draw it.
        max_steps: Steps after which the episode is stopped.
        truncates: Whether the last of these steps returns `truncated`; otherwise the
            controller must stop after `max_steps` itself.
        collisions_before: Initial value of the collision counter.
        seed: Seed of the environment.
        options: Options of the environment's `reset`, instead of a start.
        seen: What the policy observes of an observation; see `Setting.seen`.
    """

    env: JudgedEnv
    start: Pose | None
    max_steps: int
    truncates: bool = False
    collisions_before: int = 0
    seed: int | None = None
    options: dict[str, Any] | None = None
    seen: Callable[[Observation], Observation] | None = None
    outcome: Outcome | None = None
    contact: Contact | None = None
    _poses: list[NDArray[np.float64]] = field(default_factory=list)
    _actions: list[NDArray[np.float32]] = field(default_factory=list)
    _distances: list[float] = field(default_factory=list)
    _ranges: list[NDArray[np.float32]] = field(default_factory=list)
    _rooms: list[float] = field(default_factory=list)
    _movers: list[NDArray[np.float32]] = field(default_factory=list)
    _has_movers: bool = True
    _collisions: int = 0
    _watch: GapWatch | None = None

    def reset(self) -> tuple[Observation, dict[str, Any]]:
        """Starts the episode.

        Raises:
            EnvRefusalError: It was called before.
        """
        if self._poses:
            raise EnvRefusalError("reset() is allowed once, at the beginning")
        options = self.options
        if self.start is not None:
            options = {"start": self.start}
        observation, info = self.env.reset(seed=self.seed, options=options)
        self._watch = self.env.watch_gap()
        info = self._note(observation, info)
        seen = {key: info[key] for key in info if key not in AT_START}
        return self._shown(observation), seen

    def step(
        self, action: Any
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advances the episode by one step.

        Raises:
            EnvRefusalError: The episode is not running, or the action is invalid.
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
        return self._shown(observation), reward, terminated, truncated, info

    def trajectory(self) -> Trajectory:
        """Returns the record so far."""
        return Trajectory(
            np.array(self._poses, np.float64).reshape(-1, 3),
            np.array(self._actions, np.float32).reshape(-1, 2).clip(-1.0, 1.0),
            np.array(self._distances, np.float64),
            np.array(self._ranges, np.float32),
            self._collisions,
            self.env.nominal.dt,
            self._all_movers(),
        )

    def _all_movers(self) -> NDArray[np.float32] | None:
        """The movers so far; None without movers."""
        if not self._movers or not len(self._movers[0]):
            return None
        return np.array(self._movers, np.float32)

    def rooms(self) -> NDArray[np.float64]:
        """Returns the clearances so far; see `Rollout.rooms`."""
        return np.array(self._rooms, np.float64)

    def smallest_gap(self) -> SmallestGap | None:
        """Returns the smallest gap so far; None before the first step."""
        if self._watch is None or not self._actions:
            return None
        return self._watch.smallest()

    def close_gap(self) -> SmallestGap | None:
        """Returns the smallest gap so far that was too close; None without any."""
        return None if self._watch is None else self._watch.too_close()

    def _shown(self, observation: Observation) -> Observation:
        return observation if self.seen is None else self.seen(observation)

    def _note(self, observation: Observation, info: dict[str, Any]) -> dict[str, Any]:
        """Records a moment; returns the `info` that the controller may see."""
        self._poses.append(self.env.pose())
        self._distances.append(info["path_distance"])
        self._ranges.append(observation[self.env.readings])
        self._rooms.append(info["clearance"])
        assert self._watch is not None
        self._watch.note()
        self.contact = info.get("contact") or self.contact
        if self._has_movers:
            discs = self.env.discs()
            self._movers.append(discs.astype(np.float32))
            self._has_movers = len(discs) > 0
        self._collisions = self.collisions_before + info["collisions"]
        return {**info, "collisions": self._collisions}


def as_wheels(action: Any) -> NDArray[np.float32] | None:
    """Returns an action as two finite numbers; None if it is something else."""
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
    """Returns the error message for a wrong action, in bounded length."""
    return f"policy must return two finite numbers (left, right), got {shown(action)}"


def run_policy(
    child: Driver, record: Record, name: str, *, held_out: bool, deadline: float
) -> Rollout:
    """Drives an episode with `policy(obs)`.

    Args:
        child: Child with the controller imported, or a trusted policy.
        record: Record that steps the environment.
        name: Name of the episode.
        held_out: Whether feedback may reveal only pass or fail.
        deadline: Latest time to stop, on the clock `time.monotonic`.
    """
    calls: list[float] = []
    own = RunQueue("thread-self")

    def wait_time() -> float:
        # On a busy machine this process, too, waits for a CPU after an answer.
        return child.waited() + own.waited()

    waited = 0.0
    error: str | ControllerFault | EnvRefusalError | None = None
    try:
        observation, _ = record.reset()
        child.reset(observation)
        waited = wait_time()
        while record.outcome is None:
            began = time.perf_counter()
            action = child.policy(observation)
            calls.append(time.perf_counter() - began)
            observation = record.step(action)[0]
            error = _too_slow(calls, record.env.nominal.dt, wait_time, waited)
            if time.monotonic() > deadline:
                error = "stopped: the verification as a whole took too long"
            if error is not None:
                break
    except (ControllerFault, EnvRefusalError) as fault:
        error = fault
    mean = _mean_call(calls, wait_time, waited)
    return _rollout(record, name, held_out, error, calls, mean)


def run_own_loop(
    child: Child, record: Record, name: str, *, timeout: float, deadline: float
) -> Rollout:
    """Lets the controller's `run_episode` step the judge's environment.

    If the environment truncates, `max_steps` is too large to be reached.

    Args:
        child: Child with the controller imported.
        record: Record that steps the environment.
        name: Name of the episode.
        timeout: Time limit of the controller itself, s.
        deadline: Latest time to stop, on the clock `time.monotonic`.
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
    """Returns the episode of a controller that cannot be imported."""
    record.reset()
    return _rollout(record, name, False, fault)


def _ended_early(record: Record, max_steps: int) -> str:
    done = record.trajectory().steps
    return (
        f"run_episode returned after {done} steps, before the episode ended "
        f"and before max_steps = {max_steps}"
    )


def _too_slow(
    calls: list[float], dt: float, wait_time: Callable[[], float], waited: float
) -> str | None:
    if len(calls) < SLOW_AFTER_CALLS or len(calls) % SLOW_AFTER_CALLS:
        return None
    if math.fsum(calls) <= SLOW_FACTOR * dt * len(calls):
        return None
    mean = _mean_call(calls, wait_time, waited)
    if mean <= SLOW_FACTOR * dt:
        return None
    return f"policy takes {1000 * mean:.0f} ms a call, {1000 * dt:.0f} ms are allowed"


def _mean_call(
    calls: list[float], wait_time: Callable[[], float], waited: float
) -> float:
    """Returns the mean duration of a call without run-queue wait time, s."""
    in_queue = max(0.0, wait_time() - waited)
    return max(0.0, math.fsum(calls) - in_queue) / max(1, len(calls))


def late(times: NDArray[np.float64]) -> float:
    """Returns the 99th percentile, without the slow imports of `np.percentile`."""
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
    task = record.env.task
    slow = mean_call > task.dt and not isinstance(error, Exception)
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
        contact=record.contact,
        smallest_gap=record.smallest_gap(),
        close_gap=record.close_gap(),
        required_gap=record.env.required_gap,
        timed_out=isinstance(error, ControllerTimeout) or slow,
        is_retryable=slow
        or (isinstance(error, ControllerFault) and error.is_retryable),
    )
