"""Frames of an episode of TDAC-EPuck-v0: seen from above, x right, y up."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.drawing.canvas import (
    AMBER,
    FREE,
    GREEN,
    GREY,
    INK,
    RED,
    TRAIL,
    Colour,
    Image,
)
from tdac_envs.drawing.marks import OUTCOMES, draw_outcome
from tdac_envs.drawing.runs import Status
from tdac_envs.epuck.infrared import ELEVATION, N_SENSORS, PLACES
from tdac_envs.epuck.prisms import FIXED, Array, Prisms
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.footprint import Disc
from tdac_envs.worlds.picture import WorldCanvas, colour_of, draw_things
from tdac_envs.worlds.world import EPuck

SMALLEST_BODY = 6.0
NOTHING, CONTACT = 67.19, 2080.0
"""Readings with nothing near, and with an ideal object that touches the hull."""
_QUIET: Colour = (150, 163, 182)
_OTHER: Colour = (128, 132, 150)
_WHEEL: Colour = (40, 34, 84)
_CLOCKWISE = (4, 5, 6, 7, 0, 1, 2, 3)
_BAR, _BARS_HIGH = 15, 30


class EPuckScene:
    """The static part of an episode's frames, drawn once.

    Args:
        task: The task, with the start of the episode.
        movable: Whether objects with a mass may move and are drawn in each frame.
    """

    def __init__(self, task: EPuckTask, movable: bool) -> None:
        ground = task.ground
        pushable = [t for t in ground.things if t.mass is not None and t.solid]
        self._colours = [colour_of(thing.kind) for thing in pushable if movable]
        self._view = view = WorldCanvas(ground.bounds)
        still = [
            thing
            for thing in ground.things
            if not thing.is_goal or thing.solid
            if not (movable and any(thing is one for one in pushable))
        ]
        draw_things(view, ground.world, still)
        draw_task(view, task)
        for robot in ground.world.robots[1:]:
            self._draw_other(robot)
        view.scale_bar()

    def frame(
        self,
        pose: Sequence[float],
        *,
        readings: ArrayLike,
        reaches: ArrayLike,
        trail: ArrayLike,
        solid: Prisms,
        status: Status,
    ) -> Image:
        """One frame, uint8 RGB with even width and height.

        Args:
            pose: (x, y, heading), m and rad.
            readings: Readings of ps0 to ps7.
            reaches: Lengths of their rays up to the hit, m.
            trail: Positions so far, shape (n, 2), m.
            solid: Solid parts at their current positions.
            status: Text of the status strip; its outcome also marks the robot.
        """
        view = copy.copy(self._view)
        view.canvas = canvas = self._view.canvas.copy()
        x, y, heading = (float(value) for value in pose)
        canvas.line(view.at(trail), TRAIL, 2, 0.8)
        if self._colours:
            self._draw_movable(view, solid)
        values = np.asarray(readings, np.float64)
        _draw_rays(view, (x, y, heading), values, np.asarray(reaches, np.float64))
        radius = max(BODY_RADIUS * view.scale, SMALLEST_BODY)
        draw_epuck(view, (x, y, heading), radius, TRAIL)
        draw_outcome(canvas, view.at((x, y))[0], radius, status.outcome)
        _write_status(view, status)
        _draw_bars(view, values)
        return canvas.image

    def _draw_movable(self, view: WorldCanvas, solid: Prisms) -> None:
        for part in np.flatnonzero(solid.owner != FIXED).tolist():
            colour = self._colours[int(solid.owner[part])]
            at = solid.outline(part)
            if len(at) == 1:
                x, y = at[0].tolist()
                view.fill(Disc(x, y, float(solid.extent[part, 3])), colour)
                middle = at[0]
            else:
                corners, dark = view.at(at), _darker(colour)
                view.canvas.polygon(corners, colour)
                view.canvas.line(corners, dark, 1)
                view.canvas.line(corners[[-1, 0]], dark, 1)
                middle = at.mean(axis=0)
            view.canvas.disc(view.at(middle), 3.0, FREE, 0.9)

    def _draw_other(self, robot: EPuck) -> None:
        radius = max(BODY_RADIUS * self._view.scale, SMALLEST_BODY)
        draw_epuck(self._view, robot.pose, radius, _OTHER)


def draw_task(view: WorldCanvas, task: EPuckTask) -> None:
    """Draws the shortest path, the start and the goal."""
    view.canvas.line(view.at(task.shortest_path(task.start)), GREY, 2, 0.75, dash=7)
    start = view.at(task.start[:2])
    view.canvas.disc(start, 5, FREE)
    view.canvas.disc(start, 5, GREY, width=2)
    ring = max(task.goal_tolerance * view.scale, 7.0)
    for width, alpha in ((-1, 0.16), (2, 1.0)):
        view.canvas.disc(view.at(task.goal), ring, GREEN, alpha, width)
    view.canvas.disc(view.at(task.goal), 3.0, GREEN)


def level(reading: float) -> float:
    """Proximity for a reading: 0 if nothing is seen, 1 at contact, logarithmic."""
    nearness = math.log(max(reading, NOTHING) / NOTHING)
    return min(nearness / math.log(CONTACT / NOTHING), 1.0)


def ray_colour(reading: float) -> Colour:
    """Colour of a ray: grey if nothing is near, then amber, and red at contact."""
    share = 2.0 * level(reading)
    low, high = (_QUIET, AMBER) if share < 1.0 else (AMBER, RED)
    share -= math.floor(share) if share < 2.0 else 1.0
    mixed = [round(a + share * (b - a)) for a, b in zip(low, high, strict=True)]
    return mixed[0], mixed[1], mixed[2]


def _draw_rays(
    view: WorldCanvas,
    pose: tuple[float, float, float],
    readings: NDArray[np.float64],
    reaches: NDArray[np.float64],
) -> None:
    """Draws a wedge along each sensor's ray up to the hit."""
    for sensor in range(N_SENSORS):
        x, y, azimuth = PLACES[sensor].tolist()
        reach = float(reaches[sensor]) * math.cos(ELEVATION)
        near = level(float(readings[sensor])) > 1e-3
        colour = ray_colour(float(readings[sensor]))
        turns = azimuth + np.array([-0.1, 0.1])
        tips = np.column_stack([np.cos(turns), np.sin(turns)]) * reach + (x, y)
        wedge = _placed(view, pose, np.vstack([(x, y), tips]))
        view.canvas.polygon(wedge, colour, 0.75 if near else 0.35)
        if near:
            view.canvas.disc(wedge[1:].mean(axis=0), 2.5, colour)


