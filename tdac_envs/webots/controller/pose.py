"""Poses of nodes, composed of the translations and rotations of their parents."""

from __future__ import annotations

import math
from typing import Any

Matrix = list[list[float]]

IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def rotation_matrix(axis_angle: list[float]) -> Matrix:
    """Rotation matrix of an axis (of any length) and an angle, rad."""
    x, y, z, angle = axis_angle
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        return [row[:] for row in IDENTITY]
    x, y, z = x / length, y / length, z / length
    c, s = math.cos(angle), math.sin(angle)
    k = 1.0 - c
    return [
        [c + x * x * k, x * y * k - z * s, x * z * k + y * s],
        [y * x * k + z * s, c + y * y * k, y * z * k - x * s],
        [z * x * k - y * s, z * y * k + x * s, c + z * z * k],
    ]


def product(a: Matrix, b: Matrix) -> Matrix:
    """Product of two matrices."""
    return [
        [sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)
    ]


def moved(a: Matrix, by: list[float], point: list[float]) -> list[float]:
    """Converts a point of a frame to the parent frame: `a @ point + by`."""
    return [by[i] + sum(a[i][k] * point[k] for k in range(3)) for i in range(3)]


def transposed(a: Matrix) -> Matrix:
    """The transpose, which is the inverse of a rotation."""
    return [list(column) for column in zip(*a, strict=True)]


def absolute(
    scene: list[dict[str, Any]], live: dict[int, Any], number: int
) -> tuple[list[float], Matrix]:
    """Position and rotation of a node in the world.

    Args:
        scene: All nodes.
        live: World translation and rotation of moved nodes, by number.
        number: Number of the node.
    """
    position, turn = [0.0, 0.0, 0.0], IDENTITY
    while number >= 0:
        node = scene[number]
        fields = {name: value for name, _, value in node["fields"]}
        if number in live:
            translation, rotation = live[number]
        else:
            translation = fields.get("translation", [0.0, 0.0, 0.0])
            rotation = fields.get("rotation", [0.0, 0.0, 1.0, 0.0])
        own = rotation_matrix(rotation)
        position = moved(own, translation, position)
        turn = product(own, turn)
        if number in live:
            break
        number = node["parent"]
    return position, turn
