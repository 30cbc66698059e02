"""The nodes that are mounted on a robot, and their frames relative to it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.wbt.fields import children, number_list
from tdac_envs.worlds.wbt.frames import NodeFrame, axis_angle, own_axes, world_frame
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import EPuck

_TURRET, _UNDER = (-0.0095, 0.0, 0.0486), (0.03, 0.0, 0.0003)
# Before R2022a, the axes of the slot for ground sensors were turned.
_UNDER_TURN = (0.0, 0.0, 1.0, -1.57)
# Translations of PROTOs of Webots' library if the file gives none, m.
_PLACES = {"RobotisLds01": (0.0, 0.0, 0.02)}
_LEAST_SCALE = 1e-6
_NO_FRAME = ("Group", "HingeJoint", "SliderJoint", "Slot")


class Mount(NamedTuple):
    """A mounted node.

    Attributes:
        node: The node.
        frame: Its frame relative to the robot. The robot's axes are forward, left and
            up; its origin is on the ground between the wheels.
    """

    node: WbtNode
    frame: NodeFrame


def level_frame(own: NodeFrame) -> NodeFrame:
    """The frame of the PROTO's node in the robot's axes (forward, left, up)."""
    return world_frame(not own.y_up, own.y_up)


def unit_axes(node: WbtNode, frame: NodeFrame, what: str) -> NDArray[np.float64]:
    """The axes of a frame, forward, left and up, of length 1 as columns.

    Raises:
        WorldError: The frame is scaled to a point.
    """
    axes = frame.flu().matrix
    lengths = np.linalg.norm(axes, axis=0)
    if lengths.min() < _LEAST_SCALE:
        raise node.error(f"{what} has the scale 0")
    return np.asarray(axes / lengths)


def lookup_table(node: WbtNode, usual: tuple[float, ...]) -> tuple[float, ...]:
    """The `lookupTable` of a sensor, or the usual one if it is empty.

    Raises:
        WorldError: It does not consist of rows of 3 numbers.
    """
    table = number_list(node, "lookupTable") or usual
    if len(table) % 3:
        raise node.error("expected rows of 3 numbers for lookupTable", "lookupTable")
    return table


def sorted_rows(table: tuple[float, ...]) -> NDArray[np.float64]:
    """A lookup table as an array, shape (n, 3), in the order of its inputs."""
    rows = np.array(table).reshape(-1, 3)
    return np.asarray(rows[np.argsort(rows[:, 0], kind="stable")])


def in_world(
    pose: tuple[float, float, float],
    base: float,
    place: NDArray[np.float64],
    axis: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A place on the robot and a direction, in the world.

    Args:
        pose: x, y (m) and heading (rad) of the robot.
        base: Height of the robot's origin, m.
        place: Position relative to the robot: forward, left, up, m, shape (3,).
        axis: Direction in these axes, shape (3,).
    """
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return turn @ place + (x, y, base), turn @ axis


def mounts(robot: WbtNode, own: NodeFrame, epuck: EPuck) -> Iterator[Mount]:
    """All nodes in the slots of an e-puck or in a Robot node.

    Args:
        robot: Node of the e-puck: the PROTO or a plain Robot.
        own: Its frame.
        epuck: The e-puck in the world.

    Raises:
        WorldError: A field of a Camera is invalid.
    """
    if robot.kind in ROBOTS:
        # An e-puck in a file is often saved with a slight tilt, but drives upright.
        level = axis_angle(0.0, 0.0, 1.0, -epuck.heading)
        origin = own.origin - (epuck.x, epuck.y, epuck.z)
        yield from _within(
            robot, NodeFrame(level @ own.matrix, level @ origin, own.y_up)
        )
        return
    base = level_frame(own)
    turret = base.inside(own_axes(_TURRET, own.y_up))
    turn = _UNDER_TURN if own.y_up else (0.0, 0.0, 1.0, 0.0)
    under = base.inside(own_axes(_UNDER, own.y_up), turn)
    for slot, frame in (("turretSlot", turret), ("groundSensorsSlot", under)):
        for node in children(robot, slot):
            yield from _mounted(node, frame)


def _within(node: WbtNode, frame: NodeFrame) -> Iterator[Mount]:
    for field in ("children", "endPoint", "device"):
        for part in children(node, field):
            yield from _mounted(part, frame)


def _mounted(node: WbtNode, frame: NodeFrame) -> Iterator[Mount]:
    if node.kind not in _NO_FRAME:
        try:
            frame = placed(node, frame, _PLACES.get(node.kind, (0.0, 0.0, 0.0)))
        except WorldError:
            if node.kind == "Camera":
                raise
            return  # fields of an unknown node may have another meaning
    yield Mount(node, frame)
    yield from _within(node, frame)
