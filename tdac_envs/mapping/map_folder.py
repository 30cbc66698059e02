"""Writes the files of a preprocessed map: grid, picture, parameters, preview."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import MapError, PicturedError, RefusedError
from tdac_envs.grid.grid import OccupancyGrid, body_free, clearance
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.plan import plan_path
from tdac_envs.mapping.params import MapParams

if TYPE_CHECKING:
    from tdac_envs.drawing.canvas import Image
    from tdac_envs.mapping.image import MapImage
    from tdac_envs.mapping.preprocessing import Source

FILES = ("occupancy.npy", "occupancy.png", "params.json", "preview.png")
REFUSED_FILES = ("refused.png", "preview-dark.png", "preview-light.png")
"""Pictures of a refused map; see `write_pictures`."""


def write_map(
    folder: str | Path,
    grid: OccupancyGrid,
    params: MapParams,
    image: Source,
    units: MapUnits = PIXELS,
    path: NDArray[np.float64] | None = None,
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
        units: Units of the preview's rulers and legend.
        path: Path to draw, from `Map2DTask.shortest_path`; None for the planned one.

    Returns:
        The files, in the order above.

    Raises:
        MapError: The folder cannot be written.
    """
    # Imported late: a task that writes only a grid needs no image code.
    from tdac_envs.mapping.preprocessing import as_image

    folder = Path(folder)
    preview = preview_of(as_image(image), grid, params, units, path=path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".map-", dir=folder) as work:
            write_grid(Path(work), grid, params)
            (Path(work) / "preview.png").write_bytes(png(preview))
            for name in FILES:
                os.replace(Path(work) / name, folder / name)
        for name in REFUSED_FILES:  # of an earlier attempt
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise MapError(
            f"{folder}: cannot be written: {error.strerror}; choose another folder"
        ) from error
    return [folder / name for name in FILES]


def write_pictures(error: PicturedError) -> list[Path]:
    """Writes the pictures of an error, which show why a map is refused.

    They are `preview-dark.png` and `preview-light.png` of a map of unclear polarity,
    or `refused.png` with the place where a task fails.

    Args:
        error: From `preprocess`. The files go to its `folder`, by default `NAME-map`.

    Raises:
        MapError: The folder cannot be written.
    """
    folder = error.folder or Path(f"{Path(error.name).stem}-map")
    files = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, (image, grid, params, units) in error.pictures.items():
            files.append(folder / f"{name}.png")
            reason = ""
            if isinstance(error, RefusedError):
                reason = str(error).removeprefix(f"{error.name}: ")
            picture = preview_of(image, grid, params, units, reason)
            files[-1].write_bytes(png(picture))
    except OSError as fault:
        raise MapError(
            f"{folder}: cannot be written: {fault.strerror}; choose another folder"
        ) from fault
    return files


def preview_of(
    image: MapImage,
    grid: OccupancyGrid,
    params: MapParams,
    units: MapUnits = PIXELS,
    reason: str = "",
    path: NDArray[np.float64] | None = None,
    tolerance: float | None = None,
) -> Image:
    """A picture of a map with its obstacles, task and path, uint8 RGB.

    Args:
        image: The map as read.
        grid: From `preprocess`.
        params: From `preprocess`.
        units: Units of rulers and legend.
        reason: Why the task is refused; the picture then shows where it fails.
        path: The shortest path, from `Map2DTask.shortest_path`, shape (n, 2), px; None
            for the grid path with the planner's margin.
        tolerance: Distance at which the goal is reached, px, for the legend.
    """
    from tdac_envs.mapping.fault import fault_of
    from tdac_envs.mapping.preview import draw_preview

    cells = grid.cells
    fault = fault_of(cells, params, units) if reason else None
    name = "grid path" if path is None else "shortest path"
    if reason:
        path = np.empty((0, 2))
    elif path is None:
        path = planned_path(grid, params)
    how = units, fault, reason, tolerance
    return draw_preview(image, cells, params, (name, path), *how)


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


def planned_path(grid: OccupancyGrid, params: MapParams) -> NDArray[np.float64]:
    """The grid path from start to goal that keeps the planner's margin, px.

    Returns:
        Shape (n, 2), columns x and y; empty without a start and a goal.
    """
    if params.start is None or params.goal is None:
        return np.empty((0, 2))
    ends = [(round(x), round(y)) for x, y in (params.start, params.goal)]
    margin = params.robot.radius + params.inflation
    return plan_path(body_free(clearance(grid.cells), margin), ends[0], ends[1])
