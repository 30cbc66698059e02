"""Whether a mutant is harmful: judged apart from `verify`, by other code and starts."""

from __future__ import annotations

import functools
import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.independent_oracles import contract_violations
from tdac_agent.sandbox import (
    Child,
    ControllerFault,
    EnvRefusalError,
    Limits,
    start,
)
from tdac_agent.task import Task, write_workdir
from tdac_envs.map2d import Map2DEnv

SEEDS = tuple(range(7_000_001, 7_000_051))
FAILURES_ALLOWED = len(SEEDS) // 10
"""One more, and less than 90 % of the seeds succeed."""
Loop = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Judgement:
    """What the independent judge found.

    Attributes:
        reason: Why the controller is harmful, empty where it is not.
        tried: Jittered starts.
        failed: How many of them failed.
    """

    reason: str
    tried: int = 0
    failed: int = 0


class IndependentJudge:
    """Judges controllers on one task.

    Args:
        task: What they must do.
        limits: Of each child.
    """

    def __init__(self, task: Task, limits: Limits) -> None:
        self.task = task
        self.limits = limits

    def judge(self, text: str, profile: str, *, all_seeds: bool = False) -> Judgement:
        """Finds out whether a controller is harmful.

        Args:
            text: The controller.
            profile: `policy` or `paper`.
            all_seeds: Go on after the answer is certain.
        """
        with tempfile.TemporaryDirectory() as name:
            write_workdir(Path(name), self.task)
            begin = functools.partial(
                start, Path(name), text.encode(), limits=self.limits
            )
            if profile == "paper":
                reason = next(self._violations(begin, text), "")
                if reason:
                    return Judgement(reason)
            nominal = self._episode(begin, self.task.make_env(), 0)
            if nominal:
                return Judgement(f"nominal start: {nominal}")
            return self._jittered(begin, all_seeds)

    def _jittered(self, begin: Any, all_seeds: bool) -> Judgement:
        failed, last = 0, ""
        for tried, seed in enumerate(SEEDS, 1):
            env = self.task.make_env(variation="jitter")
            reason = self._episode(begin, env, seed)
            failed += bool(reason)
            last = reason or last
            good = tried - failed
            if failed > FAILURES_ALLOWED and not all_seeds:
                return Judgement(f"{failed} of {tried} starts: {last}", tried, failed)
            if good >= len(SEEDS) - FAILURES_ALLOWED and not all_seeds:
                break
        return Judgement("", tried, failed)

    def _violations(self, begin: Any, text: str) -> Iterator[str]:
        try:
            with begin() as child:
                child.load()
                yield from contract_violations(child, self.task, text)
            for loop in self._loops():
                yield from self._own_loop(begin, **loop)
        except ControllerFault as fault:
            yield f"{type(fault).__name__}: {fault}"

    def _loops(self) -> Iterator[Loop]:
        """Episodes for `run_episode`: each ends for another reason."""
        make = self.task.make_env
        yield {"env": make(), "most": 5000}
        yield {"env": make(variation="jitter"), "most": 17}
        yield {"env": make(horizon=23), "most": 60}
        yield {"env": make(variation="jitter"), "most": 25, "bumps": 3}

    def _own_loop(
        self, begin: Any, env: Map2DEnv, most: int, bumps: int = 0
    ) -> Iterator[str]:
        witness = Witness(env, most, bumps)
        with begin() as child:
            child.load()
            result = child.run_episode(witness, most, 60.0)
        yield from witness.contradictions(result)

    def _episode(self, begin: Any, env: Map2DEnv, seed: int) -> str:
        """Why an episode of `policy` failed, empty where it did not."""
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


def _wheels(child: Child, observation: Any) -> Any:
    """The answer of `policy` where it is two finite numbers."""
    answer = child.policy(observation)
    try:
        values = [float(value) for value in answer]
    except (TypeError, ValueError) as error:
        raise ControllerFault("policy: no numbers", "policy") from error
    odd = any(isinstance(value, bool | str) for value in answer)
    if odd or len(values) != 2 or not all(map(math.isfinite, values)):
        raise ControllerFault("policy: not two finite numbers", "policy")
    return np.clip(values, -1.0, 1.0)


class Witness:
    """An environment for `run_episode` that remembers what happened.

    Args:
        env: Steps.
        most: The `max_steps` that the controller was given.
        bumps: Collisions that the environment has counted before.
    """

    def __init__(self, env: Map2DEnv, most: int, bumps: int) -> None:
        self.env, self.most, self.bumps = env, most, bumps
        self.positions: list[Any] = []
        self.speeds: list[float] = []
        self.collisions = bumps
        self.over = False

    def reset(self) -> Any:
        if self.positions:
            raise EnvRefusalError("a second reset()")
        observation, info = self.env.reset(seed=SEEDS[0])
        self.positions.append(observation["pose"][:2])
        return observation, {**info, "collisions": self.bumps}

    def step(self, action: Any) -> Any:
        if self.over or len(self.speeds) >= self.most or not self.positions:
            raise EnvRefusalError("a step before the beginning or after the end")
        wheels = np.clip(np.asarray(action, float), -1.0, 1.0)
        observation, reward, terminated, truncated, info = self.env.step(wheels)
        self.over = terminated or truncated
        self.positions.append(observation["pose"][:2])
        robot = self.env.nominal.robot
        self.speeds.append(float(wheels.mean()) * robot.max_wheel_speed)
        self.collisions = info["collisions"] + self.bumps
        info = {**info, "collisions": self.collisions}
        return observation, reward, terminated, truncated, info

    def contradictions(self, told: Any) -> Iterator[str]:
        """What of a returned dict is not what happened."""
        if not self.over and len(self.speeds) < self.most:
            yield f"run_episode ended after {len(self.speeds)} steps"
        task = self.env.nominal
        if type(told) is not dict:
            yield f"run_episode returned a {type(told).__name__}"
            return
        wanted = {
            "positions": (self.positions, 0.01),
            "speeds": (self.speeds, 0.01),
            "goal": (task.goal, 1e-3),
            "dt": (task.dt, 1e-9),
            "collisions": (self.collisions, 0.0),
        }
        for key, (value, slack) in wanted.items():
            try:
                found = np.asarray(told[key], float)
            except (KeyError, TypeError, ValueError):
                yield f"run_episode: {key} is missing or no numbers"
                continue
            true = np.asarray(value, float)
            if found.shape != true.shape or np.abs(found - true).max() > slack:
                yield f"run_episode: {key} is not what happened"
        if type(told.get("collisions")) is not int:
            yield "run_episode: collisions is not an int"
