"""Model of a Webots world for an e-puck: robots, goal, arenas and obstacles.

Lengths are in metres, angles in radians. The frame is always ENU, whatever the file
uses: x and y in the ground plane, z up, headings counter-clockwise from +x. Numbers
are rounded to 1e-9, so that a world that is written and read back compares equal.

Obstacles consist of vertical prisms. A `Part` is a disc or a convex polygon, as 2D
physics engines use them, between two heights: the projection of one convex piece of
the 3D shape. Parts that the robot can hit (boundingObjects) and parts that infra-red
rays hit (graphical Shapes) are separate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.footprint import (
    THINNEST,
    Disc,
    Footprint,
    Rectangle,
    frame,
    keep_digits,
    metres,
    ring,
    wrap_angle,
)
from tdac_envs.worlds.looks import ALUMINIUM, Look, chequered
from tdac_envs.worlds.materials import MATERIAL, Contact, friction_between

MAX_WHEEL_SPEED = {"1": 6.28, "2": 7.536}
ROBOT_MASS = {"1": 0.16, "2": 0.14}
"""Mass of an e-puck with its two wheels of 5 g, kg, by version."""
JOINT_DISTANCE = 0.052
"""Distance between the wheel joints of an e-puck, m; source: Webots' E-puck.proto."""
AXLE_LENGTH = 0.057
"""Effective axle of an e-puck, m: `JOINT_DISTANCE` plus the width of a wheel, 5 mm.

The wheels of E-puck.proto are cylinders. They carry the robot on their outer rims, so
that it turns about 9 % slower than the distance of the joints suggests. Cyberbotics'
ROS 2 driver corrects this, too: `ros2_control.yml` of webots_ros2_epuck multiplies a
`wheel_separation` of 0.052 m by 1.095.
"""


