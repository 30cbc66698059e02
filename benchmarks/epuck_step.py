"""Steps of TDAC-EPuck-v0 next to CartPole-v1: alone, in batches, in larger worlds.

    python -m benchmarks.epuck_step [--rounds N] [--json]

Prints how many times as fast as CartPole-v1 through `gym.make` a step is: of a single
environment in several situations, of a batch on one thread and on two, and as the
number of solid parts of a world grows. All take turns in short bursts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.env_step import (
    REFERENCE,
    Drive,
    Env,
    batch_burst,
    random_driving,
    reference,
    single_burst,
)
from benchmarks.race import Burst, Row, compared, main, race
from tdac_envs import World
from tdac_envs.footprint import Rectangle
from tdac_envs.world import EPuck, Obstacle, Part

NAME = "TDAC-EPuck-v0"
PARTS = (4, 64, 1024)
THREADS = (1, 2)


def path_driving(env: Env, count: int) -> list[Any]:
    """Actions along the shortest path, again and again from the start."""
    inner: Any = env.unwrapped
    path = inner.nominal.path_from(inner.nominal.start)
    env.reset(seed=0)
    actions: list[Any] = []
    while len(actions) < count:
        x, y, heading = inner.pose()
        nearest = int(np.argmin(np.hypot(path[:, 0] - x, path[:, 1] - y)))
        to_x, to_y = path[min(nearest + 8, len(path) - 1)]
        off = np.angle(np.exp(1j * (np.arctan2(to_y - y, to_x - x) - heading)))
        turn, ahead = np.clip(2.0 * off, -1, 1), max(0.0, 1.0 - 1.5 * abs(off))
        action = np.clip([ahead - turn, ahead + turn], -1, 1).astype(np.float32)
        actions.append(action)
        if any(env.step(action)[2:4]):
            env.reset()
    return actions


def wall_driving(_: Env, count: int) -> list[Any]:
    """Full speed into whatever is there."""
    return [np.ones(2, np.float32)] * count


SINGLE: dict[str, tuple[dict[str, Any], Drive]] = {
    "arena, random": ({}, random_driving),
    "arena, along the path": ({}, path_driving),
    "maze, along the path": ({"world": "maze"}, path_driving),
    "maze, against a wall": ({"world": "maze", "on_collision": "block"}, wall_driving),
    "maze, noise and random starts": (
        {"world": "maze", "variation": "jitter", "sensor_noise": 1.0},
        random_driving,
    ),
}


def single_rows(rounds: int) -> list[Row]:
    """A single environment through `gym.make`."""
    bursts: dict[str, Burst] = {REFERENCE: reference()}
    for name, (options, drive) in SINGLE.items():
        bursts[name] = single_burst(gym.make(NAME, **options), drive)
    return compared(race(bursts, rounds), REFERENCE)


def batch_rows(rounds: int) -> list[Row]:
    """Batches, on one thread and on more."""
    bursts: dict[str, Burst] = {REFERENCE: reference()}
    for world in ("arena", "maze"):
        for count in (1024, 4096):
            for threads in THREADS:
                name = f"{world}, {count} robots, {threads} thread{'s' * (threads > 1)}"
                bursts[name] = batch(count, world=world, threads=threads)
    return compared(race(bursts, rounds), REFERENCE)


def parts_rows(rounds: int) -> list[Row]:
    """A batch on one thread, among more and more posts, 20 cm apart."""
    bursts: dict[str, Burst] = {REFERENCE: reference()}
    for count in PARTS:
        bursts[f"{count} posts"] = batch(1024, world=posts(count), threads=1)
    return compared(race(bursts, rounds), REFERENCE)


def batch(count: int, **options: Any) -> Burst:
    """Steps of a batch with moved starts."""
    options = {"variation": "jitter", **options}
    envs = gym.make_vec(NAME, count, "vector_entry_point", **options)
    envs.reset(seed=0)
    return batch_burst(envs)


def posts(count: int) -> World:
    """A plain with so many square posts of 3 cm, in rows and columns."""
    side = round(count**0.5)
    obstacles = []
    for k in range(count):
        x, y = 0.2 * (k % side), 0.2 * (k // side)
        part = (Part(Rectangle(x, y, 0.4, 0.03, 0.03), 0.0, 0.1),)
        obstacles.append(Obstacle(f"post {k}", "Solid", x, y, part, part))
    middle = 0.2 * (side // 2) - 0.1
    start, goal = EPuck("e-puck", middle, middle, 0.0), (-0.2, -0.2)
    return World((start,), goal, obstacles=tuple(obstacles))


BENCHES: dict[str, Callable[[int], list[Row]]] = {
    "A single environment": single_rows,
    "Batches of robots": batch_rows,
    "1024 robots among more things, one thread": parts_rows,
}


if __name__ == "__main__":
    main("benchmarks.epuck_step", __doc__, BENCHES, REFERENCE)
