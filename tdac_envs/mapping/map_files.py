"""Map files that define their obstacles: ROS `map.yaml`, MovingAI `.map`, `.npy`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from tdac_envs.core.errors import MapError, first_problem
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, printable, read_array
from tdac_envs.mapping.image import (
    MapImage,
    check_size,
    composite,
    decode_stored,
    from_array,
    luminance,
    read_bytes,
    read_picture,
)
from tdac_envs.mapping.ros_rule import RosMapFile, ros_cells, ros_notes


def load_image(path: str | Path, resolution: float | None = None) -> MapImage:
    """Reads a picture, a ROS `map.yaml`, a MovingAI `.map` or a `.npy` grid.

    Args:
        path: The file.
        resolution: Metres per pixel, if the file gives none.

    Raises:
        MapError: The file is missing, unreadable, too large or of a single colour, or
            it gives another resolution.
    """
    image = _read(Path(path))
    if resolution is None or resolution == image.resolution:
        return image
    if not 0.0 < resolution < math.inf:
        raise MapError(f"resolution: expected metres per pixel, got {resolution:g}")
    if image.resolution is not None:
        raise MapError(
            f"{image.name} gives {image.resolution:g} m per px: leave out the "
            f"resolution {resolution:g}"
        )
    return replace(image, resolution=resolution)


def _read(path: Path) -> MapImage:
    suffix = path.suffix.lower()
    if suffix in {".yaml", ".yml"}:
        return read_ros_yaml(path)
    if suffix == ".map":
        return read_movingai(path)
    if suffix == ".npy":
        return read_grid(path)
    return read_picture(path)


def read_ros_yaml(path: Path) -> MapImage:
    """Reads a ROS map; pixels that are not known to be free are occupied.

    Raises:
        MapError: The yaml or its picture cannot be used, or no pixel is free.
    """
    text = read_bytes(path, TEXT_BYTES)
    ros = _parse_ros(text, path)
    picture = path.parent / ros.image
    data = read_bytes(picture)
    pixels = decode_stored(data, picture.name)
    grey, alpha = luminance(pixels[..., :3]), pixels[..., 3]
    cells = ros_cells(grey, alpha, ros)
    if not cells.free.any():
        raise MapError(
            f"{path}: no pixel counts as free by free_thresh {ros.free_thresh:g}, mode "
            f"{ros.mode} and negate {ros.negate:d}; correct these fields or the picture"
        )
    return MapImage(
        composite(pixels) if (alpha < 255).any() else pixels[..., :3],
        printable(path.name),
        sha256_of(text, data),
        ~cells.free,
        f"ros {ros.mode}",
        ros.resolution,
        ros.origin,
        cells.unknown,
        ros_notes(grey, cells.free, ros),
    )


def _parse_ros(text: bytes, path: Path) -> RosMapFile:
    try:
        fields = parse_yaml(text)
    except ValueError as error:
        raise MapError(f"{path}: {error}") from None
    if not isinstance(fields, dict) or "image" not in fields:
        raise MapError(f"{path}: not a ROS map: expected a field `image`")
    try:
        return RosMapFile.model_validate(fields)
    except ValidationError as error:
        raise MapError(f"{path}: {first_problem(error, RosMapFile)}") from None


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
    if cells.dtype.kind in "iu" and np.isin(cells, (0, 1)).all():
        cells = cells == 1
    if cells.dtype != np.bool_:
        raise MapError(
            f"{path}: expected bool cells (True = occupied) or integers 0 and 1, got "
            f"{cells.dtype}"
        )
    return replace(from_array(cells), name=printable(path.name))


def read_movingai(path: Path) -> MapImage:
    """Reads a MovingAI grid: `.`, `G` and `S` are free, the rest is occupied.

    Raises:
        MapError: The header or the rows violate the format
            (movingai.com/benchmarks/formats.html).
    """
    data = read_bytes(path)
    width, height, rows = _movingai_rows(data, path)
    if len(rows) < height or any(len(row) != width for row in rows):
        raise MapError(f"{path}: expected {height} rows of {width} cells")
    cells = np.frombuffer(b"".join(rows), np.uint8).reshape(height, width)
    occupied = ~np.isin(cells, np.frombuffer(b".GS", np.uint8))
    shade = np.where(occupied, 0, 255).astype(np.uint8)
    digest = sha256_of(data)
    colour = np.repeat(shade[..., None], 3, axis=2)
    return MapImage(colour, printable(path.name), digest, occupied, "movingai")


def _movingai_rows(data: bytes, path: Path) -> tuple[int, int, list[bytes]]:
    """Width, height and rows of a MovingAI file.

    Blank lines, spaces, tabs and capitals in the header do not matter.
    """
    lines = [line.rstrip() for line in data.splitlines() if line.strip()]
    names = [line.strip().lower() for line in lines]
    end = names.index(b"map") if b"map" in names else 0
    words = [line.split() for line in names[:end]]
    header = {each[0]: each[-1] for each in words}
    width, height = (_size(header.get(key, b"")) for key in (b"width", b"height"))
    if not names or not names[0].startswith(b"type") or 0 in (width, height):
        raise MapError(
            f"{path}: not a MovingAI map: expected the lines `type octile`, "
            "`height H`, `width W` and `map`"
        )
    check_size(path.name, width, height)
    return width, height, lines[end + 1 : end + 1 + height]


def _size(text: bytes) -> int:
    """The number of rows or columns; 0 if it is none."""
    return int(text) if text.isdigit() and len(text) < 10 else 0
