"""Where the movers of an episode are at its start: drawn, and checked."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import MAX_DRAWS, check_full_step
from tdac_envs.grid.grid import body_free
from tdac_envs.map2d.contact import first_contact
from tdac_envs.map2d.encounters import LOOK, fits, nearest_approach
from tdac_envs.map2d.terrain import Terrain
from tdac_envs.movers import state as at
from tdac_envs.movers.spec import AnySpec, BounceSpec, RouteSpec
from tdac_envs.movers.state import Movers

if TYPE_CHECKING:
    from tdac_envs.map2d.task import Map2DTask

SAFE_SECONDS = 2.0
"""No mover touches a robot that stands at its start for this time."""


@dataclass(frozen=True, slots=True)
class Placing:
    """One mover to be placed at the start of an episode.

    Attributes:
        movers: Arrays of all movers; `traits` and `points` are complete.
        m: Number of this mover.
        radius: Its radius, px.
        speed: Its speed, px/s.
        task: The task of the episode.
        random: Random numbers of the episode.
    """

    movers: Movers
    m: int
    radius: float
    speed: float
    task: Map2DTask
    random: np.random.Generator

    @property
    def reach(self) -> float:
        """Distance of the centres of robot and mover when they touch, px."""
        return self.task.robot.radius + self.radius

    def put(self, x: float, y: float, own: float) -> None:
        """Places the mover at (x, y), px; `own` is the last entry of `Movers.now`."""
        self.movers.now[self.m] = x, y, 0.0, 0.0, own

    def is_safe(self) -> bool:
        """Whether the mover, as placed, does not touch the standing robot for 2 s."""
        x, y, _ = self.task.start
        traits, now, points, pieces, *_ = self.movers
        begins = now[self.m].copy()
        clear, at_start = self.task.terrain.padded_clear, (float(x), float(y))
        least = nearest_approach(
            clear, traits, now, points, pieces, self.m, *at_start, SAFE_SECONDS
        )
        now[self.m] = begins
        return bool(least > self.reach)

    def refuse(self) -> TaskError:
        """Why the place is not safe."""
        x, y = self.movers.now[self.m, : at.Y + 1].tolist()
        start = self.task.start
        gap = math.dist((x, y), start[:2])
        if gap <= self.reach:
            return TaskError(
                f"mover {self.m} starts on the robot: their centres are {gap:.1f} px "
                f"apart and need {self.reach:.1f} px; move one of them"
            )
        return TaskError(
            f"mover {self.m} starts at ({x:.1f}, {y:.1f}) and reaches the robot, which "
            f"starts at ({start.x:.1f}, {start.y:.1f}), within {SAFE_SECONDS:g} s; "
            "move one of them"
        )

    def leaves_goal(self, places: Sequence[tuple[float, float]]) -> bool:
        """Whether the robot can reach the goal beside a mover at one of some places.

        Args:
            places: The mover is always within their convex hull, px.
        """
        farthest = max(math.dist(self.task.goal, place) for place in places)
        return farthest + self.task.goal_tolerance >= self.reach

    def check_leaves_goal(self, places: Sequence[tuple[float, float]]) -> None:
        """Checks `leaves_goal`.

        Raises:
            TaskError: The robot could never reach the goal.
        """
        if not self.leaves_goal(places):
            x, y = self.task.goal
            raise TaskError(
                f"mover {self.m} covers the goal ({x:.1f}, {y:.1f}) for ever; move one "
                "of them"
            )


def place_movers(
    specs: Sequence[AnySpec], task: Map2DTask, random: np.random.Generator
) -> Movers:
    """The movers of an episode at its start.

    Args:
        specs: From `movers.spec.read_specs`.
        task: The task; its movers are ignored.
        random: Random numbers of the episode.

    Raises:
        TaskError: A route runs through a wall, a mover touches the robot within 2 s, or
            covers the goal for ever; the message names the mover.
    """
    each = [spec for spec in specs for _ in range(spec.number)]
    rounds = [Round.of(s).points if isinstance(s, RouteSpec) else () for s in each]
    points = [point for places in rounds for point in places]
    movers, first = Movers.blank(len(each), np.array(points), task.dt), 0
    robot = task.robot
    for m, (spec, places) in enumerate(zip(each, rounds, strict=True)):
        radius = robot.radius if spec.radius is None else spec.radius
        speed = 0.5 * robot.max_wheel_speed if spec.speed is None else spec.speed
        check_full_step(max(task.dt, LOOK), speed, "px")
        kind, place = _KINDS[spec.kind]
        movers.traits[m] = kind, radius, speed, first, len(places)
        first += len(places)
        place(spec, Placing(movers, m, radius, speed, task, random))
    return movers


@dataclass(frozen=True, slots=True)
class Round:
    """One round of a route: there and back, if it is not a loop.

    Attributes:
        points: The way-points, px.
        ends: Length of the round up to the way-point after each, px.
    """

    points: tuple[tuple[float, float], ...]
    ends: tuple[float, ...]

    @classmethod
    def of(cls, spec: RouteSpec) -> Round:
        """The round of a route, from a cache."""
        return _round_of(spec)

    def place(self, phase: float) -> tuple[float, float, float]:
        """The place at a part of the length, and the number of the next way-point."""
        along, count = phase * self.ends[-1], len(self.points)
        leg = min(bisect_right(self.ends, along), count - 1)
        (x, y), (to_x, to_y) = self.points[leg], self.points[(leg + 1) % count]
        begin = self.ends[leg - 1] if leg else 0.0
        length = self.ends[leg] - begin
        part = (along - begin) / length if length else 0.0
        return x + part * (to_x - x), y + part * (to_y - y), float((leg + 1) % count)

    def most_points(self, length: float) -> int:
        """Largest number of way-points in a piece of this length, or a few more."""
        legs = np.diff(self.ends, prepend=0.0)
        if len(legs) == 1 or length < legs.min():
            return 1
        further = np.resize(legs, len(legs) + at.MOST_PIECES)
        at_points = np.concatenate([[0.0], np.cumsum(further)])
        until = np.searchsorted(at_points, at_points[: len(legs)] + length, "right")
        return int((until - np.arange(len(legs))).max())


@lru_cache(maxsize=1024)
def _round_of(spec: RouteSpec) -> Round:
    points = spec.points if spec.loop else (*spec.points, *spec.points[-2:0:-1])
    following = (*points[1:], points[0])
    legs = [math.dist(*ends) for ends in zip(points, following, strict=True)]
    return Round(points, tuple(accumulate(legs)))


def _place_route(spec: RouteSpec, placing: Placing) -> None:
    own, task = Round.of(spec), placing.task
    full_step = placing.speed * task.dt
    fault = _fault_of_route(task.terrain, spec, placing.radius, full_step)
    if fault:
        raise TaskError(f"mover {placing.m}: {fault}")
    placing.check_leaves_goal(own.points if placing.speed else own.points[:1])
    if spec.phase is not None or len(own.points) == 1:
        placing.put(*own.place(spec.phase or 0.0))
        if not placing.is_safe():
            raise placing.refuse()
        return
    for _ in range(MAX_DRAWS):
        placing.put(*own.place(placing.random.random()))
        if placing.is_safe():
            return
    raise TaskError(
        f"mover {placing.m} reaches the robot within {SAFE_SECONDS:g} s wherever it "
        "starts on its route; move the route or the start"
    )


@lru_cache(maxsize=256)
def _fault_of_route(
    terrain: Terrain, spec: RouteSpec, radius: float, full_step: float
) -> str:
    """What is wrong with a route, or an empty text."""
    clear, points = terrain.padded_clear, spec.points
    ends = [*points, points[0]] if spec.loop else [*points]
    for k, (x, y) in enumerate(points):
        if not fits(clear, x, y, radius):
            what = f"way-point {k} at" if len(points) > 1 else "it stands at"
            where = f"({x:.1f}, {y:.1f})"
            return f"{what} {where}, where its radius of {radius:g} px hits a wall"
    for k in range(len(ends) - 1 if len(points) > 1 else 0):
        (x, y), (to_x, to_y) = ends[k], ends[k + 1]
        length, heading = (
            math.dist(ends[k], ends[k + 1]),
            math.atan2(to_y - y, to_x - x),
        )
        touch = first_contact(clear, x, y, heading, length, 0.0, radius)
        if touch <= 1.0:
            at_x, at_y = x + touch * (to_x - x), y + touch * (to_y - y)
            return (
                f"segment {k} of its route, from ({x:.1f}, {y:.1f}) to ({to_x:.1f}, "
                f"{to_y:.1f}), runs into a wall at ({at_x:.1f}, {at_y:.1f})"
            )
    if Round.of(spec).most_points(full_step) > at.MOST_PIECES - 2:
        return (
            f"it would pass more than {at.MOST_PIECES - 2} way-points in a step; use a "
            "lower speed or fewer way-points"
        )
    return ""


def _place_bounce(spec: BounceSpec, placing: Placing) -> None:
    task, random, radius = placing.task, placing.random, placing.radius
    if spec.start is not None and not fits(
        task.terrain.padded_clear, *spec.start, radius
    ):
        x, y = spec.start
        raise TaskError(
            f"mover {placing.m}: it starts at ({x:.1f}, {y:.1f}), where its radius of "
            f"{radius:g} px hits a wall"
        )
    drawn = spec.start is None or spec.heading is None
    for _ in range(MAX_DRAWS if drawn else 1):
        x, y = spec.start or _drawn_place(task.terrain, radius, placing)
        heading = spec.heading
        if heading is None:
            heading = random.uniform(-math.pi, math.pi)
        placing.put(x, y, heading)
        if placing.is_safe() and (placing.speed or placing.leaves_goal([(x, y)])):
            return
    if not placing.speed:
        placing.check_leaves_goal([(x, y)])
    if not drawn:
        raise placing.refuse()
    raise TaskError(
        f"mover {placing.m}: no start was found from which it stays away from the "
        f"robot for {SAFE_SECONDS:g} s; make it slower or smaller"
    )


def _drawn_place(
    terrain: Terrain, radius: float, placing: Placing
) -> tuple[float, float]:
    """A random pixel where a disc fits."""
    places = _places(terrain, radius)
    if not places.size:
        raise TaskError(
            f"mover {placing.m}: a disc of {radius:g} px radius fits nowhere; the "
            f"largest clearance is {float(terrain.clear.max()):.1f} px"
        )
    index = int(places[placing.random.integers(places.size)])
    y, x = divmod(index, terrain.grid.width)
    return float(x), float(y)


@lru_cache(maxsize=16)
def _places(terrain: Terrain, radius: float) -> NDArray[np.int64]:
    """Indices of the pixels where a disc fits."""
    return np.flatnonzero(body_free(terrain.clear, radius))


def _place_person(_: Any, placing: Placing) -> None:
    raise TaskError(f"mover {placing.m}: crowds are not available yet")


_KINDS: dict[str, tuple[int, Callable[[Any, Placing], None]]] = {
    "route": (at.ROUTE, _place_route),
    "bounce": (at.BOUNCE, _place_bounce),
    "crowd": (at.CROWD, _place_person),
}
