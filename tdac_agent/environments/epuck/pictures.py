"""Pictures of an e-puck's episodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.units import Points
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.runs import Status
from tdac_envs.epuck.infrared import TABLE
from tdac_envs.epuck.picture import EPuckScene
from tdac_envs.epuck.run_picture import WorldBackground, trajectory_picture
from tdac_envs.epuck.task import EPuckTask


@dataclass(frozen=True, slots=True, eq=False)
class WorldPictures:
    """See `Pictures`.

    Attributes:
        nominal: Task of the episodes.
    """

    nominal: EPuckTask

    def backdrop(self) -> WorldBackground:
        """Returns the world as a background."""
        return WorldBackground.of(self.nominal)

    def trajectories(
        self,
        runs: Sequence[Points],
        outcomes: Sequence[str],
        labels: Sequence[str],
        movers: Sequence[Points] = (),  # noqa: ARG002 - a world has none
    ) -> Image:
        """Draws the world with all trajectories."""
        return trajectory_picture(self.nominal, runs, outcomes=outcomes, labels=labels)

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """Draws the sensors, too, in every `stride`-th step and the last one."""
        nominal, trajectory = self.nominal, rollout.trajectory
        scene = EPuckScene(nominal, movable=False)
        gaps = rollout.distances("euclidean")
        for step in trajectory.every(stride):
            outcome = rollout.outcome if step == trajectory.steps else ""
            readings = trajectory.ranges[step]
            yield scene.frame(
                trajectory.poses[step].tolist(),
                readings=readings,
                reaches=reaches(readings),
                trail=trajectory.poses[: step + 1, :2],
                solid=nominal.ground.solid,
                status=Status(step, nominal.horizon, float(gaps[step]), outcome),
            )


def reaches(readings: NDArray[np.float32]) -> Points:
    """Returns the ray lengths of ps0 to ps7 for their readings, m."""
    distances, values = TABLE[:, 0], TABLE[:, 1]
    # Reversed, since `np.interp` needs increasing readings.
    return np.asarray(np.interp(readings, values[::-1], distances[::-1]))
