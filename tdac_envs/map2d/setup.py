"""Configuration of a TDAC-Map2D-v0 environment, and the tasks of its episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from tdac_envs.core.arguments import (
    finite_numbers,
    finite_point,
    non_negative,
    number_up_to,
    one_of,
    positive,
    whole_number,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.disturbances import Random
from tdac_envs.drive.limits import MotionLimits
from tdac_envs.drive.setup import DriveSetup
from tdac_envs.drive.smallest_gap import required_gap
from tdac_envs.grid.map_units import MapFrame
from tdac_envs.map2d.placing import MoversSetup
from tdac_envs.map2d.rays import directions_of
from tdac_envs.map2d.reception import EXACT, Receiver, Reception
from tdac_envs.map2d.robot import FRICTION
from tdac_envs.map2d.sonar import Sonar
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.map2d.terrain import widest_connected_radius
from tdac_envs.mapping.params import RobotParams
from tdac_envs.movers.spec import AnySpec
from tdac_envs.physics.engine_choice import EXACT_STEP, Engine

MOST_STARTS = 100
"""Starts that are drawn until no mover touches the robot."""


@dataclass(frozen=True, slots=True, eq=False)
class Map2DSetup(DriveSetup):
    """The part of an environment that does not change between episodes.

    Attributes:
        range_noise: Relative standard deviation of each range.
        range_dropout: Probability that a ray reads the largest range.
        movers: Movers of all episodes, if the source of the tasks has none.
        metric: Frame in whose metres the robot observes; None for pixels.
        resolution: Metres per px where a task set converts what the robot observes.
        sensor: `"rays"` or `"sonar"`.
        range_min: Ranges below it are invalid, px; 0 for that of the robot.
        max_acceleration: Of a wheel, px/s²; 0 for that of the robot.
        reception: How pose and scan reach the robot.
        physics: What moves the robot.
        view: `"2d"` or `"3d"`, of frames.
        pixel_size: Metres per px of a map that has a resolution, for MuJoCo.
        sonar: The sonars; None with rays.
        directions: Directions of the rays, from `rays.directions_of`.
        movers_setup: The movers, checked on the map.
    """

    nominal: Map2DTask
    range_noise: float
    range_dropout: float
    movers: tuple[AnySpec, ...] = ()
    metric: MapFrame | None = None
    resolution: float | None = None
    sensor: str = "rays"
    range_min: float = 0.0
    max_acceleration: float = 0.0
    reception: Reception = EXACT
    physics: Engine = EXACT_STEP
    view: str = "2d"
    pixel_size: float | None = None
    sonar: Sonar | None = field(init=False)
    directions: NDArray[np.float64] = field(init=False)
    movers_setup: MoversSetup = field(init=False)

    def __post_init__(self) -> None:
        DriveSetup.__post_init__(self)
        one_of("view", self.view, ("2d", "3d"))
        noise = non_negative("range_noise", self.range_noise)
        dropout = number_up_to("range_dropout", self.range_dropout, 1.0)
        object.__setattr__(self, "range_noise", noise)
        object.__setattr__(self, "range_dropout", dropout)
        robot = self.nominal.robot
        least = non_negative("range_min", self.range_min) or robot.range_min or 0.0
        object.__setattr__(self, "range_min", least)
        if least >= robot.range_max:
            most = robot.range_max
            raise TaskError(
                f"expected range_min below {most:g} (range_max), got {least:g}"
            )
        object.__setattr__(self, "directions", directions_of(robot.angles()))
        one_of("sensor", self.sensor, ("rays", "sonar"))
        sonar = None
        if self.sensor == "sonar":
            if robot.scanner_offset:
                raise TaskError("scanner_offset: sonars are at the robot's centre")
            sonar = Sonar(robot.angles(), robot.range_max)
        object.__setattr__(self, "sonar", sonar)
        movers_setup = MoversSetup.of(self.movers, self.nominal)
        object.__setattr__(self, "movers_setup", movers_setup)
        if self.movers and self.variation == "nominal" and self.source is None:
            # A fault is found here, and not at the first reset.
            self.movers_setup.start(self.nominal, np.random.default_rng(0))

    def required_gap(self, task: Map2DTask) -> float:
        """See `DriveSetup.required_gap`."""
        own, clear = task.robot, task.terrain.clear
        widest = partial(widest_connected_radius, clear, task.start[:2], task.goal)
        return required_gap(own.radius, own.stopping_distance or 0.0, widest)

    @property
    def has_inexact_ranges(self) -> bool:
        """Whether ranges have noise, dropouts or a least value."""
        return bool(self.range_noise or self.range_dropout or self.range_min)

    @property
    def blind(self) -> float:
        """What a ray reads if the obstacle is nearer than `range_min`, px."""
        readings = {"range_min": self.range_min, "zero": 0.0}
        robot = self.nominal.robot
        return readings.get(robot.below_min or "", robot.range_max)

    @property
    def limits(self) -> MotionLimits:
        """Limits of the robot's motion."""
        robot = self.nominal.robot
        most = self.max_acceleration or robot.max_acceleration or 0.0
        turn = robot.max_turn_rate, robot.max_turn_acceleration
        return MotionLimits(most, robot.max_speed, *turn)

    def receiver(self) -> Receiver | None:
        """New memory of what a robot received; None if it observes all as it is."""
        if self.reception.is_exact:
            return None
        grid = self.nominal.terrain.grid
        return Receiver(self.reception, self.nominal.dt, grid.width, grid.height)

    @property
    def has_movers(self) -> bool:
        """Whether there are movers in an episode."""
        return bool(self.movers) or self.nominal.movers is not None

    @property
    def varies(self) -> bool:
        """Whether the task may differ from episode to episode."""
        return self.has_movers or bool(DriveSetup.varies.__get__(self))

    def draw(self, options: dict[str, Any], random: Random) -> tuple[Any, Random]:
        """The task of an episode with its movers; see `DriveSetup.draw`.

        A start at which a mover would touch the robot is drawn anew, if it is drawn.
        """
        drawn, noise = DriveSetup.draw(self, options, random)
        if not self.movers:
            return drawn, noise
        again = 0 if options or self.variation == "nominal" else MOST_STARTS
        while True:
            try:
                movers = self.movers_setup.start(drawn, noise)
            except TaskError:
                if again == 0:
                    raise
                again -= 1
                drawn, noise = DriveSetup.draw(self, options, random)
            else:
                return replace(drawn, movers=movers), noise

    def constants(self) -> NDArray[np.float64]:
        """`Map2DArrays.constants` of the nominal task."""
        robot = self.nominal.robot
        own = robot.max_wheel_speed, robot.range_max, FRICTION
        limits = self.limits.fractions(
            robot.max_wheel_speed, robot.axle_length, self.nominal.dt
        )
        shared = self.shared_constants(*own, limits)
        return np.array([*shared, *(robot.scanner_offset or (0.0, 0.0))], np.float64)

    def world(self, task: Map2DTask) -> tuple[NDArray[Any], ...]:
        """The arrays that `begin` and `drive` take in addition to the robot's."""
        terrain = task.terrain
        return terrain.leaps, terrain.padded_clear, task.field, self.directions


