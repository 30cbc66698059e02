"""Direction of the shortest path and the goal, as seen from the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.parts import Surroundings
from tdac_envs.drive.task import Pose
from tdac_envs.grid.plan import Path

_PATH_AHEAD = 400
_LAST_POSES = 20
_SAMPLES = 40
# Wheel speeds that differ by less than this do not count as a turn.
_TURNING = 0.04
# A heading error below this needs no turn, rad.
_ALIGNED = 0.2
# Within this angle of the opposite direction, a turn to either side is right, rad.
_OPPOSITE = 0.5
# Distance ahead on the path at which its direction is taken, body radii.
_RADII = 3.0


def heading_error(
    around: Surroundings, trajectory: Trajectory, step: int
) -> float | None:
    """Angle from the heading to the shortest path, rad, right positive."""
    for path in _paths_until(around, trajectory, step):
        # Grid paths of equal length differ in direction; a straightened path has one.
        (x, y), corner, *_ = around.pull(path[:_PATH_AHEAD])
        return _turn_to((x, y, float(trajectory.poses[step, 2])), corner)
    return None


def path_ahead(around: Surroundings, trajectory: Trajectory, step: int) -> Path | None:
    """Start of the straightened shortest path from a pose, or from one just before."""
    for path in _paths_until(around, trajectory, step):
        return np.array(around.pull(path[: _PATH_AHEAD // 2]))
    return None


def _paths_until(
    around: Surroundings, trajectory: Trajectory, step: int
) -> Iterator[Path]:
    """Shortest paths from a pose and earlier ones; a pose at a wall has none."""
    first = max(step - _LAST_POSES + 1, 0)
    for x, y, heading in trajectory.poses[first : step + 1][::-1].tolist():
        path = around.path_from(Pose(x, y, heading))
        if len(path) > 1:
            yield path


def goal_bearing(
    trajectory: Trajectory, goal: tuple[float, float], step: int = -1
) -> float:
    """Angle from the heading to the goal, rad, right positive."""
    return _turn_to(trajectory.poses[step].tolist(), goal)


def turned_away(
    around: Surroundings, trajectory: Trajectory, goal: tuple[float, float]
) -> tuple[float, int]:
    """Share of turning steps that turned away from both the shortest path and the goal.

    Returns:
        The share, and the number of steps it is taken over: the first steps with a turn
        and a heading error, until the robot faces away from the path.
    """
    difference = trajectory.actions[:, 0] - trajectory.actions[:, 1]
    turning = np.flatnonzero(np.abs(difference) > _TURNING)
    steps = turning[:_SAMPLES].tolist()
    clear = []
    errors = _path_bearings(around, trajectory, steps)
    for step, error in zip(steps, errors, strict=True):
        if abs(error or 0.0) > math.pi - _OPPOSITE:
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
    """Like `heading_error` for many steps, by a point a few radii ahead on the path."""
    poses = trajectory.poses[list(steps)]
    ahead = around.places_ahead(poses[:, :2], _RADII * around.radius)
    for pose, place in zip(poses.tolist(), ahead, strict=True):
        yield None if place is None else _turn_to(pose, place)


def _turn_to(pose: Sequence[float], place: Sequence[float]) -> float:
    """Angle from the heading of a pose to a place, rad, right positive."""
    x, y, heading = pose
    bearing = math.atan2(place[1] - y, place[0] - x)
    return math.remainder(bearing - heading, 2.0 * math.pi)
