"""Judges whether a mutant is harmful, independently of `verify`'s code and starts."""

from __future__ import annotations

import functools
import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.ground import Ground
from benchmarks.witness import Witness
from tdac_agent.sandbox import Child, ControllerFault, Limits
from tdac_agent.tasks.setting import JudgedEnv
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.verification.judge.child_pool import ChildPool

Loop = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Judgement:
    """The independent judge's result.

    Attributes:
        reason: Why the controller is harmful; empty if it is not.
        tried: Number of jittered starts.
        failed: Number of starts that failed.
    """

    reason: str
    tried: int = 0
    failed: int = 0


class IndependentJudge:
    """Judges controllers in one setup.

    Args:
        ground: The setup.
        task: The task of the controllers.
        limits: Limits of each child.
    """

    def __init__(self, ground: Ground, task: Task, limits: Limits) -> None:
        self.ground = ground
        self.task = task
        self.limits = limits

    def judge(self, text: str, profile: str, *, all_seeds: bool = False) -> Judgement:
        """Judges whether a controller is harmful.

        Args:
            text: Source of the controller.
            profile: `policy` or `paper`.
            all_seeds: Whether to continue after the result is certain.
        """
        with tempfile.TemporaryDirectory() as name:
            write_workdir(Path(name), self.task)
            begin = functools.partial(self._child, Path(name), text.encode())
            if profile == "paper":
                reason = next(self._violations(begin, text), "")
                if reason:
                    return Judgement(reason)
            nominal = self._episode(begin, self.task.make_env(), 0)
            if nominal:
                return Judgement(f"nominal start: {nominal}")
            return self._jittered(begin, all_seeds)

    def _child(self, workdir: Path, source: bytes) -> Child:
        child = _child_pool().take("auto", self.limits)
        child.copy_files(workdir, source)
        return child

    def _jittered(self, begin: Any, all_seeds: bool) -> Judgement:
        failed, last = 0, ""
        starts, allowed = self.ground.starts, self.ground.failures_allowed
        for tried, seed in enumerate(starts, 1):
            env = self.task.make_env(variation="jitter")
            reason = self._episode(begin, env, seed)
            failed += bool(reason)
            last = reason or last
            good = tried - failed
            if failed > allowed and not all_seeds:
                return Judgement(f"{failed} of {tried} starts: {last}", tried, failed)
            if good >= len(starts) - allowed and not all_seeds:
                break
        return Judgement("", tried, failed)

    def _violations(self, begin: Any, text: str) -> Iterator[str]:
        try:
            with begin() as child:
                child.load()
                yield from self.ground.violations(child, self.task, text)
            for loop in self._loops():
                yield from self._own_loop(begin, **loop)
        except ControllerFault as fault:
            yield f"{type(fault).__name__}: {fault}"

    def _loops(self) -> Iterator[Loop]:
        """Episodes for `run_episode`, each with a different cause of its end."""
        make = self.task.make_env
        yield {"env": make(), "most": 5000}
        yield {"env": make(variation="jitter"), "most": 17}
        yield {"env": make(horizon=23), "most": 60}
        yield {"env": make(variation="jitter"), "most": 25, "bumps": 3}

    def _own_loop(
        self, begin: Any, env: JudgedEnv, most: int, bumps: int = 0
    ) -> Iterator[str]:
        witness = Witness(env, most, bumps, self.task.setting.units)
        with begin() as child:
            child.load()
            result = child.run_episode(witness, most, 60.0)
        yield from witness.contradictions(result)

    def _episode(self, begin: Any, env: JudgedEnv, seed: int) -> str:
        """Why an episode of `policy` failed; empty if it succeeded."""
        observation, _ = env.reset(seed=seed)
        seconds, steps = 0.0, 0
        try:
            with begin() as child:
                child.load()
                child.reset(observation)
                while True:
                    began = time.perf_counter()
                    wheels = _wheels(child, observation)
                    seconds += time.perf_counter() - began
                    steps += 1
                    observation, _, terminated, truncated, info = env.step(wheels)
                    if terminated or truncated:
                        break
        except ControllerFault as fault:
            return f"{type(fault).__name__}: {fault}"
        if not info["is_success"]:
            return "collision" if info["collision"] else "out of time"
        slow = seconds / steps > 2 * self.task.nominal.dt
        return "too slow" if slow else ""


@functools.cache
def _child_pool() -> ChildPool:
    """The child pool of this process; it ends with the process."""
    child_pool = ChildPool()
    Finalize(None, child_pool.close, exitpriority=1)
    return child_pool


def _wheels(child: Child, observation: Any) -> Any:
    """The answer of `policy`, clipped; a fault unless it is two finite numbers."""
    answer = child.policy(observation)
    try:
        values = [float(value) for value in answer]
    except (TypeError, ValueError) as error:
        raise ControllerFault("policy: no numbers", "policy") from error
    odd = any(isinstance(value, bool | str) for value in answer)
    if odd or len(values) != 2 or not all(map(math.isfinite, values)):
        raise ControllerFault("policy: not two finite numbers", "policy")
    return np.clip(values, -1.0, 1.0)
