"""The interface to a map or world that diagnoses use, in units of the screen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

import numpy as np

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Points, Units
from tdac_agent.verification.diagnosis.touch import Touch
from tdac_envs.drive.task import Pose
from tdac_envs.grid.plan import Path

Point = tuple[float, float]


class Surroundings(Protocol):
    """A task's map or world; positions and lengths as in `units`."""

    @property
    def units(self) -> Units:
        """Units of the environment."""

    @property
    def radius(self) -> float:
        """Radius of the body."""

    @property
    def full_speed(self) -> float:
        """Full speed of the body, units of length per second."""

    def shown_in(self, units: Units) -> Surroundings:
        """The same with texts in other units, from `Setting.shown`."""

    def touch(self, pose: Pose, reach: float) -> Touch | None:
        """What the body touches, or would touch first, within `reach`."""

    def seen(self, touch: Touch, trajectory: Trajectory) -> str:
        """What the distance sensors saw of what was touched, as text."""

    def in_sight(self, pose: Pose, place: Point, radius: float) -> bool:
        """Whether the distance sensors at a pose can see a disc.

        Its centre is in their field of view, and no wall is in between.
        """

    def path_from(self, pose: Pose) -> Path:
        """Shortest grid path to the goal, shape (n, 2); empty where there is none."""

    def pull(self, path: Path) -> list[Point]:
        """Corners of a path after every shortcut that the body can take."""

    def places_ahead(self, places: Points, far: float) -> Iterator[Point | None]:
        """First point `far` away on each position's shortest path, or its end."""

    def mistaken_goals(self) -> dict[str, Point]:
        """Where the goal would be with mixed-up coordinates, by name of the mistake."""


def surroundings_of(task: Nominal, shown: Units | None = None) -> Surroundings:
    """The surroundings of a task; `shown` are the units of texts, if others."""
    around = environment(task.env_id).surroundings(task)
    return around if shown is None else around.shown_in(shown)


def trajectory_on_screen(trajectory: Trajectory, units: Units) -> Trajectory:
    """Converts a trajectory to units of the screen."""
    movers = trajectory.movers
    if movers is not None:
        places = units.on_screen(movers[..., :2].reshape(-1, 2))
        movers = np.dstack(
            [places.reshape(*movers.shape[:2], 2), movers[..., 2] * units.scale]
        ).astype(np.float32)
    return replace(
        trajectory,
        movers=movers,
        poses=units.on_screen(trajectory.poses),
        path_distances=trajectory.path_distances * units.scale,
    )


def rollout_on_screen(rollout: Rollout, units: Units) -> Rollout:
    """Converts an episode to units of the screen."""
    (goal,) = units.on_screen([rollout.goal])
    return replace(
        rollout,
        trajectory=trajectory_on_screen(rollout.trajectory, units),
        goal=(float(goal[0]), float(goal[1])),
        radius=rollout.radius * units.scale,
        tolerance=rollout.tolerance * units.scale,
    )
