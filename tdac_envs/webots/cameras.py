"""The cameras of a robot: their properties and their images."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tdac_envs.epuck.prisms import Array
from tdac_envs.webots.mounts import Mount, level_frame, unit_axes
from tdac_envs.webots.rendering import look_through
from tdac_envs.webots.scenery import Scenery
from tdac_envs.worlds.wbt.fields import number, numbers, text
from tdac_envs.worlds.wbt.frames import NodeFrame, own_axes
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import WbtNode

MOST_PIXELS = 1 << 21
"""Largest image; cameras with more pixels are not modelled."""
CAMERA_TYPE = 38
"""Webots' number of the node type."""
_EYE = (0.03, 0.0, 0.028)
_NEAR = 0.0055
# Width and height, pixels, and field of view, rad, of the PROTO and of a Camera node.
_EPUCK_SIZE, _CAMERA_SIZE = ((52, 39), 0.84), ((64, 64), math.pi / 4.0)
_NARROWEST, _CLOSEST = 0.01, 1e-6
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
    robot: WbtNode, own: NodeFrame, mounted: Iterable[Mount]
) -> tuple[tuple[CameraFacts, ...], tuple[str, ...]]:
    """The cameras of an e-puck, and the names of those that are not modelled.

    Args:
        robot: Node of the e-puck: the PROTO or a plain Robot.
        own: Its frame.
        mounted: Nodes in its slots, or in the Robot node.

    Raises:
        WorldError: A field is invalid.
    """
    candidates = [("", node, frame) for node, frame in mounted if node.kind == "Camera"]
    if robot.kind not in ROBOTS:
        base, turn = level_frame(own), numbers(robot, "camera_rotation", _NO_TURN)
        frame = base.inside(own_axes(_EYE, own.y_up), turn)
        candidates.insert(0, ("camera_", robot, frame))
    found: list[CameraFacts] = []
    absent: list[str] = []
    for prefix, node, frame in candidates:
        camera = _read(node, prefix, frame)
        if camera.width * camera.height > MOST_PIXELS:
            absent.append(camera.name)
        elif camera.name not in [other.name for other in found]:
            found.append(camera)
    return tuple(found), tuple(absent)


def _read(node: WbtNode, prefix: str, frame: NodeFrame) -> CameraFacts:
    """Reads a Camera, or the camera of the PROTO, whose fields have a prefix."""
    name = "camera" if prefix else text(node, "name", "camera")
    (width, height), view = _EPUCK_SIZE if prefix else _CAMERA_SIZE
    near = _NEAR if prefix else number(node, "near", 0.01)
    angle = number(node, f"{prefix}fieldOfView", view)
    return CameraFacts(
        name,
        _length(node, f"{prefix}width", width),
        _length(node, f"{prefix}height", height),
        angle if _NARROWEST <= angle <= math.pi - _NARROWEST else view,
        near if near > _CLOSEST else _NEAR,
        frame.origin,
        unit_axes(node, frame, f"the camera {name!r}"),
    )


def _length(node: WbtNode, field: str, usual: int) -> int:
    """A number of pixels; the default if the given number is below 1."""
    length = int(number(node, field, usual))
    return length if length >= 1 else usual
