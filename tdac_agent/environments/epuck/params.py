"""`params.json` of an e-puck's task."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from tdac_envs.core.strict_model import StrictModel
from tdac_envs.epuck.infrared import PLACES, RANGE
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.world import AXLE_LENGTH

_AZIMUTHS: tuple[float, ...] = tuple(PLACES[:, 2].tolist())


class EPuckRobot(StrictModel):
    """Dimensions and limits of the e-puck."""

    radius: float = Field(BODY_RADIUS, description="Radius of the body, m.")
    wheel_radius: float = Field(WHEEL_RADIUS, description="m")
    axle_length: float = Field(
        AXLE_LENGTH, description="Effective distance between the wheels, m."
    )
    max_wheel_speed: float = Field(description="rad/s")
    sensor_range: float = Field(RANGE, description="Range of ps0 to ps7, m.")
    sensor_azimuths: tuple[float, ...] = Field(
        _AZIMUTHS, description="ps0 to ps7 relative to the heading, rad, left positive."
    )


class WorldParams(StrictModel):
    """Contents of `params.json`; metres, headings counter-clockwise from +x, rad."""

    schema_version: Literal[1] = 1
    source: str = Field(description="File name of the world.")
    source_sha256: str = Field(description="Hash of the flat world file.")
    start: tuple[float, float]
    heading: float
    goal: tuple[float, float]
    goal_tolerance: float
    dt: float = Field(description="Duration of a step, s.")
    horizon: int = Field(description="Steps.")
    robot: EPuckRobot
    notes: tuple[str, ...] = Field((), description="Assumptions of the world reader.")

    @classmethod
    def read(cls, written: Any) -> WorldParams:
        """The parameters of a file's contents.

        Raises:
            ValidationError: A field is missing, wrong or unknown.
        """
        return cls.model_validate(written)


def params_of(
    task: EPuckTask, source: str, digest: str, notes: tuple[str, ...]
) -> WorldParams:
    """Returns the contents of the file for a task.

    Args:
        task: Task in the flat world.
        source: File name of the world.
        digest: Hash of the flat world file.
        notes: Assumptions of the world reader.
    """
    return WorldParams(
        source=source,
        source_sha256=digest,
        start=task.start[:2],
        heading=task.start.heading,
        goal=task.goal,
        goal_tolerance=task.goal_tolerance,
        dt=task.dt,
        horizon=task.horizon,
        robot=EPuckRobot(
            axle_length=task.axle_length, max_wheel_speed=task.max_wheel_speed
        ),
        notes=notes,
    )
