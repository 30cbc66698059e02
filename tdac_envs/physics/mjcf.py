"""MuJoCo's model of a scene and a robot, as XML (MJCF)."""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

import numpy as np

from tdac_envs.physics.body import GRAVITY, BodySpec
from tdac_envs.physics.scene import FIXED, Prism, Scene, Thing
from tdac_envs.worlds.footprint import Disc, Rectangle

SUBSTEP = 0.001
"""Duration of a step of the solver, s."""
HULL, LEFT, RIGHT, ROBOT, GROUND = "hull", "left", "right", "robot", "ground"
SEEN, UNSEEN, ROBOTS = 0, 1, 2
"""Groups of geoms: what rays hit, what is invisible, parts of the robot."""
# Bits that decide what collides with what: two geoms do if a bit of `contype` of one is
# in `conaffinity` of the other.
_GROUND, _SOLID, _HULL, _THING = 1, 2, 4, 8
_CONTACT = {"solref": "0.004 1", "solimp": "0.95 0.99 0.0001"}
"""Stiff contacts: at rest an e-puck sinks by less than 0.01 mm."""
_RAMP = 2.0
"""Error of a wheel's speed at which its motor has its full torque, rad/s."""
_HALF_WIDTH = 0.125
"""Half the width of a wheel as a part of its radius, as of an e-puck."""
_BLACK, _GREEN, _DARK = (0.12, 0.12, 0.13), (0.26, 0.52, 0.27), (0.2, 0.2, 0.22)


def model_of(scene: Scene, body: BodySpec) -> str:
    """The model of a scene with a robot, as text in XML; see `model_tree`."""
    return ET.tostring(model_tree(scene, body), "unicode")


def model_tree(scene: Scene, body: BodySpec) -> ET.Element:
    """The model of a scene with a robot.

    The frame of the robot is in the middle of the axle, with x ahead and y to the left.
    """
    root = ET.Element("mujoco", model="tdac")
    add(root, "compiler", angle="radian", autolimits="true")
    add(
        root, "option", timestep=SUBSTEP, integrator="implicitfast",
        cone="elliptic", impratio=10, gravity=(0, 0, -GRAVITY),
    )  # fmt: skip
    default = add(root, "default")
    add(default, "geom", condim=3, friction=(1, 0, 0), **_CONTACT)
    assets, world = add(root, "asset"), add(root, "worldbody")
    add(
        world, "geom", name=GROUND, type="plane", size=(0, 0, 1),
        pos=(0, 0, scene.floor), contype=_GROUND, conaffinity=0,
        friction=(0, 0, 0), rgba=(0.8, 0.8, 0.78, 1), group=SEEN,
    )  # fmt: skip
    _add_prisms(assets, world, scene, FIXED, (0.0, 0.0))
    for number, thing in enumerate(scene.things):
        _add_thing(assets, world, scene, number, thing)
    _add_robot(root, world, body, scene.floor)
    return root


def name_of(thing: int) -> str:
    """Name of the body of a free thing."""
    return f"thing{thing}"


def prism_name(index: int) -> str:
    """Name of the geom of a prism."""
    return f"prism{index}"


def add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    """Adds an element; numbers and rows of numbers become text."""
    texts = {key: _text(value) for key, value in attributes.items()}
    return ET.SubElement(parent, tag, texts)


def _text(value: object) -> str:
    if isinstance(value, tuple | list | np.ndarray):
        return " ".join(f"{float(part):.9g}" for part in np.ravel(value))
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _add_thing(
    assets: ET.Element, world: ET.Element, scene: Scene, number: int, thing: Thing
) -> None:
    """Adds a free body whose frame is on the ground below its centre."""
    body = add(world, "body", name=name_of(number), pos=(thing.x, thing.y, scene.floor))
    add(body, "freejoint", name=name_of(number))
    _add_prisms(assets, body, scene, number, (thing.x, thing.y))


def _add_prisms(
    assets: ET.Element,
    body: ET.Element,
    scene: Scene,
    number: int,
    origin: tuple[float, float],
) -> None:
    """Adds the prisms of a free thing, or all fixed ones, to a body."""
    own = [(k, p) for k, p in enumerate(scene.prisms) if p.thing == number]
    volume = sum(_volume(prism) for _, prism in own if prism.solid)
    for index, prism in own:
        geom = add(
            body, "geom", name=prism_name(index),
            group=SEEN if prism.visible else UNSEEN,
            rgba=(*prism.colour, 1.0 if prism.visible else 0.0),
            **_shape(assets, index, prism, origin, scene.floor * (number != FIXED)),
        )  # fmt: skip
        if number == FIXED:
            kinds = (_SOLID, 0) if prism.solid else (0, 0)
        else:
            thing = scene.things[number]
            share = thing.mass * _volume(prism) / volume if prism.solid else 0.0
            geom.set("mass", _text(share))
            geom.set("friction", _text((thing.friction, 0.0, 0.0)))
            touches = _GROUND | _SOLID | _THING
            kinds = (_THING, touches) if prism.solid else (0, 0)
        geom.set("contype", str(kinds[0]))
        geom.set("conaffinity", str(kinds[1]))


