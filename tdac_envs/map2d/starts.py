"""Where a mover of each kind starts, checked on a map."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import body_free
from tdac_envs.map2d.contact import first_contact
from tdac_envs.map2d.encounters import fits
from tdac_envs.map2d.terrain import Terrain
from tdac_envs.movers import state as at
from tdac_envs.movers.spec import BounceSpec, RouteSpec

if TYPE_CHECKING:
    from tdac_envs.map2d.task import Map2DTask

Point = tuple[float, float]
Place = tuple[float, float, float]
"""x, y (px) and the last entry of `Movers.now`."""
Random = np.random.Generator


class Start(Protocol):
    """Where one mover starts."""

    @property
    def kind(self) -> int:
        """Its kind in `Movers.traits`."""

    @property
    def points(self) -> tuple[Point, ...]:
        """Waypoints of its round, if it has a route."""

    @property
    def is_drawn(self) -> bool:
        """Whether it starts elsewhere in each episode."""

    def place(self, random: Random) -> Place:
        """Draws where it starts."""

    def stays_within(self) -> Sequence[Point]:
        """Points whose convex hull the mover never leaves; empty if unknown."""


@dataclass(frozen=True, slots=True)
class RouteStart:
    """A route, of which one round goes there and back if it is not a loop.

    Attributes:
        points: The waypoints of a round, px.
        ends: Length of the round up to the waypoint after each, px.
        phase: Part of the round at which it starts; None if drawn.
        stands: Whether the mover never moves.
        kind: See `Start`.
    """

    points: tuple[Point, ...]
    ends: tuple[float, ...]
    phase: float | None
    stands: bool
    kind: int = at.ROUTE

    @classmethod
    def of(
        cls, spec: RouteSpec, task: Map2DTask, radius: float, speed: float
    ) -> RouteStart:
        """The route of a disc, checked on the map of a task.

        Raises:
            TaskError: It runs into a wall, or has too many waypoints for its speed.
        """
        points = spec.points if spec.loop else (*spec.points, *spec.points[-2:0:-1])
        _check_route(task.terrain, spec, radius)
        following = (*points[1:], points[0])
        legs = [math.dist(*ends) for ends in zip(points, following, strict=True)]
        stands = len(points) == 1 or speed == 0.0
        phase = 0.0 if len(points) == 1 else spec.phase
        route = cls(points, tuple(accumulate(legs)), phase, stands)
        if route._most_points(speed * task.dt) > at.MOST_PIECES - 2:
            raise TaskError(
                f"it would pass more than {at.MOST_PIECES - 2} waypoints in a step; "
                "use a lower speed or fewer waypoints"
            )
        return route

    @property
    def is_drawn(self) -> bool:
        """See `Start`."""
        return self.phase is None

    def place(self, random: Random) -> Place:
        """See `Start`; the last entry is the number of the next waypoint."""
        phase = random.random() if self.phase is None else self.phase
        along, count = phase * self.ends[-1], len(self.points)
        leg = min(bisect_right(self.ends, along), count - 1)
        (x, y), (to_x, to_y) = self.points[leg], self.points[(leg + 1) % count]
        begin = self.ends[leg - 1] if leg else 0.0
        length = self.ends[leg] - begin
        part = (along - begin) / length if length else 0.0
        return x + part * (to_x - x), y + part * (to_y - y), float((leg + 1) % count)

    def stays_within(self) -> Sequence[Point]:
        """See `Start`."""
        if self.stands and self.phase is not None:
            x, y, _ = self.place(np.random.default_rng(0))
            return ((x, y),)
        return self.points

    def _most_points(self, length: float) -> int:
        """Largest number of waypoints in a piece of this length, or a few more."""
        legs = np.diff(self.ends, prepend=0.0)
        if len(legs) == 1 or length < legs.min():
            return 1
        further = np.resize(legs, len(legs) + at.MOST_PIECES)
        at_points = np.concatenate([[0.0], np.cumsum(further)])
        until = np.searchsorted(at_points, at_points[: len(legs)] + length, "right")
        return int((until - np.arange(len(legs))).max())


def _check_route(terrain: Terrain, spec: RouteSpec, radius: float) -> None:
    """Checks that a disc on a route enters no wall.

    Raises:
        TaskError: It does; the message names the segment.
    """
    clear, points = terrain.padded_clear, spec.points
    ends = [*points, points[0]] if spec.loop else [*points]
    for k, (x, y) in enumerate(points):
        if not fits(clear, x, y, radius):
            what = f"waypoint {k} of its route is" if len(points) > 1 else "it stands"
            raise TaskError(
                f"{what} at ({x:.1f}, {y:.1f}), where its radius of {radius:g} px does "
                "not fit"
            )
    for k in range(len(ends) - 1 if len(points) > 1 else 0):
        (x, y), (to_x, to_y) = ends[k], ends[k + 1]
        length, heading = (
            math.dist(ends[k], ends[k + 1]),
            math.atan2(to_y - y, to_x - x),
        )
        touch = first_contact(clear, x, y, heading, length, 0.0, radius)
        if touch <= 1.0:
            at_x, at_y = x + touch * (to_x - x), y + touch * (to_y - y)
            raise TaskError(
                f"segment {k} of its route, from ({x:.1f}, {y:.1f}) to ({to_x:.1f}, "
                f"{to_y:.1f}), runs into a wall at ({at_x:.1f}, {at_y:.1f})"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Bouncer:
    """Where a bouncing disc starts.

    Attributes:
        fixed_place: The place, px; None if drawn.
        heading: The heading, rad; None if drawn.
        stands: Whether the mover never moves.
        places: Indices of the pixels where the disc fits.
        width: Width of the map, px.
        points: See `Start`.
        kind: See `Start`.
    """

    fixed_place: Point | None
    heading: float | None
    stands: bool
    places: NDArray[np.int64]
    width: int
    points: tuple[Point, ...] = ()
    kind: int = at.BOUNCE

    @classmethod
    def of(
        cls, spec: BounceSpec, task: Map2DTask, radius: float, speed: float
    ) -> Bouncer:
        """A bouncing disc, checked on the map of a task.

        Raises:
            TaskError: It does not fit.
        """
        terrain = task.terrain
        places = np.flatnonzero(body_free(terrain.clear, radius))
        if spec.start is not None:
            x, y = spec.start
            if not fits(terrain.padded_clear, x, y, radius):
                raise TaskError(
                    f"it starts at ({x:.1f}, {y:.1f}), where its radius of {radius:g} "
                    "px does not fit"
                )
        elif not places.size:
            raise TaskError(
                f"a disc of {radius:g} px radius fits nowhere; the largest clearance "
                f"is {float(terrain.clear.max()):.1f} px"
            )
        return cls(spec.start, spec.heading, not speed, places, terrain.grid.width)

    @property
    def is_drawn(self) -> bool:
        """See `Start`."""
        return self.fixed_place is None or self.heading is None

    def place(self, random: Random) -> Place:
        """See `Start`; the last entry is the heading."""
        if self.fixed_place is None:
            row, column = divmod(
                int(self.places[random.integers(self.places.size)]), self.width
            )
            x, y = float(column), float(row)
        else:
            x, y = self.fixed_place
        if self.heading is None:
            return x, y, random.uniform(-math.pi, math.pi)
        return x, y, self.heading

    def stays_within(self) -> Sequence[Point]:
        """See `Start`."""
        return (self.fixed_place,) if self.stands and self.fixed_place else ()


@dataclass(frozen=True, slots=True, eq=False)
class Person:
    """Where a person of a crowd starts.

    Attributes:
        nodes: Places that it may start at, shape (n, 2), px.
        goals: Number of places that people walk to.
        is_drawn: See `Start`.
        points: See `Start`.
        kind: See `Start`.
    """

    nodes: NDArray[np.float64]
    goals: int
    is_drawn: bool = True
    points: tuple[Point, ...] = ()
    kind: int = at.CROWD

    def place(self, random: Random) -> Place:
        """See `Start`; the last entry is the number of its first place."""
        x, y = self.nodes[random.integers(len(self.nodes))].tolist()
        return x, y, float(random.integers(self.goals))

    def stays_within(self) -> Sequence[Point]:
        """See `Start`."""
        return ()


KINDS: dict[str, Callable[[Any, Any, float, float], Start]] = {
    "route": RouteStart.of,
    "bounce": Bouncer.of,
}
"""The start of a scripted mover: from its entry, task, radius (px) and speed (px/s)."""
