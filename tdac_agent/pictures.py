"""Pictures of episodes, whatever their environment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_agent.setting import Setting
from tdac_agent.task_map2d import Map2DSetting
from tdac_agent.trajectory import Rollout
from tdac_envs.canvas import Image
from tdac_envs.closeup import Backdrop

Points = NDArray[np.float64]


class Pictures(Protocol):
    """How the episodes of a task are drawn."""

    def backdrop(self) -> Backdrop:
        """What the pictures of failed episodes have in common."""

    def trajectories(
        self, runs: Sequence[Points], outcomes: Sequence[str], labels: Sequence[str]
    ) -> Image:
        """Poses of episodes, each of shape (T + 1, 3), in one picture."""

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """A frame for every so many steps, and the last one."""


def pictures_of(setting: Setting) -> Pictures:
    """The pictures of a setting of either kind."""
    if isinstance(setting, Map2DSetting):
        from tdac_agent.pictures_map2d import MapPictures

        return MapPictures(setting)
    from tdac_agent.pictures_epuck import world_pictures

    return world_pictures(setting)


def shown_steps(rollout: Rollout, stride: int) -> list[int]:
    """Steps of which there is a frame: every so many, and the last one."""
    last = rollout.trajectory.steps
    return [*range(0, last, stride), last]
