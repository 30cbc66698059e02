"""Where the movers of an episode are at its start: drawn, and checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
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
Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Placing:
    """One mover to be placed at the start of an episode.

    Attributes:
        movers: Arrays of all movers; `traits` and `points` are complete.
        m: Number of this mover.
        task: The task of the episode.
        random: Random numbers of the episode.
    """

    movers: Movers
    m: int
    task: Map2DTask
    random: np.random.Generator

    @property
    def reach(self) -> float:
        """Distance of the centres of robot and mover when they touch, px."""
        radius: float = self.movers.traits[self.m, at.RADIUS]
        return self.task.robot.radius + radius

    def put(self, x: float, y: float, own: float) -> None:
        """Places the mover at (x, y), px; `own` is the last entry of `Movers.now`."""
        self.movers.now[self.m] = x, y, 0.0, 0.0, own

    def is_safe(self) -> bool:
        """Whether the mover, as placed, does not touch the standing robot for 2 s."""
        movers, start = self.movers, self.task.start
        now = movers.now.copy()
        least = nearest_approach(
            self.task.terrain.padded_clear,
            movers.traits,
            now,
            movers.points,
            movers.pieces,
            self.m,
            float(start.x),
            float(start.y),
            SAFE_SECONDS,
        )
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

    def check_leaves_goal(self, places: Points) -> None:
        """Checks that a mover that stays among some places may leave the goal.

        Args:
            places: Shape (n, 2); the mover is always within their convex hull, px.

        Raises:
            TaskError: The robot could never reach the goal.
        """
        goal, tolerance = self.task.goal, self.task.goal_tolerance
        farthest = max(math.dist(goal, place) for place in places.tolist())
        if farthest + tolerance < self.reach:
            raise TaskError(
                f"mover {self.m} covers the goal ({goal[0]:.1f}, {goal[1]:.1f}) for "
                "ever; move one of them"
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
    routes = [whole_route(s) if isinstance(s, RouteSpec) else None for s in each]
    lengths = [0 if route is None else len(route) for route in routes]
    given = [route for route in routes if route is not None]
    points = np.concatenate(given) if given else np.empty((0, 2))
    movers, first = Movers.blank(len(each), points, task.dt), 0
    robot = task.robot
    for m, (spec, count) in enumerate(zip(each, lengths, strict=True)):
        radius = robot.radius if spec.radius is None else spec.radius
        speed = 0.5 * robot.max_wheel_speed if spec.speed is None else spec.speed
        check_full_step(max(task.dt, LOOK), speed, "px")
        kind, place = _KINDS[spec.kind]
        movers.traits[m] = kind, radius, speed, first, count
        first += count
        place(spec, Placing(movers, m, task, random))
    return movers


def whole_route(spec: RouteSpec) -> Points:
    """The way-points of one round of a route, also of the way back, shape (n, 2)."""
    points = np.array(spec.points, np.float64)
    return points if spec.loop else np.vstack([points, points[-2:0:-1]])


def _place_route(spec: RouteSpec, placing: Placing) -> None:
    points, traits = whole_route(spec), placing.movers.traits[placing.m]
    radius, speed = float(traits[at.RADIUS]), float(traits[at.SPEED])
    task = placing.task
    fault = _fault_of_route(task.terrain, spec, radius, speed * task.dt)
    if fault:
        raise TaskError(f"mover {placing.m}: {fault}")
    placing.check_leaves_goal(points if speed else points[:1])
    if spec.phase is not None or len(points) == 1:
        placing.put(*_at_phase(points, spec.phase or 0.0))
        if not placing.is_safe():
            raise placing.refuse()
        return
    for _ in range(MAX_DRAWS):
        placing.put(*_at_phase(points, placing.random.random()))
        if placing.is_safe():
            return
    raise TaskError(
        f"mover {placing.m} reaches the robot within {SAFE_SECONDS:g} s wherever it "
        "starts on its route; move the route or the start"
    )


def _at_phase(points: Points, phase: float) -> tuple[float, float, float]:
    """The place on a route at a part of its length, and the next way-point."""
    legs = np.roll(points, -1, axis=0) - points
    ends = np.cumsum(np.hypot(*legs.T))
    along = phase * float(ends[-1])
    leg = min(int(np.searchsorted(ends, along, "right")), len(points) - 1)
    length = float(ends[leg] - (ends[leg - 1] if leg else 0.0))
    part = 1.0 - (float(ends[leg]) - along) / length if length else 0.0
    x, y = (points[leg] + part * legs[leg]).tolist()
    return x, y, float((leg + 1) % len(points))


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
    if _most_points(whole_route(spec), full_step) > at.MOST_PIECES - 2:
        return (
            f"it would pass more than {at.MOST_PIECES - 2} way-points in a step; use a "
            "lower speed or fewer way-points"
        )
    return ""


def _most_points(points: Points, length: float) -> int:
    """Largest number of way-points that a piece of a route of this length contains."""
    legs = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    if len(points) == 1 or length < legs.min():
        return 1
    most = at.MOST_PIECES - 1
    windows = np.concatenate([[0.0], np.cumsum(np.resize(legs, len(legs) + most))])
    spans = np.searchsorted(windows, windows[: len(legs)] + length, "right")
    return int((spans - np.arange(len(legs))).max())


def _place_bounce(spec: BounceSpec, placing: Placing) -> None:
    task, random = placing.task, placing.random
    radius, speed = placing.movers.traits[placing.m, [at.RADIUS, at.SPEED]].tolist()
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
        if placing.is_safe() and (speed or _leaves_goal(placing, x, y)):
            return
    placing.check_leaves_goal(np.array([[x, y]]))
    if not drawn:
        raise placing.refuse()
    raise TaskError(
        f"mover {placing.m}: no start was found from which it stays away from the "
        f"robot for {SAFE_SECONDS:g} s; make it slower or smaller"
    )


def _leaves_goal(placing: Placing, x: float, y: float) -> bool:
    try:
        placing.check_leaves_goal(np.array([[x, y]]))
    except TaskError:
        return False
    return True


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
