"""Pictures of an episode on a map in three dimensions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tdac_envs.map2d.carried import UNSCALED_RADIUS, body_of
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import Point
from tdac_envs.physics.boxes import scene_on
from tdac_envs.physics.moved import Pose
from tdac_envs.physics.view import Image, View3D

_WALLS = 1.1
"""Height of walls, in heights of the robot: the camera sees over them."""


class SolidPicture:
    """Draws an episode; see `tdac_envs.physics.view.View3D`.

    The body's radius is drawn as `UNSCALED_RADIUS`, whatever the map's resolution.

    Args:
        task: A task on its map.

    Raises:
        TaskError: MuJoCo is not installed or cannot render here, or the map needs too
            many boxes.
    """

    def __init__(self, task: Map2DTask) -> None:
        self._metres = metres = UNSCALED_RADIUS / task.robot.radius
        body = body_of(task, metres)
        scene = scene_on(
            task.terrain.grid.cells, metres, _WALLS * body.top, fenced=False
        )
        goal = self._place(*task.goal)
        self._view = View3D(scene, body, goal, task.goal_tolerance * metres)

    def frame(
        self,
        pose: Pose,
        trail: Sequence[Point],
        things: NDArray[np.float64] | None = None,
        discs: NDArray[np.float64] | None = None,
    ) -> Image:
        """A picture, uint8 (height, width, 3), of a robot at a pose (px, rad)."""
        x, y, heading = pose
        moving = None if discs is None else discs * self._metres
        if moving is not None:
            moving[:, 1] *= -1.0
        places = [self._place(*point) for point in trail]
        return self._view.frame((*self._place(x, y), -heading), places, things, moving)

    def _place(self, x: float, y: float) -> Point:
        return x * self._metres, -y * self._metres
