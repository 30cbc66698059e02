"""The record of a run of a Webots controller."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tdac_envs.epuck.env import EPuckEnv

Outcome = Literal["reached", "out of time", "teleport", "quit"]
Pose = tuple[float, float, float]


@dataclass(slots=True)
class Log:
    """Record of a run.

    Attributes:
        poses: Poses x, y (m), heading (rad), start included.
        actions: Wheel speeds as fractions of the maximum, shape (2,), float32.
        path_distances: Lengths of the shortest path to the goal, m.
        distances: Straight-line distances to the goal, m.
        collisions: Number of steps with a contact.
        first_contact: Step, x and y (m) of the first contact.
        outcome: How the simulation ended; None while it runs.
        teleport: The forbidden supervisor call that ended the run, if any.
    """

    poses: list[Pose] = field(default_factory=list)
    actions: list[NDArray[np.float32]] = field(default_factory=list)
    path_distances: list[float] = field(default_factory=list)
    distances: list[float] = field(default_factory=list)
    collisions: int = 0
    first_contact: tuple[int, float, float] | None = None
    outcome: Outcome | None = None
    teleport: str | None = None

    @property
    def steps(self) -> int:
        """Number of world steps so far."""
        return len(self.actions)

    def note(self, env: EPuckEnv, info: dict[str, Any]) -> None:
        """Records the current pose, distances and contacts."""
        x, y, heading = env.pose().tolist()
        self.poses.append((x, y, heading))
        self.path_distances.append(info["path_distance"])
        self.distances.append(info["distance_to_goal"])
        self.collisions = info["collisions"]
        if info["collision"] and self.first_contact is None:
            self.first_contact = (self.steps, x, y)


def driven_length(log: Log) -> float:
    """Length of the driven path, m."""
    places = np.array(log.poses)[:, :2]
    return float(np.hypot(*np.diff(places, axis=0).T).sum())


def velocity(poses: Sequence[Pose], dt: float) -> tuple[float, float]:
    """Mean velocity (x, y) in the last step, m/s; 0 before the first."""
    if len(poses) < 2:
        return 0.0, 0.0
    (x, y, _), (before_x, before_y, _) = poses[-1], poses[-2]
    return (x - before_x) / dt, (y - before_y) / dt


def turn_rate(poses: Sequence[Pose], dt: float) -> float:
    """Mean turn rate in the last step, rad/s; 0 before the first."""
    if len(poses) < 2:
        return 0.0
    return math.remainder(poses[-1][2] - poses[-2][2], 2.0 * math.pi) / dt
