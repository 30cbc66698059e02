"""Pictures of an e-puck's episode in three dimensions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tdac_envs.epuck.carried import body_of, scene_at
from tdac_envs.epuck.ground import Point
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.physics.moved import Pose
from tdac_envs.physics.view import Image, View3D


class SolidPicture:
    """Draws an episode; see `tdac_envs.physics.view.View3D`.

    Args:
        task: A task in its world.

    Raises:
        TaskError: MuJoCo is not installed, or cannot render here.
        WorldError: There is no ground under the robot.
    """

    def __init__(self, task: EPuckTask) -> None:
        ground = task.ground
        self._view = View3D(
            scene_at(ground), body_of(ground), task.goal, task.goal_tolerance
        )

    def frame(
        self,
        pose: Pose,
        trail: Sequence[Point],
        things: NDArray[np.float64] | None = None,
        discs: NDArray[np.float64] | None = None,
    ) -> Image:
        """A picture, uint8 (height, width, 3), of a robot at a pose (m, rad)."""
        return self._view.frame(pose, trail, things, discs)
