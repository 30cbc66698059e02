"""How far an e-puck pushes boxes of different masses, in each physics.

    python -m benchmarks.pushing

A box with sides of 6 cm stands 2 cm ahead of the robot; all frictions are 1, those of
the robot's body in MuJoCo also 0.5 and 0.1. The robot drives straight for 2 s at full
speed. Printed is how far the box moved.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.epuck_step import posts
from tdac_envs import World
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.physics.moved import EXACT, MUJOCO
from tdac_envs.worlds.footprint import Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part

MASSES = 0.02, 0.05, 0.08, 0.11, 0.14, 0.15, 0.16, 0.17, 0.2, 0.3, 0.5
"""kg; the robot has 0.16 kg."""
PHYSICS: dict[str, Any] = {
    "exact": EXACT,
    "MuJoCo, friction 1": MUJOCO,
    "0.5": {"engine": MUJOCO, "friction": 0.5},
    "0.1": {"engine": MUJOCO, "friction": 0.1},
}
SIDE, AHEAD, SECONDS = 0.06, 0.087, 2.0


def world_with(mass: float) -> World:
    """A floor of 2 m with a box ahead of the robot."""
    place = Rectangle(AHEAD, 0.0, 0.0, SIDE, SIDE)
    parts = (Part(place, 0.0, SIDE),)
    box = Obstacle("box", "Solid", AHEAD, 0.0, parts, parts, mass)
    floor = Arena(Rectangle(0.0, 0.0, 0.0, 2.0, 2.0))
    start = EPuck("e-puck", 0.0, 0.0, 0.0)
    return replace(
        posts(1), robots=(start,), goal=(0.9, 0.9), obstacles=(box,), arenas=(floor,)
    )


def pushed(mass: float, physics: Any) -> float:
    """How far the box is after the drive, m."""
    env = EPuckEnv(world_with(mass), physics=physics, on_collision="block")
    env.reset(seed=0)
    begin = env.things()[0, :2]
    for _ in range(round(SECONDS / env.task.dt)):
        env.step(np.ones(2, np.float32))
    return float(np.hypot(*(env.things()[0, :2] - begin)))


def main() -> None:
    """Prints the table, in cm."""
    print("| mass, kg | " + " | ".join(PHYSICS) + " |")
    print("|---:|" + "---:|" * len(PHYSICS))
    for mass in MASSES:
        cells = [f"{100 * pushed(mass, own):.1f}" for own in PHYSICS.values()]
        print(f"| {mass:g} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
