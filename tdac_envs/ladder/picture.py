"""Pictures of generated worlds: one, or a contact sheet of many."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tdac_envs.drawing.canvas import (
    INK,
    PAPER,
    Canvas,
    Image,
    blank,
    frame_scale,
    write_text,
)
from tdac_envs.drawing.marks import draw_disc, draw_task
from tdac_envs.ladder.worlds import LadderWorld

COLUMNS = 6
"""Worlds in a row of a contact sheet."""
_LARGEST_TILE = 260
_MARGIN, _LINE = 10, 22


def draw_world(
    world: LadderWorld, radius: float, tolerance: float, scale: float | None = None
) -> Image:
    """A world with the robot at its start, the goal, and the shortest path, uint8 RGB.

    Args:
        world: The world.
        radius: Radius of the body, px.
        tolerance: Distance at which the goal is reached, px.
        scale: Frame pixels per pixel of the world; by default that of all frames.
    """
    height, width = world.cells.shape
    scale = frame_scale(width, height) if scale is None else scale
    canvas = Canvas(world.cells, strip=0, scale=scale, narrowest=0)
    draw_task(canvas, world.start, world.goal, tolerance, world.path)
    draw_disc(canvas, world.start, radius * scale)
    return canvas.image


def contact_sheet(
    worlds: Sequence[LadderWorld],
    captions: Sequence[str],
    radius: float,
    tolerance: float,
) -> Image:
    """Many worlds, each as large as its tile, with a line of text below; uint8 RGB.

    Args:
        worlds: The worlds.
        captions: ASCII text for each.
        radius: Radius of the body, px.
        tolerance: Distance at which the goal is reached, px.
    """
    sides = [max(world.cells.shape) for world in worlds]
    tiles = [
        draw_world(world, radius, tolerance, _LARGEST_TILE / side)
        for world, side in zip(worlds, sides, strict=True)
    ]
    height = max(tile.shape[0] for tile in tiles) + _LINE + _MARGIN
    width = _LARGEST_TILE + _MARGIN
    columns = min(COLUMNS, len(tiles))
    rows = math.ceil(len(tiles) / columns)
    sheet = blank(rows * height + _MARGIN, columns * width + _MARGIN, PAPER)
    for number, (tile, caption) in enumerate(zip(tiles, captions, strict=True)):
        row, column = divmod(number, columns)
        top, left = row * height + _MARGIN, column * width + _MARGIN
        sheet[top : top + tile.shape[0], left : left + tile.shape[1]] = tile
        write_text(sheet, left, top + height - _MARGIN - 7, caption, INK)
    return np.ascontiguousarray(sheet)
