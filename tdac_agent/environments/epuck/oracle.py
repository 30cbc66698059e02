"""Exact answers about worlds, for comparison with a controller's own functions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tdac_agent.environments.epuck.moved_world import Motion, reordered, turned_groups
from tdac_agent.tasks.units import Point
from tdac_agent.verification.suite.oracle import Oracle
from tdac_envs.epuck.gaps import nearest_gap
from tdac_envs.epuck.prisms import Owned, Prisms
from tdac_envs.worlds.bodies import at_body_height, bodies, floor_under
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle, ring
from tdac_envs.worlds.wbt.writer import write_world
from tdac_envs.worlds.world import Arena, Obstacle, Part, World

POINTS = 400
_AROUND = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class WorldCase:
    """A world file, and the correct answers about it.

    Attributes:
        name: Name for messages.
        text: The file.
        world: The same world.
        seed: Seed of the points of `samples`.
    """

    name: str
    text: str
    world: World
    seed: int = 7

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
        """Returns a grid resolution that is quick to compute, m."""
        left, low, right, high = self._bounds()
        return max(0.01, round(max(right - left, high - low) / 150, 3))

    def samples(self, inflation: float, margin: float) -> Iterator[tuple[Point, bool]]:
        """Yields points (x, y) and whether they must be occupied.

        Occupied are points in solids at the height of the body, points nearer to them
        than `inflation`, and points outside the arena. Ambiguous points are left out.

        Args:
            inflation: Distance by which solids are grown, m.
            margin: Points nearer to a boundary than this are left out, m.
        """
        floor, things = floor_under(self.world), bodies(self.world)
        solid = prisms_of(p for t in things for p in at_body_height(t.solid, floor))
        # Goal marks must be ignored; other things at other heights may be ignored.
        all_of = [t for t in things if not t.is_goal]
        unsure = prisms_of(part for t in all_of for part in (*t.solid, *t.visible))
        arena = self._walled()
        beyond = None if arena is None else _with_wall(arena, margin)
        for x, y in self._points(solid):
            outside = beyond is not None and not beyond.contains(x, y)
            if outside or gap_to(solid, x, y) <= inflation - margin:
                yield (x, y), True
            elif arena is not None and not _well_inside(
                arena, x, y, inflation + margin
            ):
                continue
            elif gap_to(unsure, x, y) >= inflation + margin:
                yield (x, y), False

    def _points(self, solid: Prisms) -> list[Point]:
        """Returns seeded points all over the world, and one in each solid part."""
        left, low, right, high = self._bounds()
        random = np.random.default_rng(self.seed)
        corners = (left - _AROUND, low - _AROUND), (right + _AROUND, high + _AROUND)
        spread = random.uniform(*corners, (POINTS, 2))
        return [(x, y) for x, y in (*spread.tolist(), *solid.extent[:, :2].tolist())]

    def _walled(self) -> Arena | None:
        """Returns the walled arena around robot and goal, or None."""
        arena = self.world.arena
        both = arena is not None and arena.inside.contains(*self.goal)
        return arena if both else None

    def _bounds(self) -> tuple[float, float, float, float]:
        """Returns the bounding box of everything (left, low, right, high), m."""
        world = self.world
        edges = [arena.inside.bounds for arena in world.arenas]
        edges += [p.shape.bounds for t in world.obstacles for p in t.solid]
        edges += [(x, y, x, y) for x, y in (world.robot.pose[:2], self.goal)]
        box = np.array(edges)
        (left, low), (right, high) = box[:, :2].min(axis=0), box[:, 2:].max(axis=0)
        return float(left), float(low), float(right), float(high)


def _with_wall(arena: Arena, margin: float) -> Disc | Rectangle:
    """Returns the area of an arena's floor, its wall and a margin."""
    shape, edge = arena.inside, arena.wall_thickness + margin
    if isinstance(shape, Disc):
        # The wall consists of flat pieces.
        reach = shape.radius / math.cos(math.pi / arena.facets) + edge
        return replace(shape, radius=reach)
    length, width = shape.length + 2 * edge, shape.width + 2 * edge
    return replace(shape, length=length, width=width)


def _well_inside(arena: Arena, x: float, y: float, room: float) -> bool:
    """Whether a point is on the floor, and at least `room` inside a round floor.

    The flat pieces of a round wall lie outside its circle; a controller may also use
    the circle as the wall.
    """
    shape = arena.inside
    if isinstance(shape, Disc):
        return math.hypot(x - shape.x, y - shape.y) <= shape.radius - room
    return shape.contains(x, y)


