"""Writes a grid as a map of ROS: `map.yaml` and `map.pgm`."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import yaml

from tdac_envs.core.errors import MapError
from tdac_envs.grid.grid import OccupancyGrid

ROS_FILES = "map.yaml", "map.pgm"
FREE, OCCUPIED = 254, 0
"""Pixels as the map server of ROS writes them."""


def write_ros_map(
    folder: Path,
    grid: OccupancyGrid,
    resolution: float,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[Path]:
    """Writes a grid so that the map server of ROS and `preprocess` read it back.

    Args:
        folder: An existing folder.
        grid: The grid.
        resolution: Metres per pixel.
        origin: Pose (x, y, yaw) of the lower-left pixel, m and rad.

    Returns:
        `map.yaml` and `map.pgm`.

    Raises:
        MapError: The folder cannot be written.
    """
    picture = np.where(grid.cells, OCCUPIED, FREE).astype(np.uint8)
    _, data = cv2.imencode(".pgm", picture)
    about = {
        "image": ROS_FILES[1],
        "mode": "trinary",
        "resolution": float(resolution),
        "origin": [float(value) for value in origin],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    files = [folder / name for name in ROS_FILES]
    try:
        files[1].write_bytes(data.tobytes())
        files[0].write_text(yaml.safe_dump(about, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise MapError(
            f"{folder}: cannot be written: {error.strerror}; choose another folder"
        ) from error
    return files
