"""Pictures of episodes on a map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.units import Points
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.runs import Status
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.map2d.picture import ROBOT_IMAGE, MapScene
from tdac_envs.map2d.run_picture import Background, trajectory_picture
from tdac_envs.map2d.task import Map2DTask


@dataclass(frozen=True, slots=True, eq=False)
class MapPictures:
    """See `Pictures`.

    Attributes:
        nominal: Task of the episodes.
        robot_image: Picture of the robot.
        units: Units of the figures shown.
    """

    nominal: Map2DTask
    robot_image: Path = ROBOT_IMAGE
    units: MapUnits = PIXELS

    def backdrop(self) -> Background:
        """Returns the map as a background."""
        return Background.of(self.nominal)

    def trajectories(
        self,
        runs: Sequence[Points],
        outcomes: Sequence[str],
        labels: Sequence[str],
        movers: Sequence[Points] = (),
    ) -> Image:
        """Draws the map with all trajectories, and the movers of the first one."""
        nominal = self.nominal
        return trajectory_picture(
            nominal.terrain.grid.cells,
            runs,
            nominal.start,
            nominal.goal,
            goal_tolerance=nominal.goal_tolerance,
            radius=nominal.robot.radius,
            path=nominal.shortest_path(nominal.start),
            outcomes=outcomes,
            labels=labels,
            movers=movers,
            units=self.units,
        )

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """Draws the robot with its rays in every `stride`-th step and the last one."""
        nominal, trajectory = self.nominal, rollout.trajectory
        scene = MapScene(
            nominal.terrain.grid.cells,
            trajectory.poses[0].tolist(),
            nominal.goal,
            goal_tolerance=nominal.goal_tolerance,
            robot=nominal.robot,
            path=nominal.shortest_path(nominal.start),
            robot_image=self.robot_image,
            units=self.units,
        )
        gaps = rollout.distances("euclidean")
        for step in trajectory.every(stride):
            outcome = rollout.outcome if step == trajectory.steps else ""
            yield scene.frame(
                trajectory.poses[step].tolist(),
                trajectory.ranges[step],
                trajectory.poses[: step + 1, :2],
                Status(step, nominal.horizon, float(gaps[step]), outcome),
                trajectory.ghosts(step),
            )
