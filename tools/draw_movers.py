"""Draws docs/movers.png: an office in which discs bounce off walls.

Usage: python -m tools.draw_movers [FILE]
"""

from __future__ import annotations

import sys

import gymnasium as gym
import numpy as np
from PIL import Image

import tdac_envs  # noqa: F401 - registers the environments

STEPS = 60


def main() -> None:
    """Draws a frame after some steps of a robot that turns on the spot."""
    env = gym.make(
        "TDAC-Map2D-v0",
        map="office",
        movers=[{"kind": "bounce", "count": 12, "radius": 12, "speed": 50}],
        render_mode="rgb_array",
    )
    env.reset(seed=3)
    for _ in range(STEPS):
        env.step(np.array([0.1, -0.1], np.float32))
    frame = Image.fromarray(env.render())
    file = sys.argv[1] if sys.argv[1:] else "docs/movers.png"
    frame.quantize(256).save(file, optimize=True)


if __name__ == "__main__":
    main()
