"""Pictures of judged episodes."""

from __future__ import annotations

from pathlib import Path

import cv2

from tdac_agent.files import write_atomic
from tdac_agent.task import Task
from tdac_agent.trajectory import Trajectory
from tdac_envs.render import trajectory_picture


def draw_trajectories(
    task: Task,
    trajectories: dict[str, Trajectory],
    outcomes: dict[str, str],
    path: Path,
) -> None:
    """Writes a PNG of the map with each trajectory.

    Args:
        task: Whose map.
        trajectories: By episode name.
        outcomes: By episode name.
        path: The file.
    """
    nominal = task.nominal
    picture = trajectory_picture(
        nominal.terrain.grid.cells,
        [trajectory.poses for trajectory in trajectories.values()],
        nominal.start,
        nominal.goal,
        goal_tolerance=nominal.goal_tolerance,
        radius=nominal.robot.radius,
        path=nominal.path_from(nominal.start),
        outcomes=[outcomes.get(name, "") for name in trajectories],
        labels=list(trajectories),
    )
    encoded = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1]
    write_atomic(path, encoded.tobytes())
