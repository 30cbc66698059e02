"""Where the shortest path lies, as seen from the robot while it drove."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.verification.diagnosis.surroundings import Surroundings
from tdac_envs.drive.task import Pose
from tdac_envs.grid.plan import Path

_PATH_AHEAD = 400
_LAST_POSES = 20
_SAMPLES = 40
# Wheels that differ by less than this do not mean to turn.
_TURNING = 0.04
# Nearer to the path's direction than this there is nothing to turn to, rad.
_ALIGNED = 0.2
# Within this of the opposite direction either way will do, rad.
_OPPOSITE = 0.5
# How far ahead on the path its direction is taken, radii of the body.
_RADII = 3.0


def heading_error(
    around: Surroundings, trajectory: Trajectory, step: int
) -> float | None:
    """Direction of the shortest path seen from the heading, rad, right positive."""
    for way in _ways(around, trajectory, step):
        # A shortest path on a grid has many forms; a pulled one has a direction.
        (x, y), (to_x, to_y), *_ = around.pull(way[:_PATH_AHEAD])
        bearing = math.atan2(to_y - y, to_x - x)
        heading = float(trajectory.poses[step, 2])
        return math.remainder(bearing - heading, 2.0 * math.pi)
    return None


def way_from(around: Surroundings, trajectory: Trajectory, step: int) -> Path | None:
    """Begin of the straightened shortest path from a pose, or from one just before."""
    for way in _ways(around, trajectory, step):
        return np.array(around.pull(way[: _PATH_AHEAD // 2]))
    return None


def _ways(around: Surroundings, trajectory: Trajectory, step: int) -> Iterator[Path]:
    """Shortest paths from a pose and from those before it; at a wall there are none."""
    first = max(step - _LAST_POSES + 1, 0)
    for x, y, heading in trajectory.poses[first : step + 1][::-1].tolist():
        path = around.path_from(Pose(x, y, heading))
        if len(path) > 1:
            yield path


def goal_bearing(
    trajectory: Trajectory, goal: tuple[float, float], step: int = -1
) -> float:
    """Direction of the goal seen from the heading, rad, right positive."""
    x, y, heading = trajectory.poses[step].tolist()
    bearing = math.atan2(goal[1] - y, goal[0] - x)
    return math.remainder(bearing - heading, 2.0 * math.pi)


def turned_away(
    around: Surroundings, trajectory: Trajectory, goal: tuple[float, float]
) -> tuple[float, int]:
    """Share of steps that turned away from the shortest path and from the goal itself.

    Returns:
        The share, and the number of steps that it was taken from: the first ones with
        a turn, up to where the robot faces away from the path.
    """
    difference = trajectory.actions[:, 0] - trajectory.actions[:, 1]
    turning = np.flatnonzero(np.abs(difference) > _TURNING)
    steps = turning[:_SAMPLES].tolist()
    clear = []
    for step, error in zip(
        steps, _path_bearings(around, trajectory, steps), strict=True
    ):
        if error is not None and abs(error) > math.pi - _OPPOSITE:
            break
        if error is not None and abs(error) > _ALIGNED:
            clear.append((step, error))
    away = sum(
        error * difference[step] < 0.0
        and goal_bearing(trajectory, goal, step) * difference[step] < 0.0
        for step, error in clear
    )
    return (away / len(clear) if clear else 0.0), len(clear)


def _path_bearings(
    around: Surroundings, trajectory: Trajectory, steps: Sequence[int]
) -> Iterator[float | None]:
    """Like `heading_error` for many steps, from the nearest part of the path."""
    poses = trajectory.poses[list(steps)]
    ahead = around.places_ahead(poses[:, :2], _RADII * around.radius)
    for (x, y, heading), place in zip(poses.tolist(), ahead, strict=True):
        if place is None:
            yield None
            continue
        bearing = math.atan2(place[1] - y, place[0] - x)
        yield math.remainder(bearing - heading, 2.0 * math.pi)
