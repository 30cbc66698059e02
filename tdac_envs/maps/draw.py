"""Draws the bundled maps: `python -m tdac_envs.maps.draw DIR`.

The same files come out of every run.
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

from tdac_envs.maps.draw_ink import Image
from tdac_envs.maps.draw_paper import draw_maze


@dataclass(frozen=True, slots=True)
class _Task:
    """Contents of a map's task file; lengths in px, angles in rad."""

    start: tuple[float, float]
    heading: float
    goal: tuple[float, float]
    robot_radius: float
    description: str


_UP = round(-math.pi / 2, 4)

_MAPS: dict[str, tuple[Callable[[np.random.Generator], Image], _Task]] = {
    "maze": (
        draw_maze,
        _Task(
            (173, 289),
            _UP,
            (245, 505),
            15,
            "A maze in felt pen; the goal is three cells away and a long walk off.",
        ),
    ),
}


def save_png(path: Path, image: Image) -> None:
    """Writes an RGB or RGBA image."""
    code = cv2.COLOR_RGB2BGR if image.shape[2] == 3 else cv2.COLOR_RGBA2BGRA
    cv2.imwrite(str(path), cv2.cvtColor(image, code), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def draw_maps(folder: Path) -> None:
    """Writes each map's `<name>.png` and `<name>.json` into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (draw, task) in _MAPS.items():
        rng = np.random.default_rng(list(name.encode()))
        save_png(folder / f"{name}.png", draw(rng))
        text = json.dumps(asdict(task), indent=2) + "\n"
        (folder / f"{name}.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m tdac_envs.maps.draw DIR")
    draw_maps(Path(sys.argv[1]))
