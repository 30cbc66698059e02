"""Times steps of TDAC-Map2D-v0 beside CartPole-v1: single, in batches, and scaling.

    python -m benchmarks env_step

Cases: a single environment through `gym.make` in several situations; a batch on one
thread, on two, and in two independent processes, the upper bound for two cores at that
moment; and the growth with the area of the map and with the number of rays, with the
memory of the map's arrays per pixel; and MuJoCo. The cases run in turns, in short
bursts. The floor is an environment that does nothing: the cost of Gymnasium's wrappers.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from itertools import cycle, islice
from multiprocessing.connection import Connection
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import tdac_envs  # noqa: F401 - registers the env
from benchmarks.timing import Bench, Effort, compared, in_turn, quartiles
from tdac_envs.physics.moved import ENGINES, EXACT, MUJOCO

Actions = list[Any]
Env = gym.Env[Any, Any]
Burst = Callable[[], int]
"""Makes some steps and returns their number."""

FLOOR, REFERENCE = "nothing", "CartPole-v1"
NAME = "TDAC-Map2D-v0"
ROUNDS = 60
STEPS = 300
BATCH_STEPS = 8192
"""Steps in a burst, summed over the robots of a batch."""
ROBOTS = 512
AREAS = (0.1, 0.5, 2.0, 4.0, 16.0)
RAYS = (1, 18, 72, 288)


class DoNothing(gym.Env[int, Any]):
    """The floor: the cost of Gymnasium's wrappers."""

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
    """Action towards the path point 12 points after the nearest one."""
    x, y, heading = pose
    nearest = int(np.argmin(np.hypot(path[:, 0] - x, path[:, 1] - y)))
    to_x, to_y = path[min(nearest + 12, len(path) - 1)]
    error = math.remainder(math.atan2(to_y - y, to_x - x) - heading, 2 * math.pi)
    turn = max(-1.0, min(1.0, 2.0 * error))
    ahead = max(0.0, 1.0 - 1.5 * abs(error))
    return np.clip([ahead + turn, ahead - turn], -1, 1).astype(np.float32)


def wall_driving(_: Env, count: int) -> Actions:
    """Full speed ahead, whatever is in the way."""
    return [np.ones(2, np.float32)] * count


Drive = Callable[[Env, int], Actions]
SINGLE: dict[str, tuple[dict[str, Any], Drive]] = {
    "maze, random": ({}, random_driving),
    "maze, along the path": ({}, path_driving),
    "maze, against a wall": ({"on_collision": "block"}, wall_driving),
}


def single_burst(env: Env, drive: Drive) -> Burst:
    """Steps of one environment, with a reset at the end of an episode."""
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


def yardsticks() -> dict[str, Burst]:
    """The floor and the reference, with random actions."""
    floor = gym.make(gym.envs.registration.EnvSpec("Floor-v0", entry_point=DoNothing))
    return {
        FLOOR: single_burst(floor, random_driving),
        REFERENCE: single_burst(gym.make(REFERENCE), random_driving),
    }


def raced(
    title: str,
    bursts: dict[str, Burst],
    rounds: int,
    notes: Mapping[str, str] | None = None,
) -> Bench:
    """Times bursts beside the yardsticks."""
    times = in_turn({**yardsticks(), **bursts}, rounds)
    return compared(title, times, FLOOR, REFERENCE, notes=notes)


ALONE, TOGETHER, APART = "1 thread", "2 threads", "2 processes"


def scaled(title: str, bursts: dict[str, Burst], rounds: int) -> Bench:
    """Like `raced`; notes the speed-up of each case over the same on one thread."""
    times = in_turn({**yardsticks(), **bursts}, rounds)
    notes = {}
    for name, own in times.items():
        case, _, how = name.rpartition(", ")
        if how in (TOGETHER, APART):
            one = times[f"{case}, {ALONE}"]
            gains = [a / b for a, b in zip(one, own, strict=True)]
            low, gain, high = quartiles(gains)
            notes[name] = f"{gain:.2f} × one thread ({low:.2f} to {high:.2f})"
    return compared(title, times, FLOOR, REFERENCE, notes=notes)


