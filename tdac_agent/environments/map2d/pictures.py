"""Pictures of episodes on a map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.environments.map2d.setting import Map2DSetting
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
    """See `Pictures`."""

    setting: Map2DSetting

    def backdrop(self) -> Background:
        """Returns the map as a background."""
        return backdrop_of(self.setting.nominal)

    def trajectories(
        self,
        runs: Sequence[Points],
        outcomes: Sequence[str],
        labels: Sequence[str],
        movers: Sequence[Points] = (),
    ) -> Image:
        """Draws the map with all trajectories, and the movers of the first one."""
        nominal = self.setting.nominal
        return trajectories_of(nominal, runs, outcomes, labels, movers)

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """Draws frames of the robot with its rays."""
        setting = self.setting
        return frames_of(
            setting.nominal, rollout, stride, setting.robot_image, setting.shown_in
        )


def backdrop_of(nominal: Map2DTask) -> Background:
    """Returns the map of a task as a background."""
    return Background.of(nominal)


def trajectories_of(
    nominal: Map2DTask,
    runs: Sequence[Points],
    outcomes: Sequence[str],
    labels: Sequence[str],
    movers: Sequence[Points] = (),
) -> Image:
    """See `Pictures.trajectories`."""
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
    )


def frames_of(
    nominal: Map2DTask,
    rollout: Rollout,
    stride: int,
    robot_image: Path = ROBOT_IMAGE,
    units: MapUnits = PIXELS,
) -> Iterator[Image]:
    """Draws every `stride`-th step of an episode and the last one.

    Args:
        nominal: Task of the episode.
        rollout: The episode.
        stride: Steps between two frames.
        robot_image: Picture of the robot.
        units: Units of the figures shown.
    """
    trajectory = rollout.trajectory
    scene = MapScene(
        nominal.terrain.grid.cells,
        trajectory.poses[0].tolist(),
        nominal.goal,
        goal_tolerance=nominal.goal_tolerance,
        robot=nominal.robot,
        path=nominal.shortest_path(nominal.start),
        robot_image=robot_image,
        units=units,
    )
    gaps, last = rollout.distances("euclidean"), trajectory.steps
    for step in rollout.trajectory.every(stride):
        outcome = rollout.outcome if step == last else ""
        status = Status(step, nominal.horizon, float(gaps[step]), outcome)
        trail = trajectory.poses[: step + 1, :2]
        pose = trajectory.poses[step].tolist()
        ghosts = trajectory.ghosts(step)
        yield scene.frame(pose, trajectory.ranges[step], trail, status, ghosts)
