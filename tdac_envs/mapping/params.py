"""`params.json`: the choices of a map's preprocessing, and the task on the map."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from tdac_envs.core.arguments import LARGEST, SMALLEST, positive
from tdac_envs.core.errors import MapError, TaskError, first_problem
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.mapping.ray_angles import FULL_CIRCLE, fan

PIXELS_PER_METRE = 3779.52
"""Pixels per metre of the paper's 2-D setting (96 dpi)."""

METRIC_RADIUS = 0.2
"""Body radius for which a map with a resolution is read without a task, m."""
METRIC_SPEED = 0.5
"""Default wheel speed limit where metres are known, m/s."""
METRIC_RANGE = 3.5
"""Default largest range where metres are known, m."""

Place = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
"""A coordinate."""
Length = Annotated[float, Field(gt=0, ge=SMALLEST, le=LARGEST)]
"""A length above 0."""
MOST_RAYS = 4096
Turn = Annotated[float, Field(ge=-math.tau, le=math.tau)]
"""An angle from the heading, rad."""
Shade = Literal["dark", "light"]
FrameName = Literal["pixels", "metres"]
"""Units and frame of what a user gives and reads, and of what a robot observes."""


@dataclass(frozen=True, slots=True)
class ReadingOptions:
    """The user's settings for reading a picture; None to infer a setting.

    Attributes:
        polarity: Which pixels are obstacles.
        threshold: Luminance, 0..255, above which a pixel is light.
    """

    polarity: Shade | None = None
    threshold: float | None = None

    def __post_init__(self) -> None:
        if self.polarity not in (None, "dark", "light"):
            raise TaskError(
                f"unknown polarity {self.polarity!r}; expected 'dark' if dark "
                "pixels are the obstacles, or 'light'"
            )
        if self.threshold is not None and not 0 <= self.threshold < 255:
            raise TaskError(
                f"expected a threshold from 0 to below 255, got {self.threshold:g}"
            )


DEFAULT_OPTIONS = ReadingOptions()


_FAN = "n_rays", "field_of_view_deg"


