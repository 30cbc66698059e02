"""Interfaces of what an environment provides for pictures and diagnoses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Protocol

from tdac_agent.tasks.units import Point, Points, Units
from tdac_envs.drive.task import Pose
from tdac_envs.grid.plan import Path

if TYPE_CHECKING:
    from tdac_agent.episodes.trajectory import Rollout, Trajectory
    from tdac_agent.verification.diagnosis.touch import Touch
    from tdac_envs.drawing.backdrop import Backdrop
    from tdac_envs.drawing.canvas import Image


class Pictures(Protocol):
    """Draws the episodes of a task."""

    def backdrop(self) -> Backdrop:
        """Returns the background of the pictures of failed episodes."""

    def trajectories(
        self,
        runs: Sequence[Points],
        outcomes: Sequence[str],
        labels: Sequence[str],
        movers: Sequence[Points] = (),
    ) -> Image:
        """Draws the poses of episodes, each of shape (T + 1, 3), in one picture.

        Args:
            runs: The poses.
            outcomes: Outcome of each episode.
            labels: Name of each episode.
            movers: Movers at the end of the first episode; see `Trajectory.ghosts`.
        """

    def frames(self, rollout: Rollout, stride: int) -> Iterator[Image]:
        """Draws every `stride`-th step and the last one."""


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
