"""How the time of a step of TDAC-Map2D-v0 grows with threads, rays and the map.

    python -m benchmarks growth

Batches on one thread and on two; one batch with few and with many rays; one robot
alone and many all over maps of growing area, with the memory that a map takes. Times
are those of one robot's step.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import cycle, islice
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from benchmarks.env_step import random_driving
from benchmarks.timing import Bench, Call, compared, in_turn

REFERENCE = "CartPole-v1"
NAME = "TDAC-Map2D-v0"
STEPS = 300
ROBOTS = 512
SIZES = (64, 1024, 4096)
RAYS = (1, 18, 72, 288)
AREAS = (0.1, 0.5, 2.0, 4.0, 16.0)

Cases = dict[str, tuple[Call, int]]


def benches(quick: bool = False) -> list[Bench]:
    """Threads, rays and area; each compared with the same of the least size."""
    rounds = 1 if quick else 40
    few = slice(0, 1 if quick else None)
    memory: dict[str, str] = {}
    return [
        _bench("Robots and threads", _threads(SIZES[few]), rounds),
        _bench("Rays, a batch of 256 on one thread", _rays(RAYS[few]), rounds),
        _bench(
            f"Area of the map: one robot, and a batch of {ROBOTS} all over it",
            _areas(AREAS[few], memory),
            rounds,
            memory,
        ),
    ]


def _bench(
    title: str, cases: Cases, rounds: int, notes: dict[str, str] | None = None
) -> Bench:
    cases = {REFERENCE: _alone(gym.make(REFERENCE)), **cases}
    rows = []
    for row in in_turn({name: call for name, (call, _) in cases.items()}, rounds):
        steps = cases[row.case][1]
        times = row.seconds / steps, row.fastest / steps, row.slowest / steps
        note = (notes or {}).get(row.case, "")
        rows.append(replace(row, **dict(zip(_TIMES, times, strict=True)), note=note))
    first = rows[1].case
    return compared(title, rows, first, REFERENCE)


_TIMES = ("seconds", "fastest", "slowest")


def _threads(sizes: tuple[int, ...]) -> Cases:
    cases: Cases = {}
    for size in sizes:
        for threads in (1, 2):
            envs = gym.make_vec(NAME, size, "vector_entry_point", threads=threads)
            envs.reset(seed=0)
            plural = "s" * (threads > 1)
            cases[f"{size} robots, {threads} thread{plural}"] = _batch(envs)
    return cases


def _rays(counts: tuple[int, ...]) -> Cases:
    cases: Cases = {}
    for count in counts:
        options = {"n_rays": count, "threads": 1, "field_of_view": 360.0}
        envs = gym.make_vec(NAME, 256, "vector_entry_point", **options)
        envs.reset(seed=0)
        cases[f"rays: {count}"] = _batch(envs)
    return cases


def _areas(areas: tuple[float, ...], memory: dict[str, str]) -> Cases:
    cases: Cases = {}
    for area in areas:
        cells = pillars(area)
        end = 56.0 + 96.0 * ((len(cells) - 80) // 96 - 1)
        options = {
            "map": cells,
            "start": (56.0, 56.0),
            "goal": (end, end),
            "on_collision": "block",
        }
        one = gym.make(NAME, **options)
        cases[f"{area:g} MPix, one"] = _alone(one)
        envs = gym.make_vec(NAME, ROBOTS, "vector_entry_point", threads=1, **options)
        scatter(envs, len(cells))
        cases[f"{area:g} MPix, all over"] = _batch(envs)
        task = one.unwrapped.nominal  # type: ignore[attr-defined]
        memory[f"{area:g} MPix, one"] = f"{bytes_of(task):.1f} bytes a pixel"
    return cases


def _alone(env: gym.Env[Any, Any]) -> tuple[Call, int]:
    """Random steps of one environment, its resets included."""
    env.reset(seed=0)
    script = cycle(random_driving(env, 10 * STEPS))

    def call() -> None:
        for action in islice(script, STEPS):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return call, STEPS


def _batch(envs: Any) -> tuple[Call, int]:
    """Random steps of a batch, which has been reset."""
    envs.action_space.seed(0)
    script = cycle([envs.action_space.sample() for _ in range(8)])
    return lambda: envs.step(next(script)), envs.num_envs


def pillars(pixels: float) -> NDArray[np.bool_]:
    """A square map of so many million pixels: pillars of 16 px, 96 px apart."""
    side = round(math.sqrt(1e6 * pixels))
    at = np.arange(side) % 96 < 16
    return at[:, None] & at[None, :]


def scatter(envs: Any, side: int) -> None:
    """Starts each robot at a random place between the pillars."""
    random, last = np.random.default_rng(0), (side - 80) // 96
    envs.reset(seed=0)
    for i in range(envs.num_envs):
        # The goal is in the last column.
        x, y = 56.0 + 96.0 * random.integers(0, (last - 1, last))
        mask = np.arange(envs.num_envs) == i
        start = (float(x), float(y), float(random.uniform(-3, 3)))
        envs.reset(options={"reset_mask": mask, "start": start})


def bytes_of(task: Any) -> float:
    """Memory of a task's arrays for each pixel of its map."""
    world = task.terrain
    arrays = (world.grid.cells, world.padded_clear, world.leaps, task.field)
    return float(sum(array.nbytes for array in arrays) / world.grid.cells.size)
