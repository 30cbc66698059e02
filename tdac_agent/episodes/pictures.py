"""Pictures of episodes, whatever their environment."""

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
    """The pictures of a setting."""
    return environment(setting.nominal.env_id).pictures(setting)