@dataclass(frozen=True, slots=True)
class Part:
    """A vertical prism at least 0.1 mm high; a lower one is extended downwards.

    Attributes:
        shape: Footprint.
        bottom: Lowest z, m.
        top: Highest z, m.
    """

    shape: Footprint
    bottom: float
    top: float

    def __post_init__(self) -> None:
        keep_digits(self, "bottom", "top")
        if self.bottom > self.top:
            raise WorldError(
                f"expected a bottom below the top, got {self.bottom} and {self.top}"
            )
        if self.top - self.bottom < THINNEST:
            object.__setattr__(self, "bottom", metres("bottom", self.top - THINNEST))


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An object in the world: solid, visible to the sensors, or both.

    Attributes:
        name: The node's `name` field, or its DEF name, or empty.
        kind: Node or PROTO type, or the `model` field of a Solid.
        x: x of the origin, m.
        y: y of the origin, m.
        solid: Parts that bodies collide with; empty for a pure marker.
        visible: Parts that infra-red rays hit.
        mass: Mass of a pushable object, kg; None if it is fixed.
        reflectance: Factor in [0.2, 1] by which Webots divides the distance that a
            sensor measures; 1 if it is unknown or nothing is visible.
        is_goal: Whether the object marks the goal.
        looks: How cameras see each of the visible parts; empty if the file does not
            tell.
        material: The `contactMaterial`, which determines its friction.
    """

    name: str
    kind: str
    x: float
    y: float
    solid: tuple[Part, ...] = ()
    visible: tuple[Part, ...] = ()
    mass: float | None = None
    reflectance: float = 1.0
    is_goal: bool = False
    looks: tuple[Look, ...] = field(default=(), compare=False, repr=False)
    material: str = MATERIAL

    def __post_init__(self) -> None:
        keep_digits(self, "x", "y", "reflectance")
        if self.mass is not None:
            keep_digits(self, "mass")
            if self.mass <= 0.0:
                raise WorldError(f"expected a mass above 0, got {self.mass}")
        if not 0.2 <= self.reflectance <= 1.0:
            raise WorldError(f"reflectance {self.reflectance} is not in [0.2, 1]")
        if not self.visible:
            object.__setattr__(self, "reflectance", 1.0)


@dataclass(frozen=True, slots=True)
class EPuck:
    """An e-puck.

    Attributes:
        name: The node's `name` field.
        x: x of the middle of the axle, m.
        y: y of the middle of the axle, m.
        heading: Driving direction, rad, in (-pi, pi].
        z: Height at which the wheels touch the ground, m.
        version: "1" or "2".
        controller: Name of the controller in the file.
        kinematic: Whether Webots moves it without physics, by its wheel speeds.
    """

    name: str
    x: float
    y: float
    heading: float
    z: float = 0.0
    version: Literal["1", "2"] = "1"
    controller: str = ""
    kinematic: bool = False

    def __post_init__(self) -> None:
        keep_digits(self, "x", "y", "z")
        object.__setattr__(self, "heading", wrap_angle(self.heading))
        if self.version not in MAX_WHEEL_SPEED:
            raise WorldError(f'expected version "1" or "2", got {self.version!r}')

    @property
    def pose(self) -> tuple[float, float, float]:
        """(x, y, heading)."""
        return self.x, self.y, self.heading

    @property
    def max_wheel_speed(self) -> float:
        """Maximum wheel speed, rad/s."""
        return MAX_WHEEL_SPEED[self.version]

    @property
    def axle_length(self) -> float:
        """Effective axle, m; see `AXLE_LENGTH`.

        Without physics there are no rims on a floor: Webots then moves the robot by the
        distance of the joints.
        """
        return JOINT_DISTANCE if self.kinematic else AXLE_LENGTH

    @property
    def mass(self) -> float:
        """Mass with wheels, kg."""
        return ROBOT_MASS[self.version]


@dataclass(frozen=True, slots=True)
class Arena:
    """A floor, usually with a wall around it.

    Attributes:
        inside: Floor area. A disc always has a wall; a rectangle may have none.
        wall_thickness: Thickness of the wall, outside the floor, m; 0 without a wall.
        wall_height: Height of the wall above the floor, m; 0 without a wall.
        z: Height of the floor, m.
        facets: Number of flat segments of a round wall; each touches the disc.
        floor_look: How cameras see the floor.
        wall_look: How cameras see the wall.
        material: The `contactMaterial`, which determines its friction.
    """

    inside: Disc | Rectangle
    wall_thickness: float = 0.0
    wall_height: float = 0.0
    z: float = 0.0
    facets: int = 48
    floor_look: Look = field(default=chequered(0.5, 0.5), compare=False, repr=False)
    wall_look: Look = field(default=ALUMINIUM, compare=False, repr=False)
    material: str = MATERIAL

    def __post_init__(self) -> None:
        keep_digits(self, "wall_thickness", "wall_height", "z")
        wall = (self.wall_thickness, self.wall_height)
        if min(wall) < 0.0 or (min(wall) == 0.0) != (max(wall) == 0.0):
            raise WorldError(f"a wall needs thickness and height above 0, got {wall}")
        if isinstance(self.inside, Disc) and (not self.has_wall or self.facets < 8):
            raise WorldError("expected a round arena with a wall of 8 facets or more")
        if isinstance(self.inside, Rectangle):
            object.__setattr__(self, "facets", 48)

    @property
    def kind(self) -> str:
        """PROTO type."""
        if isinstance(self.inside, Disc):
            return "CircleArena"
        return "RectangleArena" if self.has_wall else "Floor"

    @property
    def has_wall(self) -> bool:
        """Whether there is a wall around the floor."""
        return self.wall_height > 0.0

    def wall(self) -> Obstacle:
        """The wall as an obstacle of convex parts; no parts if there is no wall."""
        shape, thickness = self.inside, self.wall_thickness
        if not self.has_wall:
            return Obstacle("", self.kind, shape.x, shape.y)
        if isinstance(shape, Disc):
            outer = shape.radius + thickness
            pieces = ring(shape.x, shape.y, shape.radius, outer, self.facets)
        else:
            pieces = frame(shape, thickness)
        parts = tuple(Part(p, self.z, self.z + self.wall_height) for p in pieces)
        looks = (self.wall_look,) * len(parts)
        return Obstacle(
            "", self.kind, shape.x, shape.y, parts, parts, looks=looks,
            material=self.material,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Unmodelled:
    """A node of the file that the model leaves out.

    Attributes:
        name: The node's `name` field, or its DEF name, or empty.
        kind: Node or PROTO type.
        x: x of the origin, m.
        y: y of the origin, m.
        why: Reason for leaving it out.
        may_be_solid: Whether a robot could hit it.
        line: Line number in the file.
    """

    name: str
    kind: str
    x: float
    y: float
    why: str
    may_be_solid: bool = True
    line: int = 0

    def is_called(self, name: str) -> bool:
        """Whether `name` is the name or the type of this node."""
        return name in (self.name, self.kind)


@dataclass(frozen=True, slots=True)
class World:
    """A Webots world.

    Attributes:
        robots: E-pucks; the first is driven, the others stand still.
        goal: Point (x, y), m; None if the file has no goal.
        arenas: Floors, with or without walls.
        obstacles: Everything else, without the walls of the arenas.
        time_step: Physics time step, ms.
        contacts: Friction of pairs of materials; the first one of a pair counts.
        unmodelled: Nodes of the file that are not in the model.
        source: File name.
        version: Webots version in the file's header.
        notes: Assumptions that the reader made.
    """

    robots: tuple[EPuck, ...] = ()
    goal: tuple[float, float] | None = None
    arenas: tuple[Arena, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    time_step: float = 32.0
    contacts: tuple[Contact, ...] = ()
    unmodelled: tuple[Unmodelled, ...] = ()
    source: str = field(default="", compare=False)
    version: str = field(default="", compare=False)
    notes: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        keep_digits(self, "time_step")
        if self.time_step <= 0.0:
            raise WorldError(f"expected a time step above 0, got {self.time_step}")
        if self.goal is not None:
            point = (metres("x", self.goal[0]), metres("y", self.goal[1]))
            object.__setattr__(self, "goal", point)
        elif any(obstacle.is_goal for obstacle in self.obstacles):
            raise WorldError("an obstacle marks the goal, but the world has no goal")

    @property
    def robot(self) -> EPuck:
        """The e-puck that is driven.

        Raises:
            WorldError: The world has no e-puck.
        """
        if not self.robots:
            raise WorldError(f"{self.source or 'the world'}: there is no e-puck in it")
        return self.robots[0]

    @property
    def friction(self) -> float:
        """Coulomb friction coefficient of two default materials."""
        return friction_between(self.contacts, MATERIAL, MATERIAL)

    @property
    def arena(self) -> Arena | None:
        """The walled floor around the robot, else the first walled one, else None."""
        walled = [arena for arena in self.arenas if arena.has_wall]
        for arena in walled:
            if self.robots and arena.inside.contains(self.robot.x, self.robot.y):
                return arena
        return walled[0] if walled else None


def check_modelled(world: World, ignore: Iterable[str] = ()) -> tuple[Unmodelled, ...]:
    """Checks that `ignore` names all unmodelled nodes that may be solid; returns them.

    Args:
        world: The world.
        ignore: Names or types of unmodelled nodes to leave out.

    Raises:
        WorldError: `ignore` does not name such a node, or names an unknown one.
    """
    names = tuple(ignore)
    open_ = [node for node in world.unmodelled if node.may_be_solid]
    left = [n for n in open_ if not any(n.is_called(name) for name in names)]
    where = world.source or "the world"
    if left:
        kinds = sorted({node.kind for node in left})
        first = left[0]
        raise WorldError(
            f"{where}: {len(left)} node{'s' * (len(left) > 1)} may be solid but "
            f"{'are' if len(left) > 1 else 'is'} not modelled "
            f"({', '.join(kinds)}; the first at ({first.x:g}, {first.y:g}): "
            f"{first.why}); leave them out with --ignore NAME or TYPE "
            "(ignore=[...] in Python)"
        )
    for name in names:
        if not any(node.is_called(name) for node in world.unmodelled):
            known = sorted({node.kind for node in open_}) or ["nothing"]
            raise WorldError(
                f"{where}: no node called {name!r} to ignore; not modelled: "
                f"{', '.join(known)}"
            )
    return tuple(open_)
