"""Draws `docs/physics.png`: an e-puck among crates in MuJoCo, from behind.

Usage: python tools/draw_solid.py [FILE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from tdac_envs.epuck.env import EPuckEnv

STEPS = 48
"""So many steps, and the first crate has been pushed."""


def main() -> None:
    """Drives, draws and writes the picture."""
    env = EPuckEnv(
        "crates",
        physics="mujoco",
        on_collision="block",
        view="3d",
        render_mode="rgb_array",
    )
    env.reset(seed=0)
    for _ in range(STEPS):
        env.step(np.array([1.0, 0.95], np.float32))
    frame = env.render()
    assert frame is not None
    file = Path(sys.argv[1] if sys.argv[1:] else "docs/physics.png")
    cv2.imwrite(str(file), frame[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
