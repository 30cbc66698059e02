"""Pictures of the worlds of a task set: one, or a contact sheet of many."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tdac_envs.drawing.canvas import (
    INK,
    PAPER,
    TRAIL,
    Canvas,
    Image,
    blank,
    frame_scale,
    write_text,
)
from tdac_envs.drawing.marks import draw_disc, draw_movers, draw_task
from tdac_envs.epuck.picture import draw_epuck
from tdac_envs.epuck.run_picture import WorldBackground, task_view
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.ladder.space_time import foreseen
from tdac_envs.ladder.task_sets import AnyTask, AnyWorld, TaskSet
from tdac_envs.ladder.worlds import LadderWorld
from tdac_envs.map2d.run_picture import Background
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.state import RADIUS
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.picture import SIDE

COLUMNS = 6
"""Worlds in a row of a contact sheet."""
AHEAD = 2.0
"""Seconds of the motion of movers that a picture shows."""
_LARGEST_TILE = 260
_MARGIN, _LINE = 10, 22


def backdrop_of(task: AnyTask) -> Background | WorldBackground:
    """The background of pictures of episodes on a world."""
    if isinstance(task, EPuckTask):
        return WorldBackground.of(task)
    return Background.of(task)


def draw_world(
    tasks: TaskSet, world: AnyWorld, task: AnyTask, side: int | None = None
) -> Image:
    """A world with the robot at its start, the goal, and the shortest path, uint8 RGB.

    Movers are where they start; a line shows where they go in the first seconds.

    Args:
        tasks: The set.
        world: One of its worlds.
        task: Its task, with the movers.
        side: Longest side of the picture, px; by default that of all frames.
    """
    if isinstance(world, LadderWorld):
        assert isinstance(task, Map2DTask)
        return _drawn_map(tasks, world, task, side)
    assert isinstance(task, EPuckTask)
    view = task_view(task, task.ground.bounds, strip=0, side=side or SIDE, margin=0.0)
    draw_epuck(view, world.start, BODY_RADIUS * view.scale, TRAIL)
    return view.canvas.image


def _drawn_map(
    tasks: TaskSet, world: LadderWorld, task: Map2DTask, side: int | None
) -> Image:
    height, width = world.cells.shape
    scale = side / max(height, width) if side else frame_scale(width, height)
    canvas = Canvas(world.cells, strip=0, scale=scale, narrowest=0)
    tolerance = tasks.file.goal_tolerance
    draw_task(canvas, world.start, world.goal, tolerance, world.path)
    if task.movers is not None:
        steps = foreseen(task, round(AHEAD / task.dt))[::-1]
        radii = task.movers.traits[:, RADIUS]
        draw_movers(canvas, [np.column_stack([places, radii]) for places in steps])
    draw_disc(canvas, world.start, tasks.file.robot.radius * scale)
    return canvas.image


def contact_sheet(
    tasks: TaskSet,
    worlds: Sequence[tuple[AnyWorld, AnyTask]],
    captions: Sequence[str],
) -> Image:
    """Many worlds, each as large as its tile, with a line of text below; uint8 RGB.

    Args:
        tasks: The set.
        worlds: Some of its worlds, and their tasks.
        captions: ASCII text for each.
    """
    tiles = [draw_world(tasks, *each, _LARGEST_TILE) for each in worlds]
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
