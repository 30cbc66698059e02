"""Queries of a diagnosis about a map, in px."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.start_frame import StartFrame
from tdac_agent.tasks.units import PIXELS, Point, Points, Units
from tdac_agent.verification.diagnosis.touch import Touch
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import body_free
from tdac_envs.grid.plan import Path, descend, first_beyond
from tdac_envs.map2d.rays import sees
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import path_entry
from tdac_envs.mapping.ray_angles import faces

_PARTS = 0.0, -0.95, 0.95, -0.5, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class MapSurroundings:
    """The map of a task; see `Surroundings`.

    Attributes:
        task: The task.
        units: Pixels; texts may be in metres.
    """

    task: Map2DTask
    units: Units = PIXELS

    def shown_in(self, units: Units) -> MapSurroundings:
        """Returns the same with texts in other units."""
        return replace(self, units=units)

    @property
    def radius(self) -> float:
        """Radius of the body, px."""
        return self.task.robot.radius

    @property
    def full_speed(self) -> float:
        """Full speed of the body, px/s."""
        return self.task.robot.max_wheel_speed

    def touch(self, pose: Pose, reach: float) -> Touch | None:
        """Returns the nearest wall within `reach`."""
        return nearest_touch(self.task, pose, reach)

    def seen(self, touch: Touch, trajectory: Trajectory) -> str:
        """Describes whether a ray points at the touched wall."""
        angles = self.task.robot.angles()
        if not faces(angles, touch.bearing):
            off, half = (math.degrees(abs(a)) for a in (touch.bearing, angles[-1]))
            digits = 1 if off < half + 1.0 else 0
            return (
                f"No ray points there: it is {off:.{digits}f}° off the heading; the "
                f"fan covers {_covered(angles)}."
            )
        earlier = min(trajectory.steps, 10)
        shortest = float(trajectory.ranges[trajectory.steps - earlier].min())
        return (
            f"{earlier} steps earlier the shortest ray read "
            f"{self.units.far(shortest)} (from the centre of the body)."
        )

    def in_sight(self, pose: Pose, place: Point, radius: float) -> bool:
        """See `Surroundings`: whether a ray of a dense fan would end at the disc."""
        robot, (x, y) = self.task.robot, place
        angles = robot.angles()
        far, towards = math.dist(pose[:2], place), math.atan2(y - pose.y, x - pose.x)
        if far <= radius:
            return True
        for part in _PARTS:
            # The ray passes the disc's centre at this distance.
            aside = part * radius
            angle = towards + math.asin(aside / far)
            reach = math.sqrt(far**2 - aside**2) - math.sqrt(radius**2 - aside**2)
            end = pose.x + reach * math.cos(angle), pose.y + reach * math.sin(angle)
            if (
                reach <= robot.range_max
                and faces(angles, angle - pose.heading)
                and sees(self.task.terrain.leaps, pose.x, pose.y, *end)
            ):
                return True
        return False

    def path_from(self, pose: Pose) -> Path:
        """Returns the shortest grid path to the goal."""
        return self.task.path_from(pose)

    def pull(self, path: Path) -> list[Point]:
        """Returns the corners of a path after all shortcuts."""
        return self.task.pulled(path)

    def places_ahead(self, places: Points, far: float) -> Iterator[Point | None]:
        """Yields the path's first point `far` away from each place, or its end."""
        task = self.task
        free = body_free(task.terrain.clear, task.robot.radius)
        field = np.asarray(task.field, np.float64)
        for x, y in places.tolist():
            first = path_entry(task.terrain, task.field, x, y, task.robot.radius)
            if first is None:
                yield None
                continue
            yield first_beyond(descend(free, field, first), x, y, far)

    def mistaken_goals(self) -> dict[str, Point]:
        """Returns where typical coordinate mistakes put the goal, by description."""
        frame = self.units.shown
        if isinstance(frame, StartFrame):
            x, y = frame.coordinates(*self.task.goal)
            return {
                "x and y swapped": frame.pixels((y, x)),
                "y counted to the left": frame.pixels((x, -y)),
            }
        grid, (x, y) = self.task.terrain.grid, self.task.goal
        return {
            "x and y swapped": (y, x),
            "y counted from the lower side of the map": (x, grid.height - 1 - y),
            "x counted from the right side of the map": (grid.width - 1 - x, y),
        }


# Largest distance of a wall's outline from its polygon: hand-drawn walls are rough, and
# a corner rounded by less than half a radius is still a corner to the body.
_ROUGHNESS, _ROUGHNESS_RADII = 1.5, 0.15
# Area relative to a circle of the same circumference; rounder posts have no corners.
_ROUND = 0.83
_SHARPEST_STRAIGHT = math.radians(135.0)
# Below this angle, the outline turns back at the end of a thin wall.
_WALL_END = math.radians(20.0)


def _covered(angles: NDArray[np.float64]) -> str:
    """Formats the angles that rays cover: `±55°`, `-10° to 90°`."""
    first, last = (round(math.degrees(a), 6) for a in (angles.min(), angles.max()))
    return f"±{last:g}°" if first == -last else f"{first:g}° to {last:g}°"


def nearest_touch(task: Map2DTask, pose: Pose, reach: float) -> Touch | None:
    """Returns what the body touches or would touch first; None if nothing is in reach.

    Args:
        task: The task, for its map and body.
        pose: Pose of the body.
        reach: Largest distance from the centre of the body, px.
    """
    nearest = _nearest_square(task, pose.x, pose.y, reach)
    if nearest is None:
        return None
    wall, border = nearest
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
