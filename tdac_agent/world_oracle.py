"""Answers about worlds that suites compare a controller's own functions with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdac_agent.moved_world import Motion, reordered
from tdac_envs.bodies import at_body_height, bodies, floor_under
from tdac_envs.epuck.contact import nearest_gap
from tdac_envs.epuck.prisms import Owned, Prisms
from tdac_envs.footprint import Disc, Polygon, Rectangle, ring
from tdac_envs.wbt.writer import write_world
from tdac_envs.world import Arena, Obstacle, Part, World

Point = tuple[float, float]
POINTS = 400
# Beside the e-puck's own, a round angle in which everything is askew.
ANGLES = (2.3, -0.7, 1.1)
_AROUND = 0.05
_KEEP_OFF = 0.12
_TRIES = 400


@dataclass(frozen=True, slots=True, eq=False)
class WorldCase:
    """A world file, and what a controller must find in it.

    Attributes:
        name: For messages.
        text: The file.
        world: The same.
    """

    name: str
    text: str
    world: World

    @property
    def start(self) -> tuple[float, float, float]:
        """Pose of the e-puck: x, y (m), yaw (rad)."""
        return self.world.robot.pose

    @property
    def goal(self) -> Point:
        """Point (x, y), m."""
        assert self.world.goal is not None
        return self.world.goal

    def resolution(self) -> float:
        """Of a grid that is quick to make, m."""
        left, low, right, high = self._bounds()
        return max(0.01, round(max(right - left, high - low) / 150, 3))

    def samples(self, inflation: float, margin: float) -> Iterator[tuple[Point, bool]]:
        """Points (x, y) with whether they must be occupied; sure cases only.

        Occupied is what is in something solid at the height of the body, or nearer to
        it than `inflation`, and what is outside the arena.

        Args:
            inflation: By how much things have grown, m.
            margin: Points this near to a boundary are left out, m.
        """
        floor, things = floor_under(self.world), bodies(self.world)
        solid = _prisms(p for t in things for p in at_body_height(t.solid, floor))
        # Marks of the goal are not there; other things of other heights may be.
        all_of = [t for t in things if not t.is_goal]
        unsure = _prisms(part for t in all_of for part in (*t.solid, *t.visible))
        arena = self._walled()
        beyond = None if arena is None else _with_wall(arena, margin)
        for x, y in self._points(solid):
            outside = beyond is not None and not beyond.contains(x, y)
            if outside or _gap(solid, x, y) <= inflation - margin:
                yield (x, y), True
            elif arena is not None and not _well_inside(
                arena, x, y, inflation + margin
            ):
                continue
            elif _gap(unsure, x, y) >= inflation + margin:
                yield (x, y), False

    def _points(self, solid: Prisms) -> list[Point]:
        """Seeded points all over the world, and some in each thing."""
        left, low, right, high = self._bounds()
        random = np.random.default_rng(7)
        corners = (left - _AROUND, low - _AROUND), (right + _AROUND, high + _AROUND)
        spread = random.uniform(*corners, (POINTS, 2))
        return [(x, y) for x, y in (*spread.tolist(), *solid.extent[:, :2].tolist())]

    def _walled(self) -> Arena | None:
        """The arena around the robot and the goal, if it has a wall."""
        arena = self.world.arena
        both = arena is not None and arena.inside.contains(*self.goal)
        return arena if both else None

    def _bounds(self) -> tuple[float, float, float, float]:
        """Of everything, m."""
        world = self.world
        edges = [arena.inside.bounds for arena in world.arenas]
        edges += [p.shape.bounds for t in world.obstacles for p in t.solid]
        edges += [(x, y, x, y) for x, y in (world.robot.pose[:2], self.goal)]
        box = np.array(edges)
        (left, low), (right, high) = box[:, :2].min(axis=0), box[:, 2:].max(axis=0)
        return float(left), float(low), float(right), float(high)


def _with_wall(arena: Arena, margin: float) -> Disc | Rectangle:
    """The floor of an arena, its wall and a margin."""
    shape, edge = arena.inside, arena.wall_thickness + margin
    if isinstance(shape, Disc):
        # The wall has flat pieces.
        reach = shape.radius / math.cos(math.pi / arena.facets) + edge
        return replace(shape, radius=reach)
    length, width = shape.length + 2 * edge, shape.width + 2 * edge
    return replace(shape, length=length, width=width)


def _well_inside(arena: Arena, x: float, y: float, room: float) -> bool:
    """Whether a point is on the floor, and in a round one so far from its circle.

    The flat pieces of a round wall lie outside the circle: who takes the circle for the
    wall is right, too.
    """
    shape = arena.inside
    if isinstance(shape, Disc):
        return math.hypot(x - shape.x, y - shape.y) <= shape.radius - room
    return shape.contains(x, y)


def world_cases(world: World) -> list[WorldCase]:
    """A world as it is, and copies: moved, turned, renamed, reordered, with more in it.

    Args:
        world: Of a task, flat.
    """
    cases = [WorldCase("this world", write_world(world), world)]
    for number, angle in enumerate(ANGLES):
        random = np.random.default_rng(100 + number)
        shift = random.uniform(-1.5, 1.5, 2).tolist()
        copy = Motion(angle, *shift).world(_renamed(_fuller(world, random)))
        text = reordered(write_world(copy), random)
        cases.append(WorldCase(f"a copy turned by {angle} rad", text, copy))
    return cases


def _renamed(world: World) -> World:
    """Other names for the robot and everything but the goal."""
    robots = tuple(replace(robot, name="driver") for robot in world.robots)
    things = tuple(
        thing if thing.is_goal else replace(thing, name=f"thing {number}")
        for number, thing in enumerate(world.obstacles)
    )
    return replace(world, robots=robots, obstacles=things)


def _fuller(world: World, random: np.random.Generator) -> World:
    """The world with a further obstacle of each kind of shape, off start and goal."""
    more: list[Obstacle] = []
    for kind, parts in _shapes(random):
        place = _free_place(world, more, parts, random)
        if place is not None:
            moved = Motion(0.0, *place)
            solid = tuple(map(moved.part, parts))
            more.append(Obstacle("", kind, *place, solid=solid, visible=solid))
    return replace(world, obstacles=(*world.obstacles, *more))


def _shapes(random: np.random.Generator) -> Iterator[tuple[str, list[Part]]]:
    """Kinds of obstacles, each about the origin."""
    yaw = random.uniform(-1.5, 1.5, 4)
    wide, long = random.uniform(0.06, 0.12, 2)
    corners = np.sort(random.uniform(0.0, 2.0 * math.pi, 9))
    unit = np.column_stack([np.cos(corners), np.sin(corners)])
    high = 0.12
    for kind, shape in (
        ("WoodenBox", Rectangle(0.0, 0.0, yaw[0], 2 * long, wide)),
        ("CardboardBox", Rectangle(0.0, 0.0, yaw[1], long, long)),
        ("SolidBox", Rectangle(0.0, 0.0, yaw[2], 0.3, 0.05)),
        ("Wall", Rectangle(0.0, 0.0, yaw[3], 0.25, 0.02)),
        ("OilBarrel", Disc(0.0, 0.0, 0.07)),
        ("Rock", Polygon.around(0.09 * unit)),
    ):
        yield kind, [Part(shape, 0.0, high)]
    pipe = ring(0.0, 0.0, 0.04, 0.09, 8)
    yield "SolidPipe", [Part(piece, 0.0, high) for piece in pipe]


def _free_place(
    world: World,
    more: Iterable[Obstacle],
    parts: Iterable[Part],
    random: np.random.Generator,
) -> Point | None:
    """A place where parts may be put: in the arena, off start, goal and each other."""
    reach = float(_prisms(parts).extent[:, :3].max()) + _AROUND
    taken = _prisms(p for t in (*bodies(world), *more) for p in t.solid)
    ends = [world.robot.pose[:2], world.goal or (0.0, 0.0)]
    floors = [arena.inside.bounds for arena in world.arenas]
    left, low, right, high = floors[0] if floors else (-1.0, -1.0, 1.0, 1.0)
    for _ in range(_TRIES):
        x, y = random.uniform((left, low), (right, high)).tolist()
        inside = world.arena is None or world.arena.inside.contains(x, y)
        far = all(math.dist((x, y), end) > reach + _KEEP_OFF for end in ends)
        if inside and far and _gap(taken, x, y) > 0.5 * reach:
            return x, y
    return None


def _prisms(parts: Iterable[Part]) -> Prisms:
    return Prisms.of(map(Owned, parts))


def _gap(prisms: Prisms, x: float, y: float) -> float:
    return float(nearest_gap(prisms.points, prisms.first, prisms.extent, x, y))


def occupied_at(
    occ: NDArray[np.bool_], origin: Point, resolution: float, point: Point
) -> bool:
    """Whether the cell at a point is occupied; outside the grid it is.

    Args:
        occ: Shape (height, width), `[y, x]`.
        origin: Corner (x0, y0) of the first cell, m.
        resolution: Side of a cell, m.
        point: (x, y), m.
    """
    column = math.floor((point[0] - origin[0]) / resolution)
    row = math.floor((point[1] - origin[1]) / resolution)
    height, width = occ.shape
    inside = 0 <= row < height and 0 <= column < width
    return bool(occ[row, column]) if inside else True
