"""Draws `docs/generated-worlds.png`: worlds of each generator with their paths.

    python tools/draw_generated_worlds.py [FILE]

A row per generator: the body at the start with its heading, the goal, and the shortest
path of the disc.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.ladder.generators.registry import GENERATORS
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.ladder.worlds import LadderWorld, WorldSpec, make_world

FILE = Path(__file__).parent.parent / "docs" / "generated-worlds.png"
COLUMNS, SCALE, MARGIN, SHIFT = 5, 2, 8, 4
WALL, PATH, BODY, GOAL = (74, 60, 50), (196, 130, 40), (40, 40, 214), (60, 150, 40)


def main() -> None:
    """Writes the picture."""
    rows = []
    for name in GENERATORS:
        spec = WorldSpec.model_validate({"generator": {"name": name}})
        keys = [world_key(b"picture", name, "docs", k, "world") for k in range(COLUMNS)]
        tiles = [tile(make_world(spec, key), spec) for key in keys]
        rows.append(np.hstack(tiles))
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    cv2.imwrite(str(file), np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def tile(world: LadderWorld, spec: WorldSpec) -> NDArray[np.uint8]:
    """A picture of a world with a margin, shape (height, width, 3)."""
    image = np.full((*world.cells.shape, 3), 255, np.uint8)
    image[world.cells] = WALL
    image = image.repeat(SCALE, axis=0).repeat(SCALE, axis=1)
    cv2.polylines(image, [_fixed(world.path)], False, PATH, 2, cv2.LINE_AA, SHIFT)
    x, y, heading = world.start
    nose = x + spec.radius * math.cos(heading), y + spec.radius * math.sin(heading)
    centre, tip, goal = (
        tuple(_fixed(np.array(p)).tolist()) for p in ((x, y), nose, world.goal)
    )
    units = SCALE << SHIFT
    circle = {"lineType": cv2.LINE_AA, "shift": SHIFT}
    cv2.circle(image, centre, round(spec.radius * units), BODY, 2, **circle)
    cv2.line(image, centre, tip, BODY, 2, cv2.LINE_AA, SHIFT)
    cv2.circle(image, goal, round(spec.tolerance * units), GOAL, -1, **circle)
    border = ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0))
    return np.pad(image, border, constant_values=235)


def _fixed(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Points on the enlarged picture with SHIFT binary digits after the point."""
    enlarged = (points + 0.5) * SCALE - 0.5
    return np.round(enlarged * (1 << SHIFT)).astype(np.int32)


if __name__ == "__main__":
    main()