def batch_burst(envs: Any) -> Burst:
    """Steps of a batch that has been reset."""
    steps = max(BATCH_STEPS // envs.num_envs, 1)
    envs.action_space.seed(0)
    script = cycle([envs.action_space.sample() for _ in range(8)])

    def burst() -> int:
        for action in islice(script, steps):
            envs.step(action)
        return int(steps * envs.num_envs)

    return burst


def batch_envs(count: int, threads: int) -> Any:
    """A batch on the maze, after a reset."""
    envs = gym.make_vec(NAME, count, "vector_entry_point", threads=threads)
    envs.reset(seed=0)
    return envs


def burst_apart(count: int, processes: int = 2) -> Burst:
    """Steps of batches in independent processes, the upper bound for the cores."""
    context = multiprocessing.get_context("spawn")
    ends = []
    for _ in range(processes):
        ours, theirs = context.Pipe()
        context.Process(target=_step_apart, args=(count, theirs), daemon=True).start()
        theirs.close()
        ends.append(ours)

    def burst() -> int:
        for end in ends:
            end.send(None)
        return sum(end.recv() for end in ends)

    return burst


def _step_apart(count: int, end: Connection) -> None:
    burst = batch_burst(batch_envs(count, threads=1))
    with contextlib.suppress(EOFError):
        while True:
            end.recv()
            end.send(burst())


def single(rounds: int) -> Bench:
    """A single environment through `gym.make`."""
    bursts = {
        name: single_burst(gym.make(NAME, **options), drive)
        for name, (options, drive) in SINGLE.items()
    }
    return raced("A single TDAC-Map2D-v0", bursts, rounds)


def batches(rounds: int) -> Bench:
    """Batches, on one thread and on more."""
    # Batches of this size use one thread.
    bursts = {f"64 robots, {ALONE}": batch_burst(batch_envs(64, 1))}
    for count in (1024, 4096):
        bursts[f"{count} robots, {ALONE}"] = batch_burst(batch_envs(count, 1))
        bursts[f"{count} robots, {TOGETHER}"] = batch_burst(batch_envs(count, 2))
        bursts[f"{count} robots, {APART}"] = burst_apart(count)
    return scaled("Batches of robots on the maze", bursts, rounds)


def more_rays(rounds: int) -> Bench:
    """A batch with few and with many rays, on one thread."""
    bursts = {}
    for count in RAYS:
        options = {"n_rays": count, "threads": 1, "field_of_view": 360.0}
        envs = gym.make_vec(NAME, 256, "vector_entry_point", **options)
        envs.reset(seed=0)
        bursts[f"{count} ray{'s' * (count > 1)}"] = batch_burst(envs)
    return raced("256 robots with more rays, one thread", bursts, rounds)


def pillars(pixels: float) -> NDArray[np.bool_]:
    """A square map of `pixels` million pixels: pillars of 16 px, 96 px apart."""
    side = round(math.sqrt(1e6 * pixels))
    at = np.arange(side) % 96 < 16
    return at[:, None] & at[None, :]


def larger_maps(rounds: int, areas: Sequence[float] = AREAS) -> Bench:
    """Robots all over a growing map, and one robot that stays in its corner."""
    bursts, notes = {}, {}
    for area in areas:
        cells = pillars(area)
        last = len(cells) - 40.0 - (len(cells) - 40.0) % 96 + 16.0
        options = {
            "map": cells,
            "start": (56.0, 56.0),
            "goal": (last - 40.0, last - 40.0),
            "on_collision": "block",
        }
        one = gym.make(NAME, **options)
        task = one.unwrapped.nominal  # type: ignore[attr-defined]
        bursts[f"{area:g} MPix, alone"] = single_burst(one, random_driving)
        notes[f"{area:g} MPix, alone"] = f"{bytes_of(task):.1f} bytes a pixel"
        envs = gym.make_vec(NAME, ROBOTS, "vector_entry_point", threads=1, **options)
        scatter(envs, len(cells))
        bursts[f"{area:g} MPix, all over"] = batch_burst(envs)
    title = f"Larger maps: one robot alone, and {ROBOTS} all over, one thread"
    return raced(title, bursts, rounds, notes)


def physics(rounds: int) -> Bench:
    """A single environment on the maze, with each physics that is installed."""
    there = ENGINES if find_spec(MUJOCO) is not None else (EXACT,)
    bursts = {
        f"physics {name}": single_burst(gym.make(NAME, physics=name), random_driving)
        for name in there
    }
    return raced("A single TDAC-Map2D-v0 on the maze", bursts, min(rounds, 5))


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
    """Memory of a task's arrays per pixel of its map, bytes."""
    world = task.terrain
    arrays = (world.grid.cells, world.padded_clear, world.leaps, task.field)
    return float(sum(array.nbytes for array in arrays) / world.grid.cells.size)


def benches(effort: Effort) -> list[Bench]:
    """One bench per table."""
    rounds = effort.rounds_of(ROUNDS)
    maps = partial(larger_maps, areas=AREAS[: 2 if effort.quick else None])
    return [table(rounds) for table in (single, batches, more_rays, maps, physics)]
