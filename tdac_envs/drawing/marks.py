"""Marks on a map: start, goal, robot, rays, outcome."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.intake import IMAGE_BYTES, read_file
from tdac_envs.drawing.canvas import (
    AMBER,
    BLUE,
    FREE,
    GREEN,
    GREY,
    INK,
    MOVER,
    ORANGE,
    RED,
    TRAIL,
    Canvas,
    Colour,
)

OUTCOMES: dict[str, Colour] = {"reached": GREEN, "collision": RED, "out of time": AMBER}
LEFT_RAYS, RIGHT_RAYS = BLUE, ORANGE
Sprite = NDArray[np.float32]
GHOST_SECONDS = 1.0
"""Trails of movers show where they were in this time."""
# Layers of a trail, each shorter than the one below it, and their opacity.
_FADES, _LAYER = 6, 0.15
# Radius of a disc with room for its number, frame px.
_LEGIBLE = 11.0


def load_sprite(file: Path, radius: float) -> Sprite | None:
    """The robot's picture for `Canvas.paste`, for a body of `radius` frame px.

    Returns:
        None if the file is missing or not an 8-bit picture.
    """
    try:
        data = np.frombuffer(read_file(file, IMAGE_BYTES), np.uint8)
    except OSError:
        return None
    picture = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    if picture is None or picture.dtype != np.uint8:
        return None
    if picture.ndim == 2 or picture.shape[2] == 3:
        code = cv2.COLOR_GRAY2RGBA if picture.ndim == 2 else cv2.COLOR_BGR2RGBA
        picture = cv2.cvtColor(picture, code)
    else:
        picture = cv2.cvtColor(picture, cv2.COLOR_BGRA2RGBA)
    rows, columns = picture.shape[:2]
    zoom = 6 * radius / max(rows, columns)
    size = (max(1, round(columns * zoom)), max(1, round(rows * zoom)))
    colour = picture.astype(np.float32)
    alpha = colour[..., 3:] / 255
    sprite = np.concatenate([colour[..., :3] * alpha, alpha], axis=2)
    small = cv2.resize(sprite, size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)


def draw_task(
    canvas: Canvas,
    start: Sequence[float],
    goal: Sequence[float],
    goal_tolerance: float,
    path: ArrayLike,
) -> None:
    """Draws the reference path, the start with its heading, and the goal."""
    canvas.line(path, GREY, 1 if canvas.scale < 1 else 2, 0.75, dash=7)
    canvas.disc(start[:2], 5, FREE)
    canvas.disc(start[:2], 5, GREY, width=2)
    ring = max(goal_tolerance * canvas.scale, 6.0)
    canvas.disc(goal, ring, GREEN, 0.16)
    canvas.disc(goal, ring, GREEN, width=2)
    canvas.disc(goal, min(3.5, ring / 3), GREEN)


def draw_rays(
    canvas: Canvas,
    pose: tuple[float, float, float],
    ranges: NDArray[np.float64],
    turns: NDArray[np.float64],
    range_max: float,
) -> None:
    """Draws the sensor's fan: the robot's left half blue, its right half orange.

    A ray straight behind the robot borders both halves.

    Args:
        canvas: Where to draw.
        pose: (x, y, heading).
        ranges: Shape (n_rays,), px.
        turns: Shape (n_rays,): angles of the rays from the heading, rad.
        range_max: Range without a hit, px.
    """
    if len(ranges) == 0:
        return
    x, y, heading = pose
    turns, ranges = _from_left_to_right(turns, ranges)
    angles = heading + turns
    tips = np.column_stack([np.cos(angles), np.sin(angles)]) * ranges[:, None] + (x, y)
    halves = ((turns < 1e-9, LEFT_RAYS), (turns > -1e-9, RIGHT_RAYS))
    for half, colour in halves:
        canvas.polygon(np.vstack([(x, y), tips[half]]), colour, 0.10)
        canvas.fan((x, y), tips[half], colour, 0.45)
    for half, colour in halves:
        for tip in tips[half & (ranges < range_max)]:
            canvas.disc(tip, 2, colour)


def _from_left_to_right(
    turns: NDArray[np.float64], ranges: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays by their angle from -pi to pi; one at -pi also stands at pi."""
    turns = np.where(np.abs(turns) > np.pi, np.remainder(turns, 2 * np.pi), turns)
    turns = np.where(turns > np.pi + 1e-9, turns - 2 * np.pi, turns)
    behind = turns <= 1e-9 - np.pi
    turns = np.append(turns, turns[behind] + 2 * np.pi)
    order = np.argsort(turns, kind="stable")
    return turns[order], np.append(ranges, ranges[behind])[order]


def draw_movers(canvas: Canvas, steps: Sequence[NDArray[np.float64]]) -> None:
    """Draws moving discs as they are now, with a fading trail of where they were.

    Discs that are large enough bear their numbers.

    Args:
        canvas: Where to draw.
        steps: Discs in the last steps, oldest first, each of shape (m, 3): x, y and
            radius in canvas coordinates.
    """
    if not len(steps):
        return
    places = np.array([discs[:, :2] for discs in steps])
    cuts = np.unique(np.linspace(0, len(places) - 1, _FADES + 1).astype(int)).tolist()
    for m, (x, y, radius) in enumerate(steps[-1].tolist()):
        for first in cuts[:-1]:
            # Pieces that lie on each other: those side by side would show their joints.
            canvas.line(places[first:, m], MOVER, 2, _LAYER)
        canvas.disc((x, y), radius * canvas.scale, MOVER, 0.55)
        canvas.disc((x, y), radius * canvas.scale, MOVER, width=1)
        if radius * canvas.scale >= _LEGIBLE:
            canvas.label((x, y), str(m), INK)


def draw_disc(canvas: Canvas, pose: tuple[float, float, float], radius: float) -> None:
    """Draws the robot as a disc with a nose; the radius is in frame pixels."""
    x, y, heading = pose
    canvas.disc((x, y), radius, TRAIL)
    if radius >= 5:
        canvas.disc((x, y), radius, FREE, width=1)
        reach = 0.62 * radius / canvas.scale
        turns = heading + np.array([0.0, 2.5, math.pi, -2.5])
        reaches = reach * np.array([1.0, 0.9, 0.35, 0.9])
        nose = np.column_stack([np.cos(turns), np.sin(turns)]) * reaches[:, None]
        canvas.polygon(np.add(nose, (x, y)), FREE)


def draw_outcome(
    canvas: Canvas, centre: ArrayLike, radius: float, outcome: str
) -> None:
    """Marks how an episode ended: a tick, a cross or a bar in the outcome's colour.

    Args:
        canvas: Where to draw.
        centre: Last position of the robot.
        radius: Radius of the body, frame px.
        outcome: One of `OUTCOMES`; any other draws nothing.
    """
    if outcome not in OUTCOMES:
        return
    colour = OUTCOMES[outcome]
    canvas.disc(centre, radius + 3, colour, width=2)
    size = max(0.55 * radius, 5.0) / canvas.scale
    strokes = {
        "reached": [[(-0.9, 0.0), (-0.25, 0.7), (0.95, -0.7)]],
        "collision": [[(-0.8, -0.8), (0.8, 0.8)], [(-0.8, 0.8), (0.8, -0.8)]],
        "out of time": [[(-0.8, 0.0), (0.8, 0.0)]],
    }[outcome]
    middle = np.asarray(centre, np.float64)
    for width, ink in ((6, FREE), (3, colour)):
        for stroke in strokes:
            canvas.line(np.add(np.multiply(stroke, size), middle), ink, width)
