"""What drives show of a robot: how it obeys commands, and what its readings mean.

All figures are measured in drives, from commands, true motion and readings; none is
read from the robot's file. The text is in the frame and the units that a controller
observes.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.parts import Surroundings
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.surroundings import (
    surroundings_of,
    trajectory_on_screen,
)
from tdac_agent.verification.diagnosis.wheel_log import WheelLog
from tdac_envs.drive.task import Pose

LOOKS = 12
"""Steps of an episode at which its readings are compared with the nearest obstacle."""
REACH = 6.0
"""Obstacles are looked for within so many body radii."""
LEAST_LOOKS, LEAST_RATIOS = 4, 30
MOST_RAYS = 9
"""Most readings that get a direction of their own."""
_AGREE = math.radians(25.0)
_OFF, _NEAR = 0.3, 0.08
"""A reading that differs more from the distance is of something else, or of another
side of it."""


@dataclass(slots=True)
class RobotLog:
    """Adds up over episodes, of all candidates of a run.

    Attributes:
        wheels: What they show of the wheels.
    """

    wheels: WheelLog = field(default_factory=WheelLog)
    _units: Units | None = None
    _bearings: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))
    _ratios: list[float] = field(default_factory=list)
    _touches: list[float] = field(default_factory=list)
    _readings: int = 0

    def add(self, trajectory: Trajectory, task: Nominal, shown: Units) -> None:
        """Adds an episode.

        Args:
            trajectory: The episode, in units of its environment.
            task: Its task.
            shown: Units and frame that the controller observes.
        """
        if not trajectory.steps:
            return
        self._units = shown
        self.wheels.add(trajectory, task, up=shown.up)
        around = surroundings_of(task, shown)
        on_screen = trajectory_on_screen(trajectory, shown)
        self._add_touch(on_screen, around)
        self._add_readings(on_screen, around)

    @property
    def lines(self) -> list[str]:
        """The table, one line for each figure; none before anything was shown."""
        if self._units is None:
            return []
        found = [*self.wheels.lines(self._units), *self._reading_lines(self._units)]
        if self._touches:
            far = self._units.far(float(np.median(self._touches)))
            found.append(f"the body touched walls that were {far} from its centre")
        return found

    def _add_touch(self, trajectory: Trajectory, around: Surroundings) -> None:
        if trajectory.collisions and trajectory.movers is None:
            reach = 1.5 * around.radius
            touch = around.touch(Pose(*trajectory.poses[-1].tolist()), reach)
            if touch is not None:
                self._touches.append(touch.gap + around.radius)

    def _add_readings(self, trajectory: Trajectory, around: Surroundings) -> None:
        """Notes which reading pointed at the nearest obstacle."""
        units, radius = around.units, around.radius
        self._readings = trajectory.ranges.shape[1]
        per = 1.0 if units.shown is None else units.shown.per_pixel
        for step in np.linspace(0, trajectory.steps - 1, LOOKS).astype(int).tolist():
            touch = around.touch(Pose(*trajectory.poses[step].tolist()), REACH * radius)
            if touch is None:
                continue
            row = trajectory.ranges[step].astype(np.float64)
            if _intensities(units):
                self._bearings[int(row.argmax())].append(touch.bearing)
                continue
            ray = int(row.argmin())
            ratio = float(row[ray]) / ((touch.gap + radius) * per)
            if abs(ratio - 1.0) < _NEAR:
                self._bearings[ray].append(touch.bearing)
            if abs(ratio - 1.0) < _OFF:
                self._ratios.append(ratio)

    def _reading_lines(self, units: Units) -> list[str]:
        sure = {
            ray: float(np.median(found))
            for ray, found in sorted(self._bearings.items())
            if len(found) >= LEAST_LOOKS and _spread(found) < _AGREE
        }
        if len(sure) < 2:
            return []
        rays = list(sure)
        some = np.linspace(0, len(rays) - 1, min(MOST_RAYS, len(rays))).astype(int)
        places = ", ".join(f"{rays[i]}: {_side(sure[rays[i]])}" for i in some.tolist())
        which = "largest" if _intensities(units) else "smallest"
        lines = [
            f"where the nearest obstacle was when one of the {self._readings} readings "
            f"was the {which} (by its index): {places}"
        ]
        if len(self._ratios) >= LEAST_RATIOS:
            lines.append(
                "the smallest reading divided by the distance from the robot's centre "
                f"to that obstacle: {np.median(self._ratios):.2f}, SD "
                f"{np.std(self._ratios):.2f}"
            )
        return lines


def _intensities(units: Units) -> bool:
    """Whether readings are those of infra-red sensors, which grow near an obstacle."""
    return units.place == "m"


def _spread(bearings: list[float]) -> float:
    """How far apart the middle half of some bearings is, rad."""
    middle = math.atan2(float(np.sin(bearings).sum()), float(np.cos(bearings).sum()))
    off = [math.remainder(each - middle, math.tau) for each in bearings]
    return float(np.subtract(*np.quantile(off, (0.75, 0.25))))


def _side(bearing: float) -> str:
    """A bearing in words: `ahead`, `40° left`."""
    degrees = round(math.degrees(bearing))
    if abs(degrees) < 3:
        return "ahead"
    return f"{abs(degrees)}° {'right' if degrees > 0 else 'left'}"
