"""Pictures of episodes on a map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tdac_agent.environments.map2d.setting import Map2DSetting
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.units import Points
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.runs import Status
from tdac_envs.map2d.picture import MapScene
from tdac_envs.map2d.run_picture import Background, trajectory_picture


@dataclass(frozen=True, slots=True, eq=False)
class MapPictures:
    """See `Pictures`."""

    setting: Map2DSetting

    def backdrop(self) -> Background:
        """Returns the map as a background."""
        return Background.of(self.setting.nominal)

    def trajectories(
        self, runs: Sequence[Points], outcomes: Sequence[str], labels: Sequence[str]
    ) -> Image:
        """Draws the map with all trajectories."""
        nominal = self.setting.nominal
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
        )

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """Draws frames of the robot with its rays."""
        nominal, trajectory = self.setting.nominal, rollout.trajectory
        scene = MapScene(
            nominal.terrain.grid.cells,
            trajectory.poses[0].tolist(),
            nominal.goal,
            goal_tolerance=nominal.goal_tolerance,
            robot=nominal.robot,
            path=nominal.shortest_path(nominal.start),
            robot_image=self.setting.robot_image,
            units=self.setting.shown_in,
        )
        gaps, last = rollout.distances("euclidean"), trajectory.steps
        for step in rollout.trajectory.every(stride):
            outcome = rollout.outcome if step == last else ""
            status = Status(step, nominal.horizon, float(gaps[step]), outcome)
            trail = trajectory.poses[: step + 1, :2]
            pose = trajectory.poses[step].tolist()
            yield scene.frame(pose, trajectory.ranges[step], trail, status)
