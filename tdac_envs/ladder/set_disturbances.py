"""The section `disturbances` of a `set.yaml`."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from tdac_envs.core.arguments import LARGEST
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.drive.disturbances import MOST_HIDDEN
from tdac_envs.map2d.reception import Reception

Share = Annotated[float, Field(ge=0, le=1)]
_Size = Annotated[float, Field(ge=0, le=LARGEST)]

RECEPTION = (
    *("pose_noise", "heading_noise", "pose_correlation", "pose_jumps"),
    *("pose_delay", "scan_delay", "message_drop"),
)
"""Those that concern how pose and scan reach the robot."""
LENGTHS = "pose_noise", "range_min", "max_acceleration"
"""Those that are lengths, or lengths per second squared."""
ONLY_ON_MAPS = (
    *("range_noise", "range_dropout", "range_min", "wheel_radius_error"),
    *("max_acceleration", *RECEPTION),
)
"""Those that an e-puck of a set does not have here."""
WRITTEN_IF_USED = "range_min", "wheel_radius_error", "max_acceleration", *RECEPTION
"""Those that a file without them, its hash and `params.json` do not mention."""


class DisturbanceSpec(StrictModel):
    """The disturbances of the set; `docs/disturbances.md` defines them."""

    wheel_gains: float = Field(0.0, ge=0, le=MOST_HIDDEN, description="Bound.")
    wheel_slip: Share = Field(
        0.0, description="Relative SD for a step of 0.1 s; SD · √(0.1 s / dt) for dt."
    )
    axle_error: float = Field(0.0, ge=0, le=MOST_HIDDEN, description="Bound.")
    range_noise: Share = Field(0.0, description="Relative SD.")
    range_dropout: Share = Field(0.0, description="Probability of each ray.")
    odometry_scale: Share = Field(0.0, description="SD of both scale errors.")
    odometry_noise: Share = Field(0.0, description="Relative SD.")
    motor_lag: float = Field(0.0, ge=0, le=60, description="Time constant, s.")
    delay: int = Field(0, ge=0, le=100, description="Steps until an action acts.")
    wheel_radius_error: float = Field(0.0, ge=0, le=MOST_HIDDEN, description="Bound.")
    max_acceleration: _Size = Field(0.0, description="Of a wheel, px/s².")
    range_min: _Size = Field(0.0, description="Ranges below read range_max, px.")
    pose_noise: _Size = Field(0.0, description="SD of x and of y, px.")
    heading_noise: float = Field(0.0, ge=0, le=3.1, description="SD, rad.")
    pose_correlation: float = Field(
        0.0, ge=0, le=3600, description="Time constant of both errors, s."
    )
    pose_jumps: float = Field(0.0, ge=0, le=6000, description="Per minute.")
    pose_delay: int = Field(0, ge=0, le=100, description="Steps the pose is late.")
    scan_delay: int = Field(0, ge=0, le=100, description="Steps the ranges are late.")
    message_drop: Share = Field(
        0.0, description="Probability that the pose and scan of a step are lost."
    )

    @property
    def reception(self) -> Reception:
        """How pose and scan reach the robot.

        Raises:
            TaskError: A value has no effect without another one.
        """
        return Reception(**{name: getattr(self, name) for name in RECEPTION})

    def written(self) -> dict[str, Any]:
        """All values, but of those in `WRITTEN_IF_USED` only what is not 0."""
        values = self.model_dump()
        unused = {name for name in WRITTEN_IF_USED if not values[name]}
        return {name: value for name, value in values.items() if name not in unused}
