"""Queries of a diagnosis about a Webots world, in mm on the screen."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.start_frame import StartFrame
from tdac_agent.tasks.units import METRES, Point, Points, Units
from tdac_agent.verification.diagnosis.touch import Touch
from tdac_envs.drive.task import Pose
from tdac_envs.epuck.gaps import part_gap
from tdac_envs.epuck.infrared import PLACES
from tdac_envs.epuck.prisms import Owned, Prisms
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.grid.plan import Path, first_beyond
from tdac_envs.worlds.bodies import BODY_RADIUS, at_body_height
from tdac_envs.worlds.world import Obstacle

FENCE = "fence around the world"
# Largest angle between a sensor's axis and the bearing of what it detects, rad.
_OFF = 0.3
# Corners with larger angles do not matter to the body.
BLUNTEST = math.radians(135.0)


@dataclass(frozen=True, slots=True, eq=False)
class WorldSurroundings:
    """The world of a task; see `Surroundings`.

    Attributes:
        task: The task.
        units: Metres, printed in mm, or in the frame of a start pose.
    """

    task: EPuckTask
    units: Units = METRES

    def shown_in(self, units: Units) -> WorldSurroundings:
        """Returns the same with texts in the frame of a start pose."""
        return replace(self, units=units)

    @property
    def radius(self) -> float:
        """Radius of the body, mm."""
        return BODY_RADIUS * METRES.scale

    @property
    def full_speed(self) -> float:
        """Full speed of the body, mm/s."""
        return self.task.full_step / self.task.dt * METRES.scale

    def touch(self, pose: Pose, reach: float) -> Touch | None:
        """Returns the nearest obstacle within `reach`."""
        x, y = METRES.place_of(pose.x, pose.y)
        near = _nearest(self.task, x, y)
        gap, (away_x, away_y) = near.gap, near.away
        if gap * METRES.scale > reach:
            return None
        wall = (x - gap * away_x, y - gap * away_y)
        bearing = math.atan2(away_y, -away_x) - pose.heading
        corner = _nearest_corner(near.outline, wall)
        return Touch(
            wall=_on_screen(wall),
            bearing=math.remainder(bearing, 2.0 * math.pi),
            gap=max(gap * METRES.scale - self.radius, 0.0),
            border=near.name == FENCE,
            corner=None if corner is None else _on_screen(corner),
            thing=near.name,
        )

    def seen(self, touch: Touch, trajectory: Trajectory) -> str:
        """Describes which infrared sensor points there, and what it read."""
        off = np.abs(np.angle(np.exp(1j * (PLACES[:, 2] + touch.bearing))))
        sensor, before = int(off.argmin()), max(trajectory.steps - 10, 0)
        reading = f"ps{sensor} read {trajectory.ranges[before, sensor]:.0f}"
        if off[sensor] > _OFF:
            angle = math.degrees(float(off[sensor]))
            return (
                f"No sensor points there: the nearest one is {angle:.0f}° off; in step "
                f"{before} {reading}."
            )
        return (
            f"In step {before} {reading}, the sensor on that side (67: nothing near)."
        )

    def in_sight(self, pose: Pose, place: Point, radius: float) -> bool:
        """False: nothing but the robot moves in a world."""
        del pose, place, radius
        return False

    def path_from(self, pose: Pose) -> Path:
        """Returns the shortest grid path to the goal."""
        start = Pose(*METRES.place_of(pose.x, pose.y), 0.0)
        return METRES.on_screen(self.task.path_from(start))

    def pull(self, path: Path) -> list[Point]:
        """Returns the corners of a path after all shortcuts."""
        places = [METRES.place_of(x, y) for x, y in path.tolist()]
        corners = self.task.pulled(np.array(places).reshape(-1, 2))
        return [_on_screen(corner) for corner in corners]

    def places_ahead(self, places: Points, far: float) -> Iterator[Point | None]:
        """Yields the path's first point `far` away from each place, or its end."""
        for x, y in places.tolist():
            path = self.path_from(Pose(x, y, 0.0))
            yield first_beyond(path, x, y, far) if len(path) else None

    def mistaken_goals(self) -> dict[str, Point]:
        """Returns where typical coordinate mistakes put the goal, by description."""
        x, y = self.task.goal
        frame = self.units.shown
        if isinstance(frame, StartFrame):
            x, y = frame.coordinates(*_on_screen((x, y)))
            return {
                "x and y swapped": frame.pixels((y, x)),
                "y counted to the right": frame.pixels((x, -y)),
            }
        places = {
            "x and y swapped": (y, x),
            "the sign of y wrong": (x, -y),
            "the sign of x wrong": (-x, y),
        }
        screen = METRES.on_screen(list(places.values())).tolist()
        return {name: (u, v) for name, (u, v) in zip(places, screen, strict=True)}


class _Near(NamedTuple):
    """The obstacle nearest to a point.

    Attributes:
        name: Name of the obstacle.
        gap: Distance to it, m.
        away: Unit vector that points away from it.
        outline: Its vertices, shape (n, 2), counter-clockwise; empty if it has several
            parts or no vertices.
    """

    name: str
    gap: float
    away: Point
    outline: Points


def _nearest(task: EPuckTask, x: float, y: float) -> _Near:
    ground, none = task.ground, np.empty((0, 2))
    nearby = []
    for thing in ground.things:
        parts = at_body_height(thing.solid, ground.floor)
        prisms = Prisms.of(map(Owned, parts))
        for part in range(len(parts)):
            gap, *away = part_gap(*prisms.arrays(), part, x, y)
            outline = prisms.outline(part) if len(parts) == 1 else none
            vector = (float(away[0]), float(away[1]))
            nearby.append(_Near(_name(thing), float(gap), vector, outline))
    left, low, right, high = ground.bounds
    nearby += [
        _Near(FENCE, x - left, (1.0, 0.0), none),
        _Near(FENCE, right - x, (-1.0, 0.0), none),
        _Near(FENCE, y - low, (0.0, 1.0), none),
        _Near(FENCE, high - y, (0.0, -1.0), none),
    ]
    return min(nearby, key=lambda near: near.gap)


def _nearest_corner(outline: Points, point: Point) -> Point | None:
    """Returns the nearest sharp corner of an outline within a body radius, or None."""
    if len(outline) < 3:
        return None
    back, ahead = np.roll(outline, 1, axis=0) - outline, np.roll(outline, -1, axis=0)
    ahead = ahead - outline
    cosine = (back * ahead).sum(axis=1) / np.hypot(*back.T) / np.hypot(*ahead.T)
    sharp = outline[cosine > math.cos(BLUNTEST)].tolist()
    near = [(math.dist(at, point), (at[0], at[1])) for at in sharp]
    distance, corner = min(near, default=(math.inf, (0.0, 0.0)))
    return corner if distance <= BODY_RADIUS else None


def _on_screen(place: Point) -> Point:
    x, y = METRES.on_screen([place])[0].tolist()
    return x, y


def _name(thing: Obstacle) -> str:
    """Returns a name such as `WoodenBox 'box 3'`, `wall of the arena` or `Rock`."""
    if thing.kind in ("CircleArena", "RectangleArena"):
        return "wall of the arena"
    return f"{thing.kind} {thing.name!r}" if thing.name else thing.kind
