"""Steps of TDAC-Map2D-v0 next to CartPole-v1: alone, in batches, and as they grow.

    python -m benchmarks.env_step [--rounds N] [--json]

Prints how many times as fast as CartPole-v1 through `gym.make` a step is: of a single
environment in several situations, of a batch on one thread and on two; then how the
time grows with the area of the map and with the number of rays, and what the map's
arrays take for each pixel. All take turns in short bursts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import cycle, islice
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import tdac_envs  # noqa: F401 - registers the env
from benchmarks.race import Burst, Row, compared, main, race

Actions = list[Any]
Env = gym.Env[Any, Any]

REFERENCE = "CartPole-v1"
NAME = "TDAC-Map2D-v0"
STEPS = 300
ROBOTS = 512
AREAS = (0.1, 0.5, 2.0, 4.0, 16.0)
RAYS = (1, 18, 72, 288)


class DoNothing(gym.Env[int, Any]):
    """What Gymnasium's own wrappers cost: the floor."""

    observation_space = gym.spaces.Discrete(2)
    action_space = gym.spaces.Discrete(2)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        super().reset(seed=seed, options=options)
        return 0, {}

    def step(self, _: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        return 0, 0.0, False, False, {}


def random_driving(env: Env, count: int) -> Actions:
    """Uniform random actions."""
    env.action_space.seed(0)
    return [env.action_space.sample() for _ in range(count)]


def path_driving(env: Env, count: int) -> Actions:
    """Actions that drive along the shortest path, without a contact."""
    task = env.unwrapped.nominal  # type: ignore[attr-defined]
    path = task.path_from(task.start)
    env.reset(seed=0)
    actions: Actions = []
    while len(actions) < count:
        action = steer(env.unwrapped.pose(), path)  # type: ignore[attr-defined]
        actions.append(action)
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return actions


def steer(pose: NDArray[np.float64], path: NDArray[np.float64]) -> Any:
    """Wheels towards the path point 12 px ahead of the nearest one."""
    x, y, heading = pose
    nearest = int(np.argmin(np.hypot(path[:, 0] - x, path[:, 1] - y)))
    to_x, to_y = path[min(nearest + 12, len(path) - 1)]
    error = math.remainder(math.atan2(to_y - y, to_x - x) - heading, 2 * math.pi)
    turn = max(-1.0, min(1.0, 2.0 * error))
    ahead = max(0.0, 1.0 - 1.5 * abs(error))
    return np.clip([ahead + turn, ahead - turn], -1, 1).astype(np.float32)


def wall_driving(_: Env, count: int) -> Actions:
    """Full speed into whatever is there."""
    return [np.ones(2, np.float32)] * count


Drive = Callable[[Env, int], Actions]
SINGLE: dict[str, tuple[dict[str, Any], Drive]] = {
    "maze, random": ({}, random_driving),
    "maze, along the path": ({}, path_driving),
    "maze, against a wall": ({"on_collision": "block"}, wall_driving),
}


def single_burst(env: Env, drive: Drive) -> Burst:
    """Some steps of one environment, with resets where an episode ends."""
    env.reset(seed=0)
    script = cycle(drive(env, 10 * STEPS))
    env.reset(seed=0)

    def burst() -> int:
        for action in islice(script, STEPS):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return STEPS

    return burst


def reference() -> Burst:
    """CartPole-v1 with random actions."""
    return single_burst(gym.make(REFERENCE), random_driving)


def batch_burst(envs: Any, steps: int = 1) -> Burst:
    """Some steps of a batch, which has been reset."""
    envs.action_space.seed(0)
    script = cycle([envs.action_space.sample() for _ in range(8)])

    def burst() -> int:
        for action in islice(script, steps):
            envs.step(action)
        return int(steps * envs.num_envs)

    return burst


def single_rows(rounds: int) -> list[Row]:
    """A single environment through `gym.make`."""
    floor = gym.make(gym.envs.registration.EnvSpec("Floor-v0", entry_point=DoNothing))
    bursts = {REFERENCE: reference(), "nothing": single_burst(floor, random_driving)}
    for name, (options, drive) in SINGLE.items():
        bursts[name] = single_burst(gym.make(NAME, **options), drive)
    return compared(race(bursts, rounds), REFERENCE)


def batch_rows(rounds: int) -> list[Row]:
    """Batches, on one thread and on more."""
    bursts = {REFERENCE: reference()}
    for count in (64, 1024, 4096):
        for threads in (1, 2):
            envs = gym.make_vec(NAME, count, "vector_entry_point", threads=threads)
            envs.reset(seed=0)
            name = f"{count} robots, {threads} thread{'s' * (threads > 1)}"
            bursts[name] = batch_burst(envs, max(1024 // count, 1))
    return compared(race(bursts, rounds), REFERENCE)


def rays_rows(rounds: int) -> list[Row]:
    """A batch with few and with many rays, on one thread."""
    bursts = {REFERENCE: reference()}
    for count in RAYS:
        options = {"n_rays": count, "threads": 1, "field_of_view": 360.0}
        envs = gym.make_vec(NAME, 256, "vector_entry_point", **options)
        envs.reset(seed=0)
        bursts[f"{count} ray{'s' * (count > 1)}"] = batch_burst(envs)
    return compared(race(bursts, rounds), REFERENCE)


def pillars(pixels: float) -> NDArray[np.bool_]:
    """A square map of so many million pixels: pillars of 16 px, 96 px apart."""
    side = round(math.sqrt(1e6 * pixels))
    at = np.arange(side) % 96 < 16
    return at[:, None] & at[None, :]


def area_rows(rounds: int) -> list[Row]:
    """Robots all over a map, and one that stays in its corner, as the map grows."""
    bursts, memory = {REFERENCE: reference()}, []
    for area in AREAS:
        cells = pillars(area)
        last = len(cells) - 40.0 - (len(cells) - 40.0) % 96 + 16.0
        options = {
            "map": cells,
            "start": (56.0, 56.0),
            "goal": (last - 40.0, last - 40.0),
            "on_collision": "block",
        }
        one = gym.make(NAME, **options)
        bursts[f"{area:g} MPix, alone"] = single_burst(one, random_driving)
        envs = gym.make_vec(NAME, ROBOTS, "vector_entry_point", threads=1, **options)
        scatter(envs, len(cells))
        bursts[f"{area:g} MPix, all over"] = batch_burst(envs)
        task = one.unwrapped.nominal  # type: ignore[attr-defined]
        memory.append(Row(f"{area:g} MPix, memory", bytes_of(task), "bytes a pixel"))
    return compared(race(bursts, rounds), REFERENCE) + memory


def scatter(envs: Any, side: int) -> None:
    """Starts each robot at a random place between the pillars."""
    random = np.random.default_rng(0)
    envs.reset(seed=0)
    for i in range(envs.num_envs):
        x, y = 56.0 + 96.0 * random.integers(0, (side - 80) // 96, 2)
        mask = np.arange(envs.num_envs) == i
        start = (float(x), float(y), float(random.uniform(-3, 3)))
        envs.reset(options={"reset_mask": mask, "start": start})


def bytes_of(task: Any) -> float:
    """Memory of a task's arrays for each pixel of its map."""
    world = task.terrain
    arrays = (world.grid.cells, world.padded_clear, world.leaps, task.field)
    return float(sum(array.nbytes for array in arrays) / world.grid.cells.size)


BENCHES: dict[str, Callable[[int], list[Row]]] = {
    "A single environment": single_rows,
    "Batches of robots on the maze": batch_rows,
    "256 robots with more rays, one thread": rays_rows,
    f"Larger maps: one robot alone, and {ROBOTS} all over, one thread": area_rows,
}


if __name__ == "__main__":
    main("benchmarks.env_step", __doc__, BENCHES, REFERENCE)
