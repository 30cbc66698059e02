"""Writes the files of a preprocessed map: grid, picture, parameters, preview."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import MapError, PolarityError
from tdac_envs.grid.grid import OccupancyGrid, body_free, clearance
from tdac_envs.grid.plan import plan_path
from tdac_envs.mapping.params import MapParams

if TYPE_CHECKING:
    from tdac_envs.drawing.canvas import Image
    from tdac_envs.mapping.image import ColourImage
    from tdac_envs.mapping.preprocessing import Source

FILES = ("occupancy.npy", "occupancy.png", "params.json", "preview.png")


def write_map(
    folder: str | Path, grid: OccupancyGrid, params: MapParams, image: Source
) -> list[Path]:
    """Writes the four files of a preprocessed map; all of them or none.

    `occupancy.npy` is bool `[y, x]`, True = occupied; `occupancy.png` is 8-bit grey,
    obstacles black on white; `params.json` contains `params`; `preview.png` shows
    the result.

    Args:
        folder: Target folder, created if missing.
        grid: From `preprocess`.
        params: From `preprocess`.
        image: The source that was given to `preprocess`.

    Returns:
        The files, in the order above.

    Raises:
        MapError: The folder cannot be written.
    """
    # Imported late: a task that writes only a grid needs no image code.
    from tdac_envs.mapping.preprocessing import as_image

    folder = Path(folder)
    preview = preview_of(as_image(image).colour, grid, params)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".map-", dir=folder) as work:
            write_grid(Path(work), grid, params)
            (Path(work) / "preview.png").write_bytes(png(preview))
            for name in FILES:
                os.replace(Path(work) / name, folder / name)
    except OSError as error:
        raise MapError(
            f"{folder}: cannot be written: {error.strerror}; choose another folder"
        ) from error
    return [folder / name for name in FILES]


def write_previews(error: PolarityError) -> list[Path]:
    """Writes `preview-dark.png` and `preview-light.png` of a map of unclear polarity.

    Args:
        error: From `preprocess`. The files go to its `folder`, by default `NAME-map`.

    Raises:
        MapError: The folder cannot be written.
    """
    folder = error.folder or Path(f"{Path(error.name).stem}-map")
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for polarity, (colour, grid, params) in error.pictures.items():
            files.append(folder / f"preview-{polarity}.png")
            files[-1].write_bytes(png(preview_of(colour, grid, params)))
    except OSError as fault:
        raise MapError(
            f"{folder}: cannot be written: {fault.strerror}; choose another folder"
        ) from fault
    return files


def preview_of(colour: ColourImage, grid: OccupancyGrid, params: MapParams) -> Image:
    """A picture of a map with its obstacles, task and shortest path, uint8 RGB.

    Args:
        colour: Shape (height, width, 3), uint8 RGB, the map's picture.
        grid: From `preprocess`.
        params: From `preprocess`.
    """
    from tdac_envs.mapping.preview import draw_preview

    return draw_preview(colour, grid.cells, params, shortest_path(grid, params))


def png(picture: Image) -> bytes:
    """A uint8 RGB picture as a PNG file's bytes."""
    shown = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".png", shown)[1].tobytes()


def write_grid(folder: Path, grid: OccupancyGrid, params: MapParams) -> None:
    """Writes `occupancy.npy`, `occupancy.png` and `params.json` into a folder."""
    np.save(folder / "occupancy.npy", grid.cells)
    _save_png(folder / "occupancy.png", np.where(grid.cells, 0, 255).astype(np.uint8))
    params.save(folder / "params.json")


def _save_png(path: Path, picture: NDArray[Any]) -> None:
    path.write_bytes(cv2.imencode(".png", picture)[1].tobytes())


def shortest_path(grid: OccupancyGrid, params: MapParams) -> NDArray[np.float64]:
    """The path from start to goal that keeps the planner's margin, px.

    Returns:
        Shape (n, 2), columns x and y; empty without a start and a goal.
    """
    if params.start is None or params.goal is None:
        return np.empty((0, 2))
    ends = [(round(x), round(y)) for x, y in (params.start, params.goal)]
    margin = params.robot.radius + params.inflation
    return plan_path(body_free(clearance(grid.cells), margin), ends[0], ends[1])
