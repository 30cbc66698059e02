"""Reads the static worlds of the BARN challenge: fields of upright cylinders.

Source: Perille et al., Benchmarking Metric Ground Navigation (2020); the challenge's
score takes OT = path_length / 2 m/s.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.core.strict_model import LenientModel
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.ladder.files.file_world import FileWorld

BARN_SPEED = 2.0
"""Top speed that the challenge's score refers to, m/s."""
MARGIN = 1.0
"""Free ground around start and goal, m, beyond which the map ends."""
MOST_SIDE = 8192
"""Largest width or height of a map, px."""


class BarnWorld(LenientModel):
    """A world: the centres of its cylinders, and the length of its planned path, m."""

    cylinders: list[tuple[float, float]]
    path_length: float = Field(gt=0)


class BarnFile(LenientModel):
    """A file of worlds, by name; lengths in m, y is up."""

    cylinder_radius: float = Field(gt=0, le=10)
    start: tuple[float, float, float] = Field(description="x, y, heading (rad)")
    goal: tuple[float, float]
    worlds: dict[str, BarnWorld] = Field(min_length=1, max_length=10_000)


def read_barn(path: Path, resolution: float) -> list[FileWorld]:
    """The worlds of a file, in its order.

    A pixel is occupied if its centre is in a cylinder. The map ends with the cylinders,
    and 1 m from start and goal.

    Args:
        path: The file.
        resolution: Metres per px.

    Raises:
        TaskError: The file is missing or not valid.
    """
    try:
        file = BarnFile.model_validate(parse_json(read_file(path, RECORD_BYTES)))
        return [_world(path, file, name, resolution) for name in file.worlds]
    except (OSError, ValueError) as error:
        raise TaskError(f"{path}: {one_line_reason(error)}") from None


def _world(path: Path, file: BarnFile, name: str, resolution: float) -> FileWorld:
    world, heading = file.worlds[name], file.start[2]
    centres = np.array(world.cylinders, np.float64).reshape(-1, 2)
    ends = np.array([file.start[:2], file.goal])
    reach = [centres - file.cylinder_radius, centres + file.cylinder_radius]
    around = np.vstack([*reach, ends - MARGIN, ends + MARGIN])
    (left, bottom), (right, top) = around.min(axis=0), around.max(axis=0)
    # Rounded, since the sums of decimal fractions are not exact.
    width, height = (
        math.ceil(round(side / resolution, 6)) for side in (right - left, top - bottom)
    )
    if max(width, height) > MOST_SIDE:
        raise ValueError(
            f"world {name}: a map of {width} x {height} px, more than {MOST_SIDE}; "
            "use a coarser `resolution`"
        )
    pixels = _pixels(np.vstack([ends, centres]), (left, top), resolution)
    cells = _drawn(pixels[2:], file.cylinder_radius / resolution, (height, width))
    start, goal = ((round(x), round(y)) for x, y in pixels[:2].tolist())
    return FileWorld(
        name=name,
        file=f"{path}, world {name}",
        kind="barn",
        origin=None,
        shape=(height, width),
        packed=np.packbits(cells).tobytes(),
        start=start,
        heading=-math.remainder(heading, math.tau),
        goal=goal,
        barn_seconds=world.path_length / BARN_SPEED,
    )


def _pixels(
    points: NDArray[np.float64], corner: tuple[float, float], resolution: float
) -> NDArray[np.float64]:
    """Points (x, y) in m, y up, as pixels, y down; multiples of 2**-16."""
    left, top = corner
    x, y = (points[:, 0] - left) / resolution, (top - points[:, 1]) / resolution
    return np.round((np.column_stack([x, y]) - 0.5) * 65536) / 65536


def _drawn(
    centres: NDArray[np.float64], radius: float, shape: tuple[int, int]
) -> BoolGrid:
    """A map with a disc around each centre, px."""
    cells = np.zeros(shape, np.bool_)
    for x, y in centres.tolist():
        left, top = max(math.floor(x - radius), 0), max(math.floor(y - radius), 0)
        right, low = math.ceil(x + radius) + 1, math.ceil(y + radius) + 1
        rows, columns = np.ogrid[top:low, left:right]
        disc = np.square(columns - x) + np.square(rows - y) <= radius * radius
        part = cells[top:low, left:right]
        part |= disc[: part.shape[0], : part.shape[1]]
    return cells
