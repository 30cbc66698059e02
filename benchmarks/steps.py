"""What a step of each environment costs, next to CartPole-v1 and to doing nothing.

    python -m benchmarks steps

Each environment is stepped through `gym.make` in short bursts, in turn, its resets
included; batches count one step for each robot. Floor: an environment whose step
returns what is ready, so that Gymnasium's wrappers are all that it costs.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec

from benchmarks.env_step import CASES, random_driving
from benchmarks.peers import steppers
from benchmarks.timing import Bench, Call, Row, compared, in_turn

FLOOR, REFERENCE = "does nothing", "CartPole-v1, random"
BATCHES = (1024, 4096)


class DoesNothing(gym.Env[Any, Any]):
    """A step returns what is ready."""

    observation_space = gym.spaces.Box(-1, 1, (4,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (2,), np.float32)

    def __init__(self) -> None:
        self._ready = np.zeros(4, np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:  # noqa: ARG002
        return self._ready, {}

    def step(self, _: Any) -> Any:
        return self._ready, 0.0, False, False, {}


NOTHING = EnvSpec("DoesNothing-v0", DoesNothing)


def benches(quick: bool = False) -> list[Bench]:
    """One bench."""
    count, rounds = (50, 1) if quick else (2000, 15)
    calls: dict[str, tuple[Call, int]] = {
        FLOOR: (
            _bursts(
                gym.make(EnvSpec("DoesNothing-v0", DoesNothing)), random_driving, count
            ),
            count,
        )
    }
    for name, (arguments, drive) in CASES.items():
        calls[name] = _bursts(gym.make(**arguments), drive, count), count
    world = gym.make("TDAC-EPuck-v0")
    calls["e-puck, random"] = _bursts(world, random_driving, count), count
    for size in BATCHES[: 1 if quick else 2]:
        calls[f"maze, batch of {size}, random"] = _batch(size), size
    for name, call, steps in steppers(max(count // 20, 1)):
        calls[name] = call, steps
    rows = in_turn({name: call for name, (call, _) in calls.items()}, rounds)
    each = [_per_step(row, calls[row.case][1]) for row in rows]
    return [compared("A step", each, FLOOR, REFERENCE)]


def _bursts(env: gym.Env[Any, Any], drive: Any, count: int) -> Call:
    """A call of `count` steps, of the same actions again and again."""
    env.reset(seed=0)
    actions = cycle(drive(env, 4 * count))
    env.reset(seed=0)

    def call() -> None:
        for _ in range(count):
            _, _, terminated, truncated, _ = env.step(next(actions))
            if terminated or truncated:
                env.reset()

    return call


def _batch(size: int) -> Call:
    envs = gym.make_vec("TDAC-Map2D-v0", num_envs=size)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    return partial(envs.step, envs.action_space.sample())


def _per_step(row: Row, steps: int) -> Row:
    return replace(
        row,
        seconds=row.seconds / steps,
        fastest=row.fastest / steps,
        slowest=row.slowest / steps,
        note=f"{steps / row.fastest / 1e3:.4g} k/s",
    )