def draw_epuck(
    view: WorldCanvas, pose: tuple[float, float, float], radius: float, colour: Colour
) -> None:
    """Draws a disc with two wheels and a nose ahead; `radius` is in frame px."""
    canvas, middle = view.canvas, view.at(pose[:2])[0]
    canvas.disc(middle, radius + 1.5, FREE)
    canvas.disc(middle, radius, colour)
    unit = radius / view.scale
    for side in (0.72, -0.72):
        wheel = np.array([(-0.46, -0.1), (0.46, -0.1), (0.46, 0.1), (-0.46, 0.1)])
        at = np.add(wheel, (0.0, side)) * unit
        canvas.polygon(_placed(view, pose, at), _WHEEL, 0.9)
    nose = np.array([(0.8, 0.0), (-0.42, 0.46), (-0.18, 0.0), (-0.42, -0.46)]) * unit
    canvas.polygon(_placed(view, pose, nose), FREE)


def _placed(view: WorldCanvas, pose: tuple[float, float, float], own: Array) -> Array:
    """Canvas coordinates of points in the robot's frame (x forward, y left)."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return view.at(own @ np.array([[cos, sin], [-sin, cos]]) + (x, y))


def _write_status(view: WorldCanvas, status: Status) -> None:
    canvas, first = view.canvas, view.canvas.strip_top + 26
    x = canvas.text(12, first, f"step {status.step} / {status.horizon}", INK)
    if status.outcome:
        canvas.text(x + 14, first, status.outcome, OUTCOMES.get(status.outcome, INK))
    canvas.text(12, first + 24, f"goal {status.distance:.2f} m away", INK)


def _draw_bars(view: WorldCanvas, readings: NDArray[np.float64]) -> None:
    """Draws the eight readings as bars, from the left rear to the right rear."""
    canvas, image = view.canvas, view.canvas.image
    whole = N_SENSORS * _BAR + 130
    left = image.shape[1] - 150 - whole
    if left < 260:
        return
    low = canvas.strip_top + 14 + _BARS_HIGH
    x = canvas.text(left, low, "left", INK) + 8
    for place, sensor in enumerate(_CLOCKWISE):
        reading = float(readings[sensor])
        at = x + place * _BAR + (4 if place > 3 else 0)
        image[low - _BARS_HIGH : low + 1, at : at + _BAR - 4] = (222, 223, 219)
        high = max(round(level(reading) * _BARS_HIGH), 2)
        image[low - high : low + 1, at : at + _BAR - 4] = ray_colour(reading)
        canvas.text(at + 1, low + 14, str(sensor), GREY)
    canvas.text(x + N_SENSORS * _BAR + 10, low, "right", INK)


def _darker(colour: Colour) -> Colour:
    red, green, blue = (round(0.72 * channel) for channel in colour)
    return red, green, blue
