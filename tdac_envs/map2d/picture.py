"""Frames of an episode of TDAC-Map2D-v0."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.drawing.canvas import GREY, INK, TRAIL, Canvas, Image
from tdac_envs.drawing.marks import (
    LEFT_RAYS,
    OUTCOMES,
    RIGHT_RAYS,
    draw_disc,
    draw_movers,
    draw_outcome,
    draw_rays,
    draw_task,
    load_sprite,
)
from tdac_envs.drawing.runs import SMALLEST_BODY, Status
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.mapping.params import RobotParams

ROBOT_IMAGE = Path(__file__).parents[1] / "mapping" / "maps" / "robot.png"
SMALLEST_PICTURE = 6.0


class MapScene:
    """The static part of an episode's frames, drawn once.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        start: Pose (x, y, heading), px and rad.
        goal: Point (x, y), px.
        goal_tolerance: Radius of the goal, px.
        robot: Body and sensor of the robot.
        path: Reference path, shape (n, 2), px.
        robot_image: Picture of the robot facing right. A disc with a nose is drawn if
            the file is missing or the robot is too small for it.
        units: Units of the status strip.
    """

    def __init__(
        self,
        cells: BoolGrid,
        start: Sequence[float],
        goal: Sequence[float],
        *,
        goal_tolerance: float,
        robot: RobotParams,
        path: ArrayLike = (),
        robot_image: Path = ROBOT_IMAGE,
        units: MapUnits = PIXELS,
    ) -> None:
        self._units = units
        self._canvas = Canvas(cells)
        self._robot, self._turns = robot, robot.angles()
        self._radius = max(robot.radius * self._canvas.scale, SMALLEST_BODY)
        self._sprite = load_sprite(robot_image, self._radius)
        draw_task(self._canvas, start, goal, goal_tolerance, path)

    def frame(
        self,
        pose: Sequence[float],
        ranges: ArrayLike = (),
        trail: ArrayLike = (),
        status: Status | None = None,
        movers: Sequence[NDArray[np.float64]] = (),
    ) -> Image:
        """One frame, uint8 RGB with even width and height.

        Args:
            pose: (x, y, heading), px and rad.
            ranges: Distances along the sensor's rays, px.
            trail: Positions so far, shape (n, 2), px.
            status: Text of the status strip; its outcome also marks the robot.
            movers: Movers in the last steps, each of shape (m, 3): x, y, radius, px.
        """
        canvas, robot = self._canvas.copy(), self._robot
        x, y, heading = (float(value) for value in pose)
        seen, turns = np.asarray(ranges, np.float64), self._turns
        ahead, aside = robot.scanner_offset or (0.0, 0.0)
        cos, sin = math.cos(heading), math.sin(heading)
        at = x + ahead * cos - aside * sin, y + ahead * sin + aside * cos
        draw_rays(canvas, (*at, heading), seen, turns, robot.range_max)
        draw_movers(canvas, movers)
        canvas.line(trail, TRAIL, 2)
        if self._radius < SMALLEST_PICTURE:
            canvas.disc((x, y), 3 * self._radius, TRAIL, 0.6, 1)
        if self._sprite is None or self._radius < SMALLEST_PICTURE:
            draw_disc(canvas, (x, y, heading), self._radius)
        else:
            canvas.paste((x, y), heading, self._sprite)
        if status is not None:
            draw_outcome(canvas, (x, y), self._radius, status.outcome)
            _write_status(canvas, status, self._units)
        return canvas.image


def _write_status(canvas: Canvas, status: Status, units: MapUnits) -> None:
    width, baseline = canvas.image.shape[1], canvas.strip_top + 20
    x = canvas.text(10, baseline, f"step {status.step} / {status.horizon}", INK)
    x = canvas.text(
        x + 14, baseline, f"goal {units.length(status.distance, 0)} away", INK
    )
    if status.outcome:
        colour = OUTCOMES.get(status.outcome, INK)
        x = canvas.text(x + 14, baseline, status.outcome, colour)
    if width - x > 190:
        at = canvas.text(width - 160, baseline, "left", LEFT_RAYS)
        at = canvas.text(at + 2, baseline, "/", GREY)
        canvas.text(at + 2, baseline, "right rays", RIGHT_RAYS)
