"""The judge: runs a controller's episodes and calls, and keeps what they cost."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tdac_agent.episode import Record, run_own_loop, run_policy
from tdac_agent.errors import Fault
from tdac_agent.remote import Unit
from tdac_agent.sandbox import (
    Child,
    ControllerFault,
    ControllerTimeout,
    Limits,
    SandboxError,
    start,
)
from tdac_agent.task import Task
from tdac_agent.trajectory import Outcome, Rollout
from tdac_envs.task2d import Pose, jittered_start

JITTERS = 5
SHOWN_JITTERS = 2
CPU_SECONDS = 120


class Judge:
    """Everything a suite may ask about one controller on one task.

    Args:
        task: What the controller must do.
        source: Text of `controller.py`.
        workdir: Folder whose files the controller may read.
        tier: Sandbox tier, or `auto`.
        seed: Of the jittered starts.

    Attributes:
        tier: Name of the tier that was used.
        cpu_seconds: CPU time of all children so far.
        rollouts: Episodes by (name, steps, drive).
        fault: Why the sandbox failed, where it did.
    """

    def __init__(
        self, task: Task, source: str, workdir: Path, *, tier: str, seed: int
    ) -> None:
        self.task = task
        self.source = source
        self.tier = tier
        self.cpu_seconds = 0.0
        self.rollouts: dict[tuple[str, int | None, str], Rollout] = {}
        self.fault: str | None = None
        self._workdir = workdir
        self._seed = seed
        self._env = task.make_env()
        self._unit_child: Child | None = None
        self._fault: ControllerFault | None = None

    def unit(self) -> Unit:
        """The imported controller, for calls of its own functions.

        Raises:
            ControllerFault: It cannot be imported, or an earlier call ended it.
        """
        if self._fault is not None:
            raise self._fault.with_traceback(None)
        if self._unit_child is None:
            self._unit_child = self._load()
        return Unit(self._unit_child)

    def rollout(
        self, name: str = "nominal", *, steps: int | None = None, drive: str = "policy"
    ) -> Rollout:
        """A judged episode; a second request for the same one does not run it again.

        Args:
            name: `nominal`, or `jitter 1` … `jitter 5`.
            steps: Stop after so many steps; the horizon by default.
            drive: `policy`, or `run_episode` for the controller's own loop.
        """
        key = (name, steps, drive)
        if key not in self.rollouts:
            self.rollouts[key] = self._run(name, steps, drive)
        return self.rollouts[key]

    def close(self) -> None:
        """Ends the children."""
        if self._unit_child is not None:
            self.cpu_seconds += self._unit_child.close().cpu_seconds
            self._unit_child = None

    def start_pose(self, name: str) -> Pose:
        """Start of a named episode."""
        if name == "nominal":
            return self.task.nominal.start
        kind, _, number = name.partition(" ")
        if kind != "jitter" or not number.isdigit():
            raise ValueError(f"expected 'nominal' or 'jitter N', got {name!r}")
        random = np.random.default_rng([self._seed, int(number)])
        return jittered_start(self.task.nominal, random)

    def _load(self) -> Child:
        """A child with the controller imported; a time-out is tried once more."""
        try:
            try:
                return self._loaded_child()
            except ControllerTimeout:
                return self._loaded_child()
        except ControllerFault as fault:
            self._fault = fault
            raise

    def _loaded_child(self) -> Child:
        child = self._start()
        try:
            child.load()
        except ControllerFault:
            self.cpu_seconds += child.close().cpu_seconds
            raise
        return child

    def _run(self, name: str, steps: int | None, drive: str) -> Rollout:
        if self._fault is not None and self._fault.phase == "import":
            return self._skipped(name, "error", str(self._fault))
        if name != "nominal" and not self.rollout("nominal").reached:
            reason = "not run, since the nominal episode failed"
            return self._skipped(name, "not run", reason)
        rollout = self.drive(name, steps, drive)
        if rollout.error is not None and " did not end within " in rollout.error:
            rollout = self.drive(name, steps, drive)
        return rollout

    def drive(
        self, name: str, steps: int | None = None, drive: str = "policy"
    ) -> Rollout:
        """Runs an episode in a fresh child; arguments as for `rollout`."""
        if self.cpu_seconds >= CPU_SECONDS:
            message = f"the controller used more than {CPU_SECONDS} s of CPU time"
            return self._skipped(name, "error", message)
        limit = steps if steps is not None else self.task.nominal.horizon
        record = Record(self._env, self.start_pose(name), limit)
        child = self._start()
        try:
            if drive == "run_episode":
                seconds = child.limits.reset_seconds + 2 * limit * self.task.nominal.dt
                return run_own_loop(child, record, name, timeout=seconds)
            return run_policy(child, record, name, held_out=self._held_out(name))
        finally:
            self.cpu_seconds += child.close().cpu_seconds

    def _skipped(self, name: str, outcome: Outcome, reason: str) -> Rollout:
        record = Record(self._env, self.start_pose(name), 1)
        record.reset()
        task = self.task.nominal
        return Rollout(
            name,
            self._held_out(name),
            outcome,
            record.trajectory(),
            task.goal,
            task.robot.radius,
            task.goal_tolerance,
            error=reason,
        )

    def _held_out(self, name: str) -> bool:
        return name != "nominal" and int(name.split()[1]) > SHOWN_JITTERS

    def _start(self) -> Child:
        left = max(int(CPU_SECONDS - self.cpu_seconds), 1)
        try:
            child = start(
                self._workdir,
                self.source,
                tier=self.tier,
                limits=Limits(cpu_seconds=left),
            )
        except SandboxError as error:
            self.fault = f"the sandbox failed: {error}"
            raise Fault(self.fault) from error
        self.tier = child.tier
        return child
