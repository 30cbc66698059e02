"""Pictures of episodes in any environment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Setting
from tdac_agent.tasks.units import Points
from tdac_envs.drawing.backdrop import Backdrop
from tdac_envs.drawing.canvas import Image


class Pictures(Protocol):
    """Draws the episodes of a task."""

    def backdrop(self) -> Backdrop:
        """Returns the background of the pictures of failed episodes."""

    def trajectories(
        self,
        runs: Sequence[Points],
        outcomes: Sequence[str],
        labels: Sequence[str],
        movers: Sequence[Points] = (),
    ) -> Image:
        """Draws the poses of episodes, each of shape (T + 1, 3), in one picture.

        Args:
            runs: The poses.
            outcomes: Outcome of each episode.
            labels: Name of each episode.
            movers: Movers at the end of the first episode; see `Trajectory.ghosts`.
        """

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """Draws every `stride`-th step and the last one."""


def pictures_of(setting: Setting) -> Pictures:
    """Returns an object that draws a task's episodes."""
    return environment(setting.nominal.env_id).pictures(setting)
