"""Makes many generated worlds and checks each of them, in two processes.

    python -m benchmarks.many_worlds [--count WORLDS] [--from INDEX]

The worlds of all generators take turns. Each is checked: TDAC-Map2D-v0 accepts its map,
start and goal; the environment's path lengths are the world's own; and no path on the
grid is shorter than the shortest path of the disc, nor much longer. Then a process of
its own makes all of them again, in the opposite order, and the hashes are compared.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import time

import numpy as np

from tdac_envs.core.errors import TdacError
from tdac_envs.grid.grid import body_free, clearance
from tdac_envs.grid.plan import distance_field
from tdac_envs.ladder.generators.registry import GENERATORS
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.ladder.worlds import LadderWorld, WorldSpec, make_world
from tdac_envs.map2d.env import Map2DEnv

NAMES = tuple(GENERATORS)
SPECS = [WorldSpec.model_validate({"generator": {"name": name}}) for name in NAMES]
LONGEST = 1.09
"""Steps have eight directions, so a path is up to 8.3 % longer on a grid."""
FINE = 5
SLACK = 0.2
"""No point is further than this from the centre of a pixel of the finer grid, px."""


def main() -> int:
    """Prints the rate and the worlds that fail; returns 1 if any does."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.many_worlds")
    parser.add_argument("--count", type=int, default=100_000, help="number of worlds")
    parser.add_argument("--from", type=int, default=0, dest="first", help="first one")
    parser.add_argument("--hashes", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.count < 1 or options.first < 0:
        parser.error("expected --count of at least 1 and --from of at least 0")
    numbers = range(options.first, options.first + options.count)
    if options.hashes:
        for number in reversed(numbers):
            print(json.dumps([number, digest(made(number))]), flush=True)
        return 0
    problems, hashes = checked(numbers)
    again = made_again(numbers)
    for number in numbers:
        if number in hashes and hashes[number] != again.get(number):
            problems.append(f"{name_of(number)}: not equal when made again")
    for problem in problems:
        print(problem)
    print(f"{len(problems)} problems with {len(numbers)} worlds")
    return 1 if problems else 0


def made(number: int) -> LadderWorld:
    """A world; generators take turns."""
    key = world_key(b"many worlds", "0" * 64, "test", number, "world")
    return make_world(SPECS[number % len(SPECS)], key)


def name_of(number: int) -> str:
    """What a world is called in messages."""
    return f"world {number} ({NAMES[number % len(NAMES)]})"


def digest(world: LadderWorld) -> str:
    """Hash of everything that an episode depends on, and of the figures."""
    text = repr((world.cells.shape, world.start, world.goal, world.difficulty))
    arrays = np.packbits(world.cells).tobytes() + world.field.tobytes()
    return hashlib.sha256(text.encode() + arrays).hexdigest()[:32]


def checked(numbers: range) -> tuple[list[str], dict[int, str]]:
    """The problems of the worlds, and their hashes by number."""
    problems, hashes, seconds = list[str](), dict[int, str](), 0.0
    for number in numbers:
        began = time.process_time()
        try:
            world = made(number)
        except TdacError as error:
            problems.append(f"{name_of(number)}: {error}")
            continue
        finally:
            seconds += time.process_time() - began
        hashes[number] = digest(world)
        problem = problem_of(world, SPECS[number % len(SPECS)])
        if problem is not None:
            problems.append(f"{name_of(number)}: {problem}")
    rate = len(numbers) / seconds
    print(f"{len(numbers)} worlds made, {rate:.0f} a second of CPU time", flush=True)
    return problems, hashes


def problem_of(world: LadderWorld, spec: WorldSpec) -> str | None:
    """What TDAC-Map2D-v0 has against a world, or None."""
    try:
        env = Map2DEnv(
            world.cells,
            start=tuple(world.start),
            goal=world.goal,
            robot_radius=spec.radius,
            goal_tolerance=spec.tolerance,
        )
    except TdacError as error:
        return f"refused: {error}"
    if not np.array_equal(env.task.field, world.field):
        return "the environment has other path lengths"
    ratio = env.task.shortest / world.difficulty.length
    if ratio > LONGEST:
        # A disc also fits between two pixels, so a grid may have no such path.
        ratio = max(1.0, finer(world, spec.radius - SLACK) / world.difficulty.length)
    if not 1.0 - 1e-6 <= ratio <= LONGEST:
        return f"the path on the grid is {ratio:.4f} times the shortest path"
    return None


def finer(world: LadderWorld, radius: float) -> float:
    """Length of the shortest path on a grid of `FINE` times as many pixels a side, px.

    Args:
        world: The world.
        radius: Radius of the body, px.
    """
    cells = np.kron(world.cells, np.ones((FINE, FINE), np.bool_))
    x, y, goal_x, goal_y = (
        round(FINE * value) + FINE // 2 for value in (*world.start[:2], *world.goal)
    )
    free = body_free(clearance(cells), FINE * radius)
    return float(distance_field(free, (goal_x, goal_y))[y, x]) / FINE


def made_again(numbers: range) -> dict[int, str]:
    """The hashes of the worlds from a process of its own, made from last to first."""
    words = ["--count", str(len(numbers)), "--from", str(numbers.start), "--hashes"]
    ran = subprocess.run(
        [sys.executable, "-m", "benchmarks.many_worlds", *words],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    return dict(json.loads(line) for line in ran.stdout.splitlines())


if __name__ == "__main__":
    sys.exit(main())
