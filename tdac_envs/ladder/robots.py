"""The e-puck as the robot of a task set; that of maps is `RobotParams`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from tdac_envs.core.strict_model import StrictModel
from tdac_envs.drive.disturbances import MOST_HIDDEN
from tdac_envs.epuck.infrared import RANGE
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.world import AXLE_LENGTH


class EPuckRobotParams(StrictModel):
    """An e-puck: `robot: {kind: epuck}` in a `set.yaml`."""

    kind: Literal["epuck"]
    max_wheel_speed: float = Field(
        6.28, gt=0, le=7.536, description="Wheel speed limit, rad/s."
    )
    sensor_noise: float = Field(
        0.0, ge=0, le=10, description="Infra-red noise relative to the published noise."
    )
    wheel_radius_error: float = Field(
        0.0,
        ge=0,
        le=MOST_HIDDEN,
        description="Bound of each wheel's hidden relative error of its radius.",
    )

    @property
    def radius(self) -> float:
        """Radius of the body, m."""
        return BODY_RADIUS

    @property
    def sizes(self) -> dict[str, float]:
        """The robot without its errors, m and rad/s."""
        return {
            "radius": BODY_RADIUS,
            "axle_length": AXLE_LENGTH,
            "wheel_radius": WHEEL_RADIUS,
            "max_wheel_speed": self.max_wheel_speed,
            "sensor_range": RANGE,
        }

    @property
    def errors(self) -> dict[str, float]:
        """Its disturbances, by name."""
        return {
            "sensor_noise": self.sensor_noise,
            "wheel_radius_error": self.wheel_radius_error,
        }
