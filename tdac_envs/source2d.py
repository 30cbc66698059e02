"""Where a Map2D task comes from: a bundled name, a file, a folder or an array."""

from __future__ import annotations

import difflib
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.errors import MapError, TaskError
from tdac_envs.grid import OccupancyGrid
from tdac_envs.maps import bundled_map, bundled_maps
from tdac_envs.params import MapParams, RobotParams
from tdac_envs.preprocess import preprocess

MapSource = str | Path | NDArray[Any]


@dataclass(frozen=True, slots=True)
class Prepared:
    """A grid with the parameters that made it, start and goal filled in.

    Attributes:
        grid: The world.
        params: Its parameters.
        image: The map image, where there is one.
    """

    grid: OccupancyGrid
    params: MapParams
    image: Path | None


def prepare(
    source: MapSource,
    start: tuple[float, ...] | None = None,
    goal: tuple[float, float] | None = None,
    *,
    heading: float | None = None,
    robot_radius: float | None = None,
    snap: bool = False,
) -> Prepared:
    """Reads a map and settles start, goal, heading and body radius on it.

    Args:
        source: Bundled name; path of an image, ROS `map.yaml`, MovingAI `.map` or
            `.npy` grid; folder with `occupancy.npy` and `params.json`; or a bool
            array `[y, x]`, True = occupied.
        start: (x, y) or (x, y, heading), px and rad; from the params if None.
        goal: (x, y), px; from the params if None.
        heading: rad; wins over `start[2]`.
        robot_radius: px; default from the params, else 15.
        snap: Move start and goal to the nearest place that holds the body.

    Raises:
        MapError: The map cannot be read or used.
        TaskError: No start or goal is known.
    """
    if start is not None and len(start) == 3 and heading is None:
        heading = start[2]
    point = None if start is None else (float(start[0]), float(start[1]))
    if isinstance(source, np.ndarray):
        prepared = _from_cells(source, "array")
    elif Path(source).is_dir():
        prepared = _from_folder(Path(source))
    elif Path(source).suffix == ".npy":
        prepared = _from_npy(Path(source))
    elif str(source) in bundled_maps():
        bundled = bundled_map(str(source))
        point, goal = point or bundled.start, goal or bundled.goal
        heading = bundled.heading if heading is None else heading
        robot_radius = robot_radius or bundled.robot_radius
        prepared = _from_image(bundled.image, point, goal, robot_radius, snap)
    else:
        _check_exists(Path(source))
        prepared = _from_image(Path(source), point, goal, robot_radius, snap)
    return Prepared(
        prepared.grid,
        _settle(prepared.params, point, goal, heading, robot_radius, snap),
        prepared.image,
    )


def _settle(
    params: MapParams,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    heading: float | None,
    robot_radius: float | None,
    snap: bool,
) -> MapParams:
    """Fills in what was given; a point that was snapped stays where it is."""
    changes: dict[str, Any] = {}
    if start is not None and not (snap and params.start):
        changes["start"] = start
    if goal is not None and not (snap and params.goal):
        changes["goal"] = goal
    if heading is not None:
        changes["heading"] = float(heading)
    if robot_radius is not None and robot_radius != params.robot.radius:
        changes["robot"] = RobotParams.disc(robot_radius)
    settled = params.model_copy(update=changes)
    missing = [name for name in ("start", "goal") if getattr(settled, name) is None]
    if missing:
        raise TaskError(
            f"no {' and no '.join(missing)} for {params.source}: give start and goal "
            "in pixels (`tdac map IMAGE` draws rulers to read them off)"
        )
    return settled


def _from_image(
    image: Path,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    robot_radius: float | None,
    snap: bool,
) -> Prepared:
    radius = RobotParams().radius if robot_radius is None else robot_radius
    grid, params = preprocess(image, start, goal, robot_radius=radius, snap=snap)
    return Prepared(grid, params, image)


def _from_folder(folder: Path) -> Prepared:
    params = MapParams.load(folder / "params.json")
    grid = _read_cells(folder / "occupancy.npy")
    return Prepared(
        OccupancyGrid(grid.cells, params.resolution, params.origin), params, None
    )


def _from_npy(path: Path) -> Prepared:
    return _from_cells(_read_cells(path).cells, path.name)


def _from_cells(cells: NDArray[Any], name: str) -> Prepared:
    if cells.dtype != np.bool_:
        raise MapError(f"expected a bool array (True = occupied), got {cells.dtype}")
    grid = OccupancyGrid(cells)
    params = MapParams(
        source=name,
        source_sha256=hashlib.sha256(grid.cells.tobytes()).hexdigest(),
        width=grid.width,
        height=grid.height,
        polarity="given",
        method="given",
    )
    return Prepared(grid, params, None)


def _read_cells(path: Path) -> OccupancyGrid:
    try:
        cells = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise MapError(f"cannot read the grid {path}: {error}") from error
    if cells.dtype != np.bool_:
        raise MapError(f"{path}: expected a bool array, got {cells.dtype}")
    return OccupancyGrid(cells)


def _check_exists(path: Path) -> None:
    if path.exists():
        return
    hint = ""
    if not path.suffix:
        names = bundled_maps()
        close = difflib.get_close_matches(str(path), names, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        hint += f" (bundled maps: {', '.join(names)})"
    raise MapError(f"no map {str(path)!r}: no such file{hint}")
