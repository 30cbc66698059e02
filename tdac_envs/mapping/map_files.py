"""Map files that define their obstacles: ROS `map.yaml`, MovingAI `.map`, `.npy`."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tdac_envs.core.errors import MapError, first_problem
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, printable, read_array
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.image import (
    ColourImage,
    MapImage,
    check_size,
    decode,
    from_array,
    read_bytes,
)
from tdac_envs.mapping.params import Length, Place


class RosMap(BaseModel):
    """Contents of a ROS `map.yaml` (wiki.ros.org/map_server)."""

    # Tools add other fields (e.g. `lethal_cost`), which do not matter for the grid.
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)

    image: str = Field(description="Picture, relative to the yaml file.")
    resolution: Length = Field(description="Metres per pixel.")
    origin: tuple[Place, Place, Place] = Field(
        (0.0, 0.0, 0.0), description="Pose of the lower-left pixel, m and rad."
    )
    negate: bool = Field(False, description="Whether light pixels are the obstacles.")
    occupied_thresh: float = Field(0.65, ge=0, le=1)
    free_thresh: float = Field(0.196, ge=0, le=1)
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def read_ros_yaml(path: Path) -> MapImage:
    """Reads a ROS map; pixels that are not known to be free are occupied.

    Raises:
        MapError: The yaml or its picture cannot be used.
    """
    text = read_bytes(path, TEXT_BYTES)
    ros = _parse_ros(text, path)
    picture = path.parent / ros.image
    data = read_bytes(picture)
    colour = decode(data, picture.name)
    free, unknown = _free_and_unknown(colour, ros)
    return MapImage(
        colour,
        printable(path.name),
        hashlib.sha256(text + data).hexdigest(),
        ~free,
        f"ros {ros.mode}",
        ros.resolution,
        ros.origin,
        unknown,
    )


def _parse_ros(text: bytes, path: Path) -> RosMap:
    try:
        fields = parse_yaml(text)
    except ValueError as error:
        raise MapError(f"{path}: {error}") from None
    if not isinstance(fields, dict) or "image" not in fields:
        raise MapError(f"{path}: not a ROS map: expected a field `image`")
    try:
        return RosMap.model_validate(fields)
    except ValidationError as error:
        raise MapError(f"{path}: {first_problem(error)}") from None


def _free_and_unknown(colour: ColourImage, ros: RosMap) -> tuple[BoolGrid, BoolGrid]:
    """Free pixels and unknown ones, by the map server's rules.

    Pixels with an occupancy below `free_thresh` are free, above `occupied_thresh`
    occupied, and unknown in between.
    """
    shade = colour.mean(axis=2)
    if ros.negate:
        shade = 255.0 - shade
    if ros.mode == "raw":
        # Values are occupancy in percent; above 100 means unknown.
        occupancy = shade / 100.0
        return occupancy < ros.free_thresh, occupancy > 1.0
    occupancy = (255.0 - shade) / 255.0
    free = occupancy < ros.free_thresh
    return free, ~free & (occupancy <= ros.occupied_thresh)


def read_grid(path: Path) -> MapImage:
    """Reads a `.npy` file with a bool array `[y, x]`, True = occupied.

    Raises:
        MapError: It is not such a file, or too large.
    """
    try:
        cells = read_array(read_bytes(path))
    except ValueError as error:
        raise MapError(f"cannot read the grid {path}: {error}") from error
    if cells.ndim != 2:
        raise MapError(f"{path}: expected a 2-D grid of cells, got shape {cells.shape}")
    check_size(path.name, cells.shape[1], cells.shape[0])
    if cells.dtype != np.bool_:
        raise MapError(f"{path}: expected a bool array, got {cells.dtype}")
    return replace(from_array(cells), name=printable(path.name))


def read_movingai(path: Path) -> MapImage:
    """Reads a MovingAI grid: `.`, `G` and `S` are free, the rest is occupied.

    Raises:
        MapError: The header or the rows violate the format
            (movingai.com/benchmarks/formats.html).
    """
    data = read_bytes(path)
    lines = data.splitlines()
    size = {}
    for line in lines[1:3]:
        key, _, value = line.strip().partition(b" ")
        number = value.strip()
        size[key] = int(number) if number.isdigit() and len(number) < 10 else 0
    width, height = size.get(b"width", 0), size.get(b"height", 0)
    header = lines[:1] and lines[0].startswith(b"type") and lines[3:4]
    if not header or lines[3].strip() != b"map" or 0 in (width, height):
        raise MapError(
            f"{path}: not a MovingAI map: expected the lines `type octile`, "
            "`height H`, `width W` and `map`"
        )
    check_size(path.name, width, height)
    rows = lines[4 : 4 + height]
    if len(rows) < height or any(len(row) != width for row in rows):
        raise MapError(f"{path}: expected {height} rows of {width} cells")
    cells = np.frombuffer(b"".join(rows), np.uint8).reshape(height, width)
    occupied = ~np.isin(cells, np.frombuffer(b".GS", np.uint8))
    shade = np.where(occupied, 0, 255).astype(np.uint8)
    digest = hashlib.sha256(data).hexdigest()
    colour = np.repeat(shade[..., None], 3, axis=2)
    return MapImage(colour, printable(path.name), digest, occupied, "movingai")
