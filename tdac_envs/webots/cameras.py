"""The cameras of a robot: their properties and their images."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tdac_envs.core.errors import WorldError
from tdac_envs.epuck.prisms import Array
from tdac_envs.webots.rendering import look_through
from tdac_envs.webots.scenery import Scenery
from tdac_envs.worlds.wbt.fields import children, number, numbers, text
from tdac_envs.worlds.wbt.frames import Frame, axis_angle, own_axes, world_frame
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import Node
from tdac_envs.worlds.world import EPuck

MOST_PIXELS = 1 << 21
"""Largest image; cameras with more pixels are not modelled."""
CAMERA_TYPE = 38
"""Webots' number of the node type."""
_EYE, _TURRET = (0.03, 0.0, 0.028), (-0.0095, 0.0, 0.0486)
_NEAR = 0.0055
# Width and height, pixels, and field of view, rad, of the PROTO and of a Camera node.
_EPUCK_SIZE, _CAMERA_SIZE = ((52, 39), 0.84), ((64, 64), math.pi / 4.0)
_NARROWEST, _CLOSEST = 0.01, 1e-6
_NO_FRAME = ("Group", "HingeJoint", "SliderJoint", "Slot")
_NO_TURN = (0.0, 0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class CameraFacts:
    """A camera.

    Attributes:
        name: Device name.
        width: Width of an image, pixels.
        height: Height of an image, pixels.
        field_of_view: Horizontal field of view, rad; the pixels are squares.
        near: Distance of the near plane, m.
        place: Shape (3,): position relative to the robot (forward, left, up), m.
        axes: Shape (3, 3): its forward, left and up directions as columns, in the
            robot's axes.
    """

    name: str
    width: int
    height: int
    field_of_view: float
    near: float
    place: Array
    axes: Array

    def plain(self) -> dict[str, float]:
        """The properties that are sent to the controller."""
        return {
            "width": self.width,
            "height": self.height,
            "fov": self.field_of_view,
            "near": self.near,
        }

    def view(
        self,
        scenery: Scenery,
        place: Array,
        axes: Array,
        things: Array,
        random: np.random.Generator | None,
    ) -> bytes:
        """The image, BGRA; see `views.Viewer`. It has no noise."""
        del random
        width, height = self.width, self.height
        view = look_through(place, axes, self.field_of_view, width, height)
        return scenery.image(view, self.near, width, height, things).tobytes()


def find_cameras(
    robot: Node, own: Frame, epuck: EPuck
) -> tuple[tuple[CameraFacts, ...], tuple[str, ...]]:
    """The cameras of an e-puck, and the names of those that are not modelled.

    Args:
        robot: Node of the e-puck: the PROTO or a plain Robot.
        own: Its frame.
        epuck: The e-puck in the world.

    Raises:
        WorldError: A field is invalid.
    """
    found: list[CameraFacts] = []
    absent: list[str] = []
    for name, node, prefix, frame in _nodes(robot, _own_frame(robot, own, epuck)):
        camera = _read(name, node, prefix, frame)
        if camera.width * camera.height > MOST_PIXELS:
            absent.append(camera.name)
        elif camera.name not in [other.name for other in found]:
            found.append(camera)
    return tuple(found), tuple(absent)


_Found = tuple[str, Node, str, Frame]


def _own_frame(robot: Node, own: Frame, epuck: EPuck) -> Frame:
    """The frame of the robot's node in the robot's axes (forward, left, up).

    An e-puck in a file is often saved with a slight tilt, but drives upright. The axes
    and the origin of a Robot node may differ from those of the PROTO.
    """
    if robot.kind not in ROBOTS:
        return world_frame(not own.y_up, own.y_up)
    level = axis_angle(0.0, 0.0, 1.0, -epuck.heading)
    origin = own.origin - (epuck.x, epuck.y, epuck.z)
    return Frame(level @ own.matrix, level @ origin, own.y_up)


def _nodes(robot: Node, own: Frame) -> Iterator[_Found]:
    """Default name, node, prefix of the field names, and frame of each camera."""
    if robot.kind in ROBOTS:
        yield from _within(robot, own)
        return
    at = own_axes(_EYE, own.y_up)
    turn = numbers(robot, "camera_rotation", _NO_TURN)
    yield "camera", robot, "camera_", own.inside(at, turn)
    turret = own.inside(own_axes(_TURRET, own.y_up))
    for node in children(robot, "turretSlot"):
        yield from _mounted(node, turret)


def _within(node: Node, frame: Frame) -> Iterator[_Found]:
    for field in ("children", "endPoint"):
        for part in children(node, field):
            yield from _mounted(part, frame)


def _mounted(node: Node, frame: Frame) -> Iterator[_Found]:
    if node.kind not in _NO_FRAME:
        try:
            frame = placed(node, frame)
        except WorldError:
            if node.kind == "Camera":
                raise
            return  # fields of an unknown node may have another meaning
    if node.kind == "Camera":
        yield text(node, "name", "camera"), node, "", frame
    yield from _within(node, frame)


def _read(name: str, node: Node, prefix: str, frame: Frame) -> CameraFacts:
    (width, height), view = _EPUCK_SIZE if prefix else _CAMERA_SIZE
    near = _NEAR if prefix else number(node, "near", 0.01)
    angle = number(node, f"{prefix}fieldOfView", view)
    axes = frame.flu().matrix
    lengths = np.linalg.norm(axes, axis=0)
    if lengths.min() < 1e-6:
        raise node.error(f"the camera {name!r} has the scale 0")
    return CameraFacts(
        name,
        _length(node, f"{prefix}width", width),
        _length(node, f"{prefix}height", height),
        angle if _NARROWEST <= angle <= math.pi - _NARROWEST else view,
        near if near > _CLOSEST else _NEAR,
        frame.origin,
        axes / lengths,
    )


def _length(node: Node, field: str, usual: int) -> int:
    """A number of pixels; the default if the given number is below 1."""
    length = int(number(node, field, usual))
    return length if length >= 1 else usual