def prisms_of(parts: Iterable[Part]) -> Prisms:
    """Returns parts as arrays."""
    return Prisms.of(map(Owned, parts))


def gap_to(prisms: Prisms, x: float, y: float) -> float:
    """Returns the distance from a point to the nearest part, m; negative inside."""
    return float(nearest_gap(*prisms.arrays(), float(x), float(y)))


def occupied_at(
    occ: NDArray[np.bool_], origin: Point, resolution: float, point: Point
) -> bool:
    """Whether the cell at a point is occupied; true outside the grid.

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


# Angles, in addition to the original one, at which nothing is parallel to an axis.
ANGLES = (2.3, -0.7, 1.1)
_APART, _KEEP_OFF = 0.05, 0.12
_TRIES = 400


class WorldOracle(Oracle):
    """An oracle for grids and worlds."""

    def world_cases(
        self, world: World, random: np.random.Generator | None = None
    ) -> list[WorldCase]:
        """Returns a world, and copies: moved, turned, renamed, reordered, with more.

        Args:
            world: Flat world of a task.
            random: Random number generator for another copy and for sample points.
        """
        cases = [WorldCase("this world", write_world(world), world)]
        if random is not None:
            cases[0] = replace(cases[0], seed=int(random.integers(1 << 32)))
            angle = round(float(random.uniform(-math.pi, math.pi)), 3)
            cases.append(_copy(world, angle, random))
        for number, angle in enumerate(ANGLES):
            cases.append(_copy(world, angle, np.random.default_rng(100 + number)))
        return cases


def _copy(world: World, angle: float, random: np.random.Generator) -> WorldCase:
    shift = random.uniform(-1.5, 1.5, 2).tolist()
    copy = Motion(angle, *shift).world(_renamed(_fuller(world, random)))
    turned = turned_groups(write_world(copy), random.uniform(0.4, 2.4))
    text = reordered(turned, random)
    return WorldCase(f"a copy turned by {angle} rad", text, copy)


def _renamed(world: World) -> World:
    """Renames the robot and everything except the goal."""
    robots = tuple(replace(robot, name="driver") for robot in world.robots)
    things = tuple(
        thing if thing.is_goal else replace(thing, name=f"thing {number}")
        for number, thing in enumerate(world.obstacles)
    )
    return replace(world, robots=robots, obstacles=things)


def _fuller(world: World, random: np.random.Generator) -> World:
    """Adds an obstacle of each kind of shape, away from start and goal."""
    more: list[Obstacle] = []
    for kind, parts in _shapes(random):
        place = _free_place(world, more, parts, random)
        if place is not None:
            moved = Motion(0.0, *place)
            solid = tuple(map(moved.part, parts))
            more.append(Obstacle("", kind, *place, solid=solid, visible=solid))
    return replace(world, obstacles=(*world.obstacles, *more))


def _shapes(random: np.random.Generator) -> Iterator[tuple[str, list[Part]]]:
    """Yields kinds of obstacles, each around the origin."""
    yaw = random.uniform(-1.5, 1.5, 4)
    wide, long = random.uniform(0.06, 0.12, 2)
    corners = np.sort(random.uniform(0.0, 2.0 * math.pi, 9))
    unit = np.column_stack([np.cos(corners), np.sin(corners)])
    high = 0.12
    # This obstacle has several pieces and is not symmetric; it is placed first, while
    # there is room for it.
    ell = Rectangle(0.03, 0.0, 0.0, 0.03, 0.12), Rectangle(-0.02, 0.045, 0.3, 0.1, 0.03)
    yield "WoodenPallet", [Part(piece, 0.0, high) for piece in ell]
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
    """Returns a place for parts in the arena, away from start, goal and obstacles."""
    reach = float(prisms_of(parts).extent[:, :3].max()) + _APART
    taken = prisms_of(p for t in (*bodies(world), *more) for p in t.solid)
    ends = [world.robot.pose[:2], world.goal or (0.0, 0.0)]
    floors = [arena.inside.bounds for arena in world.arenas]
    left, low, right, high = floors[0] if floors else (-1.0, -1.0, 1.0, 1.0)
    for _ in range(_TRIES):
        x, y = random.uniform((left, low), (right, high)).tolist()
        inside = world.arena is None or world.arena.inside.contains(x, y)
        far = all(math.dist((x, y), end) > reach + _KEEP_OFF for end in ends)
        if inside and far and gap_to(taken, x, y) > 0.5 * reach:
            return x, y
    return None
