"""Draws `docs/contact.png`: a robot slides along a wall and turns out of a corner.

Usage: python tools/draw_contact.py [FILE]
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.patches import Circle

from tdac_envs.map2d.env import Map2DEnv

mpl.use("Agg")

PHASES = [((1.0, 1.0), 84), ((0.5, 1.0), 40), ((1.0, 1.0), 8)]
FREE, TOUCHING, WALL = "#3B6EA5", "#C8641E", "#3A3F45"


def drive() -> tuple[np.ndarray, list[bool], np.ndarray, float]:
    """Poses, shape (n, 3); whether each is a contact; the map; the body radius, px."""
    cells = np.zeros((150, 260), np.bool_)
    cells[120:], cells[:, 220:] = True, True
    env = Map2DEnv(
        cells, (40, 50, 0.75), (30, 20), robot_radius=14, on_collision="block"
    )
    env.reset(seed=0)
    poses, contacts = [env.pose()], [False]
    for action, steps in PHASES:
        for _ in range(steps):
            info = env.step(np.array(action, np.float32))[4]
            poses.append(env.pose())
            contacts.append(info["collision"])
    return np.array(poses), contacts, cells, env.nominal.robot.radius


def main(file: str = "docs/contact.png") -> None:
    """Draws the picture."""
    import matplotlib.pyplot as plt

    poses, contacts, cells, radius = drive()
    figure, axes = plt.subplots(figsize=(7.2, 4.2), dpi=100, layout="constrained")
    axes.imshow(~cells, cmap=mpl.colors.ListedColormap([WALL, "white"]))
    for k in range(0, len(poses), 4):
        x, y, heading = poses[k]
        colour = TOUCHING if contacts[k] else FREE
        axes.add_patch(Circle((x, y), radius, fill=False, color=colour, alpha=0.6))
        tip = x + radius * math.cos(heading), y + radius * math.sin(heading)
        axes.plot((x, tip[0]), (y, tip[1]), color=colour, lw=1.2, alpha=0.6)
    axes.plot(poses[:, 0], poses[:, 1], color="#202428", lw=1.4)
    for colour, text in ((FREE, "free"), (TOUCHING, "in contact")):
        axes.plot([], [], color=colour, label=text)
    axes.legend(loc="lower left", framealpha=1.0)
    axes.set_xlabel("x (px)")
    axes.set_ylabel("y (px)")
    figure.savefig(Path(file), metadata={"Software": None})


if __name__ == "__main__":
    main(*sys.argv[1:2])
