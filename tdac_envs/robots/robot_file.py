"""Schema of a robot file: body, limits, scanner and localiser of a robot."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from tdac_envs.core.arguments import LARGEST, SMALLEST
from tdac_envs.core.strict_model import StrictModel

_Size = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
_Amount = Annotated[float, Field(ge=0, le=LARGEST)]
_Share = Annotated[float, Field(ge=0, le=1)]
MOST_RAYS = 4096


class Limits(StrictModel):
    """How fast the robot may drive, in its units."""

    max_wheel_speed: _Size = Field(description="Rim speed of a wheel, units/s.")
    max_speed: _Size | None = Field(None, description="Of the body, units/s.")
    max_turn_rate: _Size | None = Field(None, description="Of the body, rad/s.")
    max_acceleration: _Size | None = Field(None, description="Of the body, units/s².")
    max_turn_acceleration: _Size | None = Field(None, description="rad/s²")


class Scanner(StrictModel):
    """The range sensor; `ranges` are in its own order."""

    rays: int = Field(ge=1, le=MOST_RAYS, description="Number of rays.")
    field_of_view: float = Field(360.0, gt=0, le=360, description="Degrees.")
    first_angle: float = Field(
        description="Of the first ray from the heading, degrees, left is positive.",
        ge=-360,
        le=360,
    )
    direction: Literal["counter-clockwise", "clockwise"] = Field(
        description="In which the rays follow each other, seen from above."
    )
    range_min: _Amount = Field(0.0, description="Smallest range.")
    range_max: _Size = Field(description="Largest range.")
    below_min: Literal["range_max", "range_min", "zero"] = Field(
        "range_max", description="What a ray reads below range_min."
    )
    offset: tuple[float, float] = Field(
        (0.0, 0.0), description="From the centre: ahead, to the left."
    )
    rate: _Size | None = Field(None, description="Scans per second.")
    noise: _Share = Field(0.0, description="Relative standard deviation of a range.")

    @property
    def angles(self) -> tuple[float, ...]:
        """Angles of the rays from the heading, rad, counter-clockwise, in order."""
        gaps = self.rays if self.field_of_view == 360.0 else max(self.rays - 1, 1)
        step = math.radians(self.field_of_view) / gaps
        turn = step if self.direction == "counter-clockwise" else -step
        first = math.radians(self.first_angle)
        return tuple(
            math.remainder(first + turn * i, math.tau) for i in range(self.rays)
        )

    @property
    def is_default_fan(self) -> bool:
        """Whether the rays are an even fan from the robot's left to its right."""
        left = self.first_angle == self.field_of_view / 2
        return left and self.direction == "clockwise"


class Pose(StrictModel):
    """What tells the robot where it is."""

    source: str = Field(description="Such as `AMCL` or `motion capture`.")
    noise: _Amount = Field(0.0, description="Standard deviation of x and of y.")
    heading_noise: float = Field(
        0.0, ge=0, le=math.pi, description="Standard deviation of the heading, rad."
    )
    correlation: _Amount = Field(0.0, description="Time constant of the errors, s.")
    jumps: _Amount = Field(0.0, description="Re-localisations per minute.")
    rate: _Size | None = Field(None, description="Poses per second.")
    latency: _Amount = Field(0.0, description="Age of a pose when it arrives, s.")


class Wheels(StrictModel):
    """Errors of the drive."""

    radius_error: float = Field(0.0, ge=0, le=0.9, description="Bound, relative.")
    slip: _Share = Field(0.0, description="Relative standard deviation in a step.")


class Body(StrictModel):
    """What a physics engine needs beyond the disc: metres, kg, N·m; see `BodySpec`."""

    mass: _Size | None = Field(None, description="With its wheels, kg.")
    height: _Size | None = Field(None, description="Of the body's top, m.")
    centre: _Size | None = Field(None, description="Height of its mass, m.")
    wheel_radius: _Size | None = Field(None, description="m")
    wheel_mass: _Size | None = Field(None, description="Of one wheel, kg.")
    torque: _Size | None = Field(None, description="Largest one of a motor, N·m.")
    grip: _Amount | None = Field(None, description="Friction of the tyres.")
    friction: _Amount | None = Field(None, description="Of the body on obstacles.")


def body_in(body: Body | None) -> dict[str, float]:
    """The values of a `BodySpec` that the `body` of a robot file has."""
    known = {} if body is None else body.model_dump(exclude_none=True)
    return {"top" if key == "height" else key: own for key, own in known.items()}


def body_written(body: Body | None) -> dict[str, Any]:
    """The key `body` of a robot in a task file; empty without one."""
    own = {} if body is None else body.model_dump(exclude_none=True)
    return {"body": own} if own else {}


