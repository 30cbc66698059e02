"""Where nodes are: translations and rotations, from the root down."""

from __future__ import annotations

import math
from typing import Any

Matrix = list[list[float]]

IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def rotation_matrix(axis_angle: list[float]) -> Matrix:
    """Of an axis (of any length) and an angle, rad."""
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
    """Of two matrices."""
    return [
        [sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)
    ]


def moved(a: Matrix, by: list[float], point: list[float]) -> list[float]:
    """A point of a frame in the frame around it."""
    return [by[i] + sum(a[i][k] * point[k] for k in range(3)) for i in range(3)]


def transposed(a: Matrix) -> Matrix:
    """The inverse of a rotation."""
    return [list(column) for column in zip(*a, strict=True)]


def absolute(
    scene: list[dict[str, Any]], live: dict[int, Any], number: int
) -> tuple[list[float], Matrix]:
    """Where a node is in the world: position and rotation.

    Args:
        scene: All nodes.
        live: Translation and rotation in the world of those that move, by number.
        number: Of the node.
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
