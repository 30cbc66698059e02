"""Times the camera images of Webots controllers in bundled worlds.

    python -m benchmarks.camera [--rounds N]

Each case takes a new sample at the robot's start and renders it.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Callable
from dataclasses import replace

from benchmarks.timing import in_turn
from tdac_envs.webots.stage import open_stage
from tdac_envs.webots.views import Views
from tdac_envs.worlds.bundled import world_file

WORLDS = ("maze", "arena", "room")
SIZES = ((52, 39), (160, 120), (640, 480))
ROUNDS = 50


def main() -> None:
    """Prints a table of times, in ms."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    rounds = parser.parse_args().rounds
    cases = {
        f"{world}, {width} x {height}": one_image(world, width, height)
        for world in WORLDS
        for width, height in SIZES
    }
    print(f"{'image':20} {'median':>9} {'fastest':>9}")
    for name, taken in in_turn(cases, rounds).items():
        median, fastest = 1e3 * statistics.median(taken), 1e3 * min(taken)
        print(f"{name:20} {median:6.2f} ms {fastest:6.2f} ms")


def one_image(world: str, width: int, height: int) -> Callable[[], object]:
    """A function that takes and renders an image."""
    stage = open_stage(world_file(world))
    env = stage.make_env()
    env.reset(seed=0)
    cameras = tuple(
        replace(camera, width=width, height=height) for camera in stage.cameras
    )
    taking = Views(cameras, stage.world, stage.sky, stage.robot, env)

    def take() -> object:
        taking.expose("camera")
        return taking.image("camera")

    return take


if __name__ == "__main__":
    main()