class RobotFile(StrictModel):
    """Contents of a robot file, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    name: str = Field(min_length=1, max_length=60, pattern=r"^[A-Za-z0-9][\w.-]*$")
    description: str = Field("", max_length=400)
    drives: Literal["disc", "e-puck"] = Field(
        "disc", description="`disc` on maps, `e-puck` in Webots worlds."
    )
    version: Literal["1", "2"] | None = Field(
        None, description="Of an e-puck, which gives its mass; 1 by default."
    )
    units: Literal["metres", "pixels"] = Field("metres", description="Of all lengths.")
    radius: _Size = Field(description="Of the disc around the body.")
    axle_length: _Size = Field(
        description="Effective distance between the wheels: the one that turns obey."
    )
    limits: Limits
    scanner: Scanner | None = Field(None, description="None on an e-puck.")
    pose: Pose
    wheels: Wheels = Wheels()
    body: Body | None = Field(None, description="For `physics`; None for the usual.")
    control_rate: _Size = Field(description="Commands per second.")
    stopping_distance: _Amount = Field(
        description="From full speed, from the command to stop until it stands."
    )
    sources: dict[str, str] = Field(
        description="Where each figure comes from: a data sheet, a URL, or `assumed`."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.scanner is None) != (self.drives == "e-puck"):
            raise ValueError("a robot on maps (`drives: disc`) needs a `scanner`")
        if self.version is not None and self.drives != "e-puck":
            raise ValueError("version: only an e-puck has one (`drives: e-puck`)")
        if (
            self.scanner is not None
            and self.scanner.range_min >= self.scanner.range_max
        ):
            raise ValueError("scanner: expected range_min below range_max")
        missing = [key for key in self.figures() if key not in self.sources]
        if missing:
            raise ValueError(f"sources: no source of {', '.join(missing)}")
        unknown = self.sources.keys() - self.figures()
        if unknown:
            raise ValueError(f"sources: not in the file: {', '.join(sorted(unknown))}")
        return self

    @property
    def unit(self) -> str:
        """Short unit of lengths."""
        return "m" if self.units == "metres" else "px"

    def figures(self) -> dict[str, Any]:
        """All figures of the file by key, such as `limits.max_speed`."""
        written = self.model_dump(
            exclude_unset=True, exclude={"sources", "description"}
        )
        about = {"schema_version", "name", "drives", "units", "version"}
        found: dict[str, Any] = {}
        for key, value in written.items():
            if key in about:
                continue
            parts = value if isinstance(value, dict) else {"": value}
            found |= {f"{key}.{part}".rstrip("."): own for part, own in parts.items()}
        return found

    def options(self) -> dict[str, Any]:
        """The robot as arguments of `Map2DEnv` in its units; angles counter-clockwise.

        None for what the file does not say. No wheel accelerates faster than the body
        may.
        """
        own, scanner = self.limits, self.scanner
        assert scanner is not None
        return {
            "robot_radius": self.radius,
            "axle_length": self.axle_length,
            "max_wheel_speed": own.max_wheel_speed,
            "max_speed": own.max_speed,
            "max_turn_rate": own.max_turn_rate,
            "max_acceleration": own.max_acceleration,
            "max_turn_acceleration": own.max_turn_acceleration,
            **_rays(scanner),
            "range_max": scanner.range_max,
            "range_min": scanner.range_min or None,
            "below_min": scanner.below_min if scanner.range_min else None,
            "scanner_offset": scanner.offset if any(scanner.offset) else None,
            "stopping_distance": self.stopping_distance or None,
            "dt": 1.0 / self.control_rate,
        }

    def disturbances(self) -> dict[str, Any]:
        """What disturbs the robot, as arguments of `Map2DEnv` in its units; not 0.

        A pose is late by its latency and, on average, by half the time between two of
        them; a scan by half the time between two scans.
        """
        pose, scanner, wheels = self.pose, self.scanner, self.wheels
        own = {
            "range_noise": 0.0 if scanner is None else scanner.noise,
            "wheel_slip": wheels.slip,
            "wheel_radius_error": wheels.radius_error,
            "pose_noise": pose.noise,
            "heading_noise": pose.heading_noise,
            "pose_correlation": pose.correlation,
            "pose_jumps": pose.jumps,
            "pose_delay": self._steps_late(pose.rate, pose.latency),
            "scan_delay": self._steps_late(scanner.rate if scanner else None, 0.0),
        }
        return {name: value for name, value in own.items() if value}

    def _steps_late(self, rate: float | None, latency: float) -> int:
        slow = rate is not None and rate < self.control_rate
        waiting = 0.5 / rate if slow and rate else 0.0
        return round((latency + waiting) * self.control_rate)


def _rays(scanner: Scanner) -> dict[str, Any]:
    """The arguments for the rays: an even fan as such, other ones by their angles."""
    if scanner.is_default_fan and scanner.field_of_view < 360.0:
        return {"n_rays": scanner.rays, "field_of_view": scanner.field_of_view}
    return {"ray_angles": scanner.angles}
