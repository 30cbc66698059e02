"""Times steps of TDAC-EPuck-v0 beside CartPole-v1: single, batches, larger worlds.

    python -m benchmarks epuck_step

Cases: a single environment through `gym.make` in several situations; a batch on one
thread and on two; worlds with more and more solid parts; and MuJoCo. The cases run in
turns, in short bursts.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.env_step import (
    ROUNDS,
    Burst,
    Drive,
    Env,
    batch_burst,
    raced,
    random_driving,
    scaled,
    single_burst,
)
from benchmarks.timing import Bench, Effort
from tdac_envs import World
from tdac_envs.physics.moved import ENGINES, EXACT, MUJOCO
from tdac_envs.worlds.footprint import Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part

NAME = "TDAC-EPuck-v0"
PARTS = (4, 64, 1024)
THREADS = (1, 2)


def path_driving(env: Env, count: int) -> list[Any]:
    """Actions along the shortest path, repeatedly from the start."""
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
    """Full speed ahead, whatever is in the way."""
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


def single(rounds: int) -> Bench:
    """A single environment through `gym.make`."""
    bursts = {
        name: single_burst(gym.make(NAME, **options), drive)
        for name, (options, drive) in SINGLE.items()
    }
    return raced("A single TDAC-EPuck-v0", bursts, rounds)


def batches(rounds: int) -> Bench:
    """Batches, on one thread and on more."""
    bursts = {}
    for world in ("arena", "maze"):
        for count in (1024, 4096):
            for threads in THREADS:
                name = f"{world}, {count} robots, {threads} thread{'s' * (threads > 1)}"
                bursts[name] = batch(count, world=world, threads=threads)
    return scaled("Batches of e-pucks", bursts, rounds)


def more_things(rounds: int) -> Bench:
    """A batch on one thread among a growing number of posts, 20 cm apart."""
    bursts = {
        f"{count} posts": batch(1024, world=posts(count), threads=1) for count in PARTS
    }
    return raced("1024 e-pucks among more things, one thread", bursts, rounds)


def physics(rounds: int) -> Bench:
    """A single environment among 20 posts, with each physics that is installed."""
    floor = Arena(Rectangle(0.4, 0.4, 0.0, 2.0, 2.0))
    world = replace(posts(20), arenas=(floor,))
    there = ENGINES if find_spec(MUJOCO) is not None else (EXACT,)
    bursts = {
        f"physics {name}": single_burst(
            gym.make(NAME, world=world, physics=name), random_driving
        )
        for name in there
    }
    return raced("A single TDAC-EPuck-v0 among 20 posts", bursts, min(rounds, 5))


def batch(count: int, **options: Any) -> Burst:
    """Steps of a batch with jittered starts."""
    options = {"variation": "jitter", **options}
    envs = gym.make_vec(NAME, count, "vector_entry_point", **options)
    envs.reset(seed=0)
    return batch_burst(envs)


def posts(count: int) -> World:
    """A plain with `count` square posts of 3 cm, in rows and columns."""
    side = round(count**0.5)
    obstacles = []
    for k in range(count):
        x, y = 0.2 * (k % side), 0.2 * (k // side)
        part = (Part(Rectangle(x, y, 0.4, 0.03, 0.03), 0.0, 0.1),)
        obstacles.append(Obstacle(f"post {k}", "Solid", x, y, part, part))
    middle = 0.2 * (side // 2) - 0.1
    start, goal = EPuck("e-puck", middle, middle, 0.0), (-0.2, -0.2)
    return World((start,), goal, obstacles=tuple(obstacles))


def benches(effort: Effort) -> list[Bench]:
    """One bench per table."""
    rounds = effort.rounds_of(ROUNDS)
    return [table(rounds) for table in (single, batches, more_things, physics)]