OVERRIDDEN = (
    *("axle_length", "max_wheel_speed", "n_rays", "field_of_view", "range_max"),
    *("ray_angles", "range_min", "below_min", "scanner_offset"),
    *("max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration"),
    "stopping_distance",
)
"""Arguments of `override`."""
_MAY_BE_ZERO = "range_min", "max_acceleration", "stopping_distance"


def override(
    robot: RobotParams,
    ray_angles: Sequence[float] | None = None,
    scanner_offset: Sequence[float] | None = None,
    below_min: str | None = None,
    **given: float | None,
) -> RobotParams:
    """The robot with the options that are not None.

    Angles of rays determine their number.

    Raises:
        TaskError: An option is not valid.
    """
    changes: dict[str, Any] = {}
    if ray_angles is not None:
        angles = finite_numbers("ray_angles", ray_angles, np.size(ray_angles))
        changes = {"ray_angles": angles, "n_rays": len(angles)}
    if scanner_offset is not None:
        changes["scanner_offset"] = finite_point("scanner_offset", scanner_offset)
    if below_min is not None:
        one_of("below_min", below_min, ("range_max", "range_min", "zero"))
        changes["below_min"] = below_min
    for name, value in given.items():
        if value is None:
            continue
        if name in _MAY_BE_ZERO:
            changes[name] = non_negative(name, value) or None
        elif name == "n_rays":
            changes[name] = whole_number(name, value, 1)
        else:
            key = "field_of_view_deg" if name == "field_of_view" else name
            changes[key] = positive(name, value)
    try:
        return robot.changed(**changes)
    except ValidationError as error:
        first = error.errors()[0]
        if not first["loc"]:
            raise TaskError(first["msg"].removeprefix("Value error, ")) from None
        name = str(first["loc"][0]).removesuffix("_deg")
        raise TaskError(f"{name} {first['input']!r}: {first['msg']}") from None
