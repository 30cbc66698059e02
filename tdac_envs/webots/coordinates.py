"""Conversion from the environment's frame (ENU) to the coordinates of a file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.wbt.fields import children
from tdac_envs.worlds.wbt.frames import Matrix, NodeFrame, axis_angle
from tdac_envs.worlds.wbt.geometry import GROUPS
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.robots import is_epuck
from tdac_envs.worlds.wbt.tree import WbtNode

Found = tuple[WbtNode, NodeFrame]

_CONTAINERS = (*GROUPS, "Solid")


@dataclass(frozen=True, slots=True, eq=False)
class FileFrame:
    """Converts the pose of the robot, or of a movable object, to file coordinates.

    Attributes:
        world: Rotation from the file's coordinates to ENU, shape (3, 3).
        turn: Rotation from the robot's axes to ENU at the start, shape (3, 3).
        heading: Heading at the start, rad.
        height: z of the robot's origin, m.
    """

    world: Matrix
    turn: Matrix
    heading: float
    height: float

    @classmethod
    def of(cls, top: NodeFrame, robot: NodeFrame, heading: float) -> FileFrame:
        """The conversion for the frame of a file and a robot's frame and heading."""
        return cls(top.matrix, robot.matrix, heading, float(robot.origin[2]))

    def vector(self, x: float, y: float, z: float = 0.0) -> list[float]:
        """An ENU vector in the file's coordinates."""
        return [float(value) for value in self.world.T @ (x, y, z)]

    def point(self, x: float, y: float) -> list[float]:
        """The robot's position in the file's coordinates, from ENU x and y, m."""
        return self.vector(x, y, self.height)

    def rotation(self, heading: float) -> Matrix:
        """Rotation from the robot's axes to the file's coordinates, shape (3, 3)."""
        spin = axis_angle(0.0, 0.0, 1.0, heading - self.heading)
        return np.asarray(self.world.T @ spin @ self.turn)

    def axis_angle(self, heading: float) -> list[float]:
        """`rotation` as an axis (x, y, z) and an angle in [0, pi]."""
        vector = Rotation.from_matrix(self.rotation(heading)).as_rotvec()
        angle = float(np.linalg.norm(vector))
        if angle < 1e-12:
            return [0.0, 0.0, 1.0, 0.0]
        return [*(float(part / angle) for part in vector), angle]

    def attitude(self, heading: float) -> list[float]:
        """Roll, pitch, yaw (rad) and quaternion (x, y, z, w) of an InertialUnit."""
        turn = self.rotation(heading)
        if abs(self.world[2, 2]) > 0.5:  # z is up
            roll = math.atan2(turn[2, 1], turn[2, 2])
            pitch = -math.asin(float(np.clip(turn[2, 0], -1.0, 1.0)))
            yaw = math.atan2(turn[1, 0], turn[0, 0])
        else:
            roll = math.atan2(-turn[1, 2], turn[1, 1])
            pitch = math.asin(float(np.clip(turn[1, 0], -1.0, 1.0)))
            yaw = math.atan2(-turn[2, 0], turn[0, 0])
        quaternion = Rotation.from_matrix(turn).as_quat()
        return [roll, pitch, yaw, *(float(part) for part in quaternion)]

    def north(self, heading: float) -> list[float]:
        """North in the robot's axes; north is +y in the file, or +x if y is up."""
        ahead = (0.0, 1.0, 0.0) if abs(self.world[2, 2]) > 0.5 else (1.0, 0.0, 0.0)
        return [float(value) for value in self.rotation(heading).T @ ahead]


def walk_frames(nodes: Iterable[WbtNode], frame: NodeFrame) -> Iterator[Found]:
    """Yields nodes that have a position, with their frames, outer nodes first."""
    for node in nodes:
        is_container = node.kind in _CONTAINERS
        if node.kind == "Group":
            own = frame
        elif "translation" in node.fields or is_epuck(node) or is_container:
            try:
                own = placed(node, frame, scaled=is_container)
            except WorldError:  # fields of an unknown node may mean something else
                continue
        else:
            continue
        yield node, own
        if is_container:
            yield from walk_frames(children(node), own)
