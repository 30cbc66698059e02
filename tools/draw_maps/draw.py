"""Draws the bundled maps and the robot: `python -m tools.draw_maps.draw DIR`.

Every run produces the same files.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from tools.draw_maps.ground import draw_cave, draw_warehouse
from tools.draw_maps.ink import Image
from tools.draw_maps.paper import draw_maze, draw_spiral
from tools.draw_maps.plans import draw_light_on_dark, draw_office, draw_thin_walls
from tools.draw_maps.robot import draw_robot
from tools.draw_maps.town import draw_clutter, draw_rooms, draw_street


@dataclass(frozen=True, slots=True)
class _Task:
    """Contents of a map's task file; lengths in px, angles in rad."""

    start: tuple[float, float]
    heading: float
    goal: tuple[float, float]
    robot_radius: float
    description: str


_UP = round(-math.pi / 2, 4)
_DOWN = -_UP

_MAPS: dict[str, tuple[Callable[[np.random.Generator], Image], _Task]] = {
    "maze": (
        draw_maze,
        _Task((173, 289), _UP, (245, 505), 15, "A felt-pen maze; the goal is near."),
    ),
    "cave": (
        draw_cave,
        _Task((370, 180), _UP, (430, 425), 12, "A cave; a tight gap leads to a hall."),
    ),
    "clutter": (
        draw_clutter,
        _Task((345, 350), 0.0, (575, 350), 14, "A playroom; from one pen to another."),
    ),
    "light_on_dark": (
        draw_light_on_dark,
        _Task((810, 260), 0.0, (610, 265), 10, "A ship's deck, light lines on dark."),
    ),
    "office": (
        draw_office,
        _Task((500, 100), 0.0, (500, 370), 12, "An office; to the meeting room."),
    ),
    "rooms": (
        draw_rooms,
        _Task((140, 400), 0.0, (400, 400), 15, "A furnished flat; to the next room."),
    ),
    "spiral": (
        draw_spiral,
        _Task((350, 100), 0.0, (350, 350), 10, "A spiral with a ring at its centre."),
    ),
    "street": (
        draw_street,
        _Task((288, 430), -1.4486, (450, 450), 12, "Streets; to a gated courtyard."),
    ),
    "thin_walls": (
        draw_thin_walls,
        _Task((81, 405), _DOWN, (350, 350), 10, "Nested octagons of thin walls."),
    ),
    "warehouse": (
        draw_warehouse,
        _Task((560, 221), 0.0, (560, 385), 12, "Racks; the goal is in a dead end."),
    ),
}


def save_png(path: Path, image: Image) -> None:
    """Writes an RGB or RGBA image."""
    code = cv2.COLOR_RGB2BGR if image.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    cv2.imwrite(str(path), cv2.cvtColor(image, code), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def draw_maps(folder: Path) -> None:
    """Writes each map's `<name>.png` and `<name>.json`, and `robot.png`."""
    folder.mkdir(parents=True, exist_ok=True)
    save_png(folder / "robot.png", draw_robot())
    for name, (draw, task) in _MAPS.items():
        rng = np.random.default_rng(list(name.encode()))
        save_png(folder / f"{name}.png", draw(rng))
        text = json.dumps(asdict(task), indent=2) + "\n"
        (folder / f"{name}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m tools.draw_maps.draw DIR")
    draw_maps(Path(sys.argv[1]))
