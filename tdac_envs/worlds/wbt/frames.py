"""Frames: position, rotation and scale of nodes.

Two conventions differ between versions of Webots, and a file may mix them: the *world*
axis that points up (ENU: z; NUE and EUN: y), and the axes of *objects* (FLU since
R2022a: x forward, z up; RUB before: -z forward, y up).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

# (x, y, z) -> (-z, -x, y), as in Webots' own converter of worlds and objects.
Y_UP_TO_Z_UP: Matrix = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class NodeFrame:
    """An affine map from a node's coordinates to the world's (ENU).

    Attributes:
        matrix: Rotation and scale, shape (3, 3).
        origin: Origin of the node in the world, shape (3,), m.
        y_up: Whether the axes of objects are RUB (y up) instead of FLU.
    """

    matrix: Matrix
    origin: Vector
    y_up: bool

    def inside(
        self,
        translation: ArrayLike = (0.0, 0.0, 0.0),
        rotation: tuple[float, ...] = (0.0, 0.0, 1.0, 0.0),
        scale: ArrayLike = (1.0, 1.0, 1.0),
    ) -> NodeFrame:
        """The frame of a child."""
        turn = axis_angle(*rotation) * np.asarray(scale, np.float64)
        return NodeFrame(self.matrix @ turn, self.at(translation), self.y_up)

    def at(self, point: ArrayLike) -> Vector:
        """World coordinates of points, shape (..., 3)."""
        at = np.asarray(point, np.float64)
        return np.asarray(at @ self.matrix.T + self.origin)

    def flu(self) -> NodeFrame:
        """The same frame with the axes forward, left, up."""
        if not self.y_up:
            return self
        return NodeFrame(self.matrix @ Y_UP_TO_Z_UP.T, self.origin, False)

    @property
    def heading(self) -> float:
        """Direction of the x axis in the ground plane, rad."""
        return math.atan2(self.matrix[1, 0], self.matrix[0, 0])

    @property
    def tilt(self) -> float:
        """Angle between the z axis and the vertical, rad."""
        x, y, z = self.matrix[:, 2].tolist()
        return math.atan2(math.hypot(x, y), z)


def world_frame(z_up: bool, y_up_objects: bool) -> NodeFrame:
    """The frame of the top-level nodes of a file."""
    matrix = np.eye(3) if z_up else Y_UP_TO_Z_UP
    return NodeFrame(matrix, np.zeros(3), y_up_objects)


def flu_size(size: tuple[float, ...], y_up: bool) -> tuple[float, float, float]:
    """Lengths along forward, left and up, from lengths along x, y and z."""
    x, y, z = size
    return (z, x, y) if y_up else (x, y, z)


def own_axes(vector: tuple[float, float, float], y_up: bool) -> tuple[float, ...]:
    """A vector (forward, left, up) in an object's own x, y and z."""
    forward, left, up = vector
    return (-left, up, -forward) if y_up else vector


def axis_angle(x: float, y: float, z: float, angle: float) -> Matrix:
    """Rotation matrix (Rodrigues), shape (3, 3); no rotation about a zero axis."""
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        return np.eye(3)
    x, y, z = x / length, y / length, z / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + math.sin(angle) * cross
    return np.asarray(turn + (1.0 - math.cos(angle)) * (cross @ cross))