class RobotParams(StrictModel):
    """The differential-drive robot: a disc with a fan of ultrasonic rays."""

    radius: Length = Field(15.0, description="Body radius, px.")
    axle_length: float = Field(
        30.0,
        gt=0,
        ge=SMALLEST,
        le=2 * LARGEST,
        description="Distance between the wheels, px; from `disc`, the diameter.",
    )
    max_wheel_speed: Length = Field(75.59, description="Wheel speed limit, px/s.")
    n_rays: int = Field(18, ge=1, le=MOST_RAYS, description="Number of range rays.")
    field_of_view_deg: float = Field(
        110.0, gt=0, le=360, description="Whole angle of the fan, degrees."
    )
    range_max: Length = Field(220.0, description="Reading without a hit, px.")
    ray_angles: tuple[Turn, ...] | None = Field(
        None,
        description="Directions of the rays from the heading, rad, in the order of the "
        "ranges; by default an even fan over the field of view.",
    )
    range_min: Length | None = Field(None, description="Smallest range, px.")
    below_min: Literal["range_max", "range_min", "zero"] | None = Field(
        None, description="What a ray reads below range_min; by default range_max."
    )
    scanner_offset: tuple[Place, Place] | None = Field(
        None,
        description="Where the rays start, from the centre, px: ahead and to the right "
        "(in metres to the left).",
    )
    max_speed: Length | None = Field(None, description="Limit of the body, px/s.")
    max_turn_rate: Length | None = Field(None, description="Its turn, rad/s.")
    max_acceleration: Length | None = Field(None, description="Of a wheel, px/s².")
    max_turn_acceleration: Length | None = Field(None, description="rad/s²")
    stopping_distance: Length | None = Field(
        None, description="From full speed to standstill, px."
    )

    @model_validator(mode="after")
    def _has_an_angle_for_each_ray(self) -> Self:
        own = self.ray_angles
        if own is not None and len(own) != self.n_rays:
            raise ValueError(
                f"expected n_rays = {self.n_rays} numbers in ray_angles, got {len(own)}"
                "; leave them out for an even fan"
            )
        return self

    @model_serializer(mode="wrap")
    def _without_defaults_of_later_versions(
        self, handler: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        """The fields; what is None is left out, so that hashes of sets stay."""
        return {key: own for key, own in handler(self).items() if own is not None}

    @property
    def has_even_fan(self) -> bool:
        """Whether rays go evenly from left to right, from the robot's centre."""
        own = self.ray_angles is not None or self.scanner_offset is not None
        return not own and self.field_of_view_deg < FULL_CIRCLE

    def angles(self) -> NDArray[np.float64]:
        """Directions of the rays from the heading, rad, in the order of the ranges.

        A positive angle is clockwise, as y points down.
        """
        if self.ray_angles is None:
            return fan(self.field_of_view_deg, self.n_rays)
        return np.array(self.ray_angles)

    def written(self) -> dict[str, Any]:
        """The robot as `params.json` describes it: with the angles of its rays."""
        return {**self.model_dump(mode="json"), "ray_angles": self.angles().tolist()}

    def changed(self, **changes: Any) -> RobotParams:
        """This robot with other values.

        Another number of rays or field of view stands for an even fan.

        Raises:
            ValidationError: A value is not valid.
        """
        own = self.model_dump()
        if any(changes.get(key, own[key]) != own[key] for key in _FAN):
            own.pop("ray_angles", None)
        return RobotParams.model_validate({**own, **changes})

    @classmethod
    def disc(cls, radius: float, resolution: float | None = None) -> RobotParams:
        """The default robot with another body radius and an axle of 2 x radius.

        Args:
            radius: Body radius, px.
            resolution: Metres per pixel, if known: speed and range then are
                `METRIC_SPEED` and `METRIC_RANGE`, and not those of the paper.

        Raises:
            TaskError: The radius is not positive, or too large.
        """
        radius = positive("robot_radius", radius)
        if resolution is None:
            return cls(radius=radius, axle_length=2 * radius)
        return cls(
            radius=radius,
            axle_length=2 * radius,
            max_wheel_speed=METRIC_SPEED / resolution,
            range_max=METRIC_RANGE / resolution,
        )


class ScoreTerms(StrictModel):
    """The terms of the score of Algorithm 1."""

    min_clearance: float = Field(description="Smallest clearance on the path, px.")
    path_length: float = Field(description="Length of the path, px.")
    sharpness: float = Field(description="Boundary sharpness of the grid.")


class MapParams(StrictModel):
    """Contents of `params.json`; points are (x, y) in pixels, headings in rad."""

    schema_version: Literal[1] = 1
    source: str = Field(description="File name of the map image.")
    source_sha256: str = Field(
        description="SHA-256 of the map image's bytes; for a grid, `grid.sha256()`."
    )
    width: int = Field(gt=0, description="px")
    height: int = Field(gt=0, description="px")
    start: tuple[Place, Place] | None = None
    heading: Place = 0.0
    goal: tuple[Place, Place] | None = None
    robot: RobotParams = RobotParams()
    polarity: Literal["dark", "light", "mixed", "given"] = Field(
        description="Which pixels are obstacles; `given` if the file defines it."
    )
    method: str = Field(description="How the image was binarised.")
    threshold: float | None = Field(None, description="Luminance, 0..255.")
    cleanup: int = Field(0, ge=0, description="Strength of the noise removal, px.")
    opening: int = Field(0, ge=0, description="Lines under this width are dropped, px.")
    inflation: float = Field(0, ge=0, le=LARGEST, description="Planner's margin, px.")
    score: float | None = None
    score_terms: ScoreTerms | None = None
    resolution: Length | None = Field(None, description="Metres per pixel.")
    origin: tuple[Place, Place, Place] = (0.0, 0.0, 0.0)
    notes: tuple[str, ...] = Field(
        (), description="Changes made, and what the file hides."
    )
    frame: FrameName = Field(
        "pixels",
        description="Units of the file's places and lengths, and of what a controller "
        "observes. Here, they are always pixels.",
    )

    @model_validator(mode="after")
    def _has_a_scale(self) -> Self:
        if self.frame == "metres" and self.resolution is None:
            raise ValueError("the frame `metres` needs a resolution")
        return self

    def written(self) -> dict[str, Any]:
        """The contents of the file: in metres of the map's frame, if `frame` says so.

        What tells how the map was made stays in px.
        """
        own = {**self.model_dump(mode="json"), "robot": self.robot.written()}
        if self.frame == "metres":
            own.update(_converted(own, MapUnits.metres(self), inwards=False))
        return own

    def save(self, path: Path) -> None:
        """Writes the file `path`."""
        path.write_text(json.dumps(self.written(), indent=2) + "\n")

    @classmethod
    def read(cls, written: Any) -> MapParams:
        """The parameters of a file's contents.

        Raises:
            ValidationError: A field is missing, wrong or unknown.
        """
        own = cls.model_validate(written)
        if own.frame == "metres":
            units = MapUnits.metres(own)
            changes = _converted(own.model_dump(), units, inwards=True)
            own = cls.model_validate({**own.model_dump(), **changes})
        return own.model_copy(update={"robot": _without_even_fan(own.robot)})

    @classmethod
    def load(cls, path: Path) -> MapParams:
        """Reads the file `path`.

        Raises:
            MapError: It is missing, not JSON, or has a wrong or unknown field.
        """
        try:
            return cls.read(parse_json(read_file(path, TEXT_BYTES)))
        except OSError as error:
            raise MapError(f"cannot read {path}: {error.strerror}") from error
        except ValidationError as error:
            raise MapError(f"{path}: {first_problem(error, cls)}") from error
        except ValueError as error:
            raise MapError(f"{path}: {error}") from error


_ROBOT_LENGTHS = (
    *("radius", "axle_length", "max_wheel_speed", "range_max"),
    *("range_min", "max_speed", "max_acceleration", "stopping_distance"),
)


def _converted(
    own: dict[str, Any], units: MapUnits, *, inwards: bool
) -> dict[str, Any]:
    """The places, headings and lengths of a file, to pixels (inwards) or metres."""
    length = units.length_in_pixels if inwards else units.written_length

    def place(point: Any) -> tuple[float, float]:
        return units.pixels(tuple(point)) if inwards else units.written_place(*point)

    places = {key: place(own[key]) for key in ("start", "goal") if own[key] is not None}
    return {
        **places,
        "heading": units.heading_in_pixels(own["heading"]),
        "inflation": length(own["inflation"]),
        "robot": converted_robot(own["robot"], units, inwards=inwards),
    }


def converted_robot(
    own: dict[str, Any], units: MapUnits, *, inwards: bool
) -> dict[str, Any]:
    """The values of a robot of a file, to pixels (inwards) or metres."""
    length = units.length_in_pixels if inwards else units.written_length
    robot = dict(own)
    robot.update({key: length(robot[key]) for key in _ROBOT_LENGTHS if key in robot})
    if "scanner_offset" in robot:
        ahead, aside = robot["scanner_offset"]
        # To the right in pixels, to the left in metres.
        robot["scanner_offset"] = [length(ahead), 0.0 - length(aside)]
    if "ray_angles" in robot:
        # y points up in the frame of a map; 0.0 - 0.0 is not -0.0.
        robot["ray_angles"] = [0.0 - angle for angle in robot["ray_angles"]]
    return robot


def _without_even_fan(robot: RobotParams) -> RobotParams:
    """The robot of a file; the angles of an even fan are no choice of their own."""
    even = fan(robot.field_of_view_deg, robot.n_rays).tolist()
    is_even = robot.ray_angles is not None and list(robot.ray_angles) == even
    return robot.model_copy(update={"ray_angles": None}) if is_even else robot
