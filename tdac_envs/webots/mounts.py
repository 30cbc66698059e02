"""The nodes that are mounted on a robot, and their frames relative to it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.wbt.fields import children
from tdac_envs.worlds.wbt.frames import Frame, axis_angle, own_axes, world_frame
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import Node
from tdac_envs.worlds.world import EPuck

_TURRET, _UNDER = (-0.0095, 0.0, 0.0486), (0.03, 0.0, 0.0003)
# Before R2022a, the axes of the slot for ground sensors were turned.
_UNDER_TURN = (0.0, 0.0, 1.0, -1.57)
# Translations of PROTOs of Webots' library if the file gives none, m.
_PLACES = {"RobotisLds01": (0.0, 0.0, 0.02)}
_NO_FRAME = ("Group", "HingeJoint", "SliderJoint", "Slot")


class Mount(NamedTuple):
    """A mounted node.

    Attributes:
        node: The node.
        frame: Its frame relative to the robot. The robot's axes are forward, left and
            up; its origin is on the ground between the wheels.
    """

    node: Node
    frame: Frame


def mounts(robot: Node, own: Frame, epuck: EPuck) -> Iterator[Mount]:
    """All nodes in the slots of an e-puck or in a Robot node.

    Args:
        robot: Node of the e-puck: the PROTO or a plain Robot.
        own: Its frame.
        epuck: The e-puck in the world.
    """
    if robot.kind in ROBOTS:
        # An e-puck in a file is often saved with a slight tilt, but drives upright.
        level = axis_angle(0.0, 0.0, 1.0, -epuck.heading)
        origin = own.origin - (epuck.x, epuck.y, epuck.z)
        yield from _within(robot, Frame(level @ own.matrix, level @ origin, own.y_up))
        return
    base = world_frame(not own.y_up, own.y_up)
    turret = base.inside(own_axes(_TURRET, own.y_up))
    turn = _UNDER_TURN if own.y_up else (0.0, 0.0, 1.0, 0.0)
    under = base.inside(own_axes(_UNDER, own.y_up), turn)
    for slot, frame in (("turretSlot", turret), ("groundSensorsSlot", under)):
        for node in children(robot, slot):
            yield from _mounted(node, frame)


def _within(node: Node, frame: Frame) -> Iterator[Mount]:
    for field in ("children", "endPoint", "device"):
        for part in children(node, field):
            yield from _mounted(part, frame)


def _mounted(node: Node, frame: Frame) -> Iterator[Mount]:
    if node.kind not in _NO_FRAME:
        try:
            frame = placed(node, frame, _PLACES.get(node.kind, (0.0, 0.0, 0.0)))
        except WorldError:  # fields of an unknown node may have another meaning
            return
    yield Mount(node, frame)
    yield from _within(node, frame)