def _volume(prism: Prism) -> float:
    return prism.shape.area * (prism.top - prism.bottom)


def _shape(
    assets: ET.Element,
    index: int,
    prism: Prism,
    origin: tuple[float, float],
    below: float,
) -> dict[str, object]:
    """Attributes of a geom: a cylinder, a box or a convex mesh.

    Args:
        assets: Where meshes are added.
        index: Number of the prism.
        prism: The prism.
        origin: x and y of the body's frame, m.
        below: z of the body's frame, m.
    """
    shape, half = prism.shape, (prism.top - prism.bottom) / 2
    z = (prism.top + prism.bottom) / 2 - below
    if isinstance(shape, Disc):
        at = (shape.x - origin[0], shape.y - origin[1], z)
        return {"type": "cylinder", "size": (shape.radius, half), "pos": at}
    if isinstance(shape, Rectangle):
        at = (shape.x - origin[0], shape.y - origin[1], z)
        size = (shape.length / 2, shape.width / 2, half)
        return {"type": "box", "size": size, "pos": at, "euler": (0, 0, shape.yaw)}
    corners = shape.vertices
    middle = corners.mean(axis=0)
    rim = corners - middle
    points = [(*point, level) for level in (-half, half) for point in rim.tolist()]
    name = prism_name(index)
    add(assets, "mesh", name=name, vertex=np.array(points), inertia="shell")
    x, y = (middle - origin).tolist()
    return {"type": "mesh", "mesh": name, "pos": (x, y, z)}


def _add_robot(
    root: ET.Element, world: ET.Element, body: BodySpec, floor: float
) -> None:
    """Adds the robot with its motors; the cylinder alone touches obstacles."""
    axis = body.wheel_radius
    robot = add(world, "body", name=ROBOT, pos=(0, 0, floor + axis))
    add(robot, "freejoint", name=ROBOT)
    mass = body.mass - 2 * body.wheel_mass
    half, middle = (body.top - body.bottom) / 2, (body.top + body.bottom) / 2
    across = mass * (3 * body.radius**2 + 4 * half**2) / 12
    add(
        robot, "inertial", mass=mass, pos=(0, 0, body.centre - axis),
        diaginertia=(across, across, mass * body.radius**2 / 2),
    )  # fmt: skip
    add(
        robot, "geom", name=HULL, type="cylinder", size=(body.radius, half),
        pos=(0, 0, middle - axis), contype=_HULL, friction=(body.friction, 0, 0),
        conaffinity=_GROUND | _SOLID | _THING, priority=1, group=ROBOTS,
        rgba=(*_GREEN, 1),
    )  # fmt: skip
    _add_casters(robot, body)
    motors = add(root, "actuator")
    for name, side in ((LEFT, 0.5), (RIGHT, -0.5)):
        _add_wheel(robot, body, name, side * body.axle_length)
        limit = body.most_torque
        add(
            motors, "velocity", name=name, joint=name, kv=limit / _RAMP,
            forcerange=(-limit, limit),
        )  # fmt: skip


def _add_casters(robot: ET.Element, body: BodySpec) -> None:
    """Adds two balls that slide 0.3 % of the radius above the ground."""
    ball, gap = 0.135 * body.radius, 0.0027 * body.radius
    for x in (0.68 * body.radius, -0.68 * body.radius):
        add(
            robot, "geom", type="sphere", size=ball, contype=0, conaffinity=_GROUND,
            pos=(x, 0, ball + gap - body.wheel_radius), group=ROBOTS, priority=2,
            friction=(body.caster_friction, 0, 0), rgba=(*_DARK, 1),
        )  # fmt: skip


def _add_wheel(robot: ET.Element, body: BodySpec, name: str, y: float) -> None:
    wheel = add(robot, "body", name=name, pos=(0, y, 0))
    add(wheel, "joint", name=name, type="hinge", axis=(0, 1, 0))
    radius = body.wheel_radius
    add(
        wheel, "geom", type="ellipsoid", size=(radius, _HALF_WIDTH * radius, radius),
        mass=body.wheel_mass, friction=(body.grip, 0, 0), contype=0,
        conaffinity=_GROUND, priority=2, group=ROBOTS, rgba=(*_BLACK, 1),
    )  # fmt: skip


def heading_of(quaternion: np.ndarray) -> float:
    """Heading of a frame, rad: the direction of its x axis seen from above."""
    w, x, y, z = quaternion.tolist()
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
