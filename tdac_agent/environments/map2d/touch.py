"""The wall nearest to the body on a map, and its corners."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_agent.tasks.units import Point
from tdac_agent.verification.diagnosis.touch import Touch
from tdac_envs.drive.task import Pose
from tdac_envs.map2d.task import Map2DTask

# Largest distance of a wall's outline from its polygon: hand-drawn walls are rough, and
# a corner rounded by less than half a radius is still a corner to the body.
_ROUGHNESS, _ROUGHNESS_RADII = 1.5, 0.15
# Area relative to a circle of the same circumference; rounder posts have no corners.
_ROUND = 0.83
_SHARPEST_STRAIGHT = math.radians(135.0)
# Below this angle, the outline turns back at the end of a thin wall.
_WALL_END = math.radians(20.0)


def nearest_touch(task: Map2DTask, pose: Pose, reach: float) -> Touch | None:
    """Returns what the body touches or would touch first; None if nothing is in reach.

    Args:
        task: The task, for its map and body.
        pose: Pose of the body.
        reach: Largest distance from the centre of the body, px.
    """
    found = _nearest_square(task, pose.x, pose.y, reach)
    if found is None:
        return None
    wall, border = found
    bearing = math.atan2(wall[1] - pose.y, wall[0] - pose.x) - pose.heading
    return Touch(
        wall=wall,
        bearing=math.remainder(bearing, 2.0 * math.pi),
        gap=max(math.dist(pose[:2], wall) - task.robot.radius, 0.0),
        border=border,
        corner=None if border else nearest_corner(task, wall, task.robot.radius),
        thing="border of the map" if border else "wall",
    )


def nearest_corner(task: Map2DTask, point: Point, reach: float) -> Point | None:
    """Returns the nearest outer corner or end of a wall to a point of its outline.

    Args:
        task: The task, for its map.
        point: (x, y), px.
        reach: Largest distance from the point, px.
    """
    # The edge of the window adds corners, which are beyond the reach.
    cells, left, top = _window(task, *point, 2.0 * reach + 8.0)
    outlines, _ = cv2.findContours(
        cells.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE
    )
    rough = max(_ROUGHNESS, _ROUGHNESS_RADII * task.robot.radius)
    corners = [
        (float(x + left), float(y + top))
        for outline in outlines
        for x, y in _outer_corners(outline, rough)
    ]
    near = [corner for corner in corners if math.dist(corner, point) <= reach]
    return min(near, key=lambda corner: math.dist(corner, point), default=None)


def _outer_corners(outline: NDArray[Any], rough: float) -> NDArray[np.float64]:
    """Returns the outer corners of a wall from its outline pixels, shape (n, 2)."""
    vertices = np.asarray(cv2.approxPolyDP(outline, rough, True), float).reshape(-1, 2)
    around = cv2.arcLength(outline, True)
    if len(vertices) < 2 or 4 * math.pi * cv2.contourArea(outline) > _ROUND * around**2:
        return np.empty((0, 2))
    back = _unit(np.roll(vertices, 1, axis=0) - vertices)
    ahead = _unit(np.roll(vertices, -1, axis=0) - vertices)
    angle = np.arccos(np.clip((back * ahead).sum(axis=1), -1.0, 1.0))
    # OpenCV traces outlines, also those of holes, with the wall on the same side.
    outer = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0] > 0.0
    chosen = (angle <= _WALL_END) | (outer & (angle < _SHARPEST_STRAIGHT))
    outward = -(back + ahead)[chosen]
    # Outlines connect the centres of pixels; corners are half a pixel farther out.
    return np.asarray(vertices[chosen] + 0.5 * np.sign(np.round(outward, 1)))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.hypot(*vectors.T)[:, None])


def _nearest_square(
    task: Map2DTask, x: float, y: float, reach: float
) -> tuple[Point, bool] | None:
    """Returns the nearest point of an occupied square, and whether it is the border."""
    cells, left, top = _window(task, x, y, reach)
    rows, columns = np.nonzero(cells)
    if rows.size == 0:
        return None
    near_x = np.clip(x, columns + left - 0.5, columns + left + 0.5)
    near_y = np.clip(y, rows + top - 0.5, rows + top + 0.5)
    nearest = int(np.argmin((near_x - x) ** 2 + (near_y - y) ** 2))
    i, j = int(columns[nearest] + left), int(rows[nearest] + top)
    grid = task.terrain.grid
    inside = 0 <= i < grid.width and 0 <= j < grid.height
    point = float(near_x[nearest]), float(near_y[nearest])
    return (point, not inside) if math.dist(point, (x, y)) <= reach else None


def _window(
    task: Map2DTask, x: float, y: float, reach: float
) -> tuple[NDArray[np.bool_], int, int]:
    """Returns the cells around a point, and the pixel (x, y) of the first cell.

    They include a border of one occupied pixel around the map.
    """
    clear = task.terrain.padded_clear
    height, width = clear.shape
    x0, y0 = max(math.floor(x - reach) + 1, 0), max(math.floor(y - reach) + 1, 0)
    x1, y1 = min(math.ceil(x + reach) + 2, width), min(math.ceil(y + reach) + 2, height)
    return clear[y0:y1, x0:x1] == 0.0, x0 - 1, y0 - 1
