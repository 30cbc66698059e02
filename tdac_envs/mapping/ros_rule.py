"""The rule by which ROS `map.yaml` files define free and unknown pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from tdac_envs.core.strict_model import LenientModel
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.image import GreyImage
from tdac_envs.mapping.params import Length, Place

SAVED_UNKNOWN = 205
"""The grey that ROS `map_saver` writes for unknown pixels."""
_RAW_OCCUPIED = 100


def _lowered(value: Any) -> Any:
    return value.lower() if isinstance(value, str) else value


class RosMapFile(LenientModel):
    """Contents of a ROS `map.yaml` (wiki.ros.org/map_server).

    Tools add other fields (e.g. `lethal_cost`), which do not matter for the grid.
    """

    image: str = Field(description="Picture, relative to the yaml file.")
    resolution: Length = Field(description="Metres per pixel.")
    origin: tuple[Place, Place, Place] = Field(
        (0.0, 0.0, 0.0), description="Pose of the lower-left pixel, m and rad."
    )
    negate: bool = Field(False, description="Whether light pixels are the obstacles.")
    occupied_thresh: float = Field(0.65, ge=0, le=1)
    free_thresh: float = Field(0.196, ge=0, le=1)
    mode: Annotated[Literal["trinary", "scale", "raw"], BeforeValidator(_lowered)] = (
        "trinary"
    )


@dataclass(frozen=True, slots=True, eq=False)
class RosCells:
    """Which pixels of a map are free, and which are unknown; the rest is occupied.

    Attributes:
        free: Shape (height, width), bool.
        unknown: Shape (height, width), bool.
    """

    free: BoolGrid
    unknown: BoolGrid


def ros_cells(grey: GreyImage, alpha: GreyImage, ros: RosMapFile) -> RosCells:
    """The cells of a picture, by the rule of nav2's map server (`map_io.cpp`).

    An occupancy of `free_thresh` or less is free, of `occupied_thresh` or more
    occupied. In between, it is unknown (`trinary`) or partly occupied (`scale`). In
    these modes, a pixel that is not fully opaque is unknown. The values of `raw` are
    occupancies in percent: `negate` and alpha do not matter, above 100 is unknown.

    Args:
        grey: Shape (height, width), uint8, the luminance without regard to alpha.
        alpha: Shape (height, width), uint8, 255 = opaque.
        ros: The fields of the yaml file.
    """
    if ros.mode == "raw":
        unknown = grey > _RAW_OCCUPIED
        occupancy = grey.astype(np.float32) / np.float32(_RAW_OCCUPIED)
        return RosCells(~unknown & (occupancy <= np.float32(ros.free_thresh)), unknown)
    # Single precision, as in nav2: it decides at thresholds such as 0.2 = 51 / 255.
    occupancy = grey.astype(np.float32) / np.float32(255)
    if not ros.negate:
        occupancy = np.float32(1) - occupancy
    hidden = alpha < 255
    free = (occupancy <= np.float32(ros.free_thresh)) & ~hidden
    if ros.mode == "scale":
        return RosCells(free, hidden)
    occupied = (occupancy >= np.float32(ros.occupied_thresh)) & ~hidden
    return RosCells(free, ~free & ~occupied)


def ros_notes(grey: GreyImage, free: BoolGrid, ros: RosMapFile) -> tuple[str, ...]:
    """A note if the map saver's grey for unknown pixels counts as free; else none."""
    share = float((free & (grey == SAVED_UNKNOWN)).mean())
    if ros.mode == "raw" or share == 0:
        return ()
    percent = f"{share:.0%}" if share >= 0.01 else "under 1%"
    return (
        f"grey {SAVED_UNKNOWN}, which map savers write for unknown, counts as free by "
        f"free_thresh {ros.free_thresh:g} ({percent} of the pixels); a free_thresh of "
        "0.196 makes it unknown",
    )
