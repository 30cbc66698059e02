"""Queries of a diagnosis about a map, in px."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tdac_agent.environments.map2d.touch import nearest_touch
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
        half = self.task.robot.field_of_view_deg / 2.0
        off = abs(math.degrees(touch.bearing))
        if off > half:
            digits = 1 if off < half + 1.0 else 0
            return (
                f"No ray points there: it is {off:.{digits}f}° off the heading; the "
                f"fan covers ±{half:g}°."
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
        far, towards = math.dist(pose[:2], place), math.atan2(y - pose.y, x - pose.x)
        if far <= radius:
            return True
        for part in _PARTS:
            # The ray passes the disc's centre at this distance.
            aside = part * radius
            angle = towards + math.asin(aside / far)
            reach = math.sqrt(far**2 - aside**2) - math.sqrt(radius**2 - aside**2)
            off = abs(math.remainder(angle - pose.heading, math.tau))
            end = pose.x + reach * math.cos(angle), pose.y + reach * math.sin(angle)
            if (
                reach <= robot.range_max
                and off <= math.radians(robot.field_of_view_deg) / 2.0
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
