"""Loads a Map2D task from a bundled name, a file, a folder or an array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import (
    finite,
    finite_numbers,
    finite_point,
    one_of,
    positive,
)
from tdac_envs.core.errors import MapError, TaskError, file_hint, hint
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.intake import printable, read_array
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.metric import Point
from tdac_envs.mapping.bundled import BundledMap, bundled_map, bundled_maps
from tdac_envs.mapping.image import check_size, read_bytes
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.params import (
    DEFAULT_OPTIONS,
    FrameName,
    MapParams,
    ReadingOptions,
    RobotParams,
)
from tdac_envs.mapping.snapping import snap

MapSource = str | Path | NDArray[Any] | Sequence[Sequence[Any]]

_YAML = {".yaml", ".yml"}


@dataclass(frozen=True, slots=True)
class Prepared:
    """A grid and its parameters, with start and goal filled in.

    Attributes:
        grid: The occupancy grid.
        params: Parameters of the map and the task.
        image: Path of the map image, if any.
    """

    grid: OccupancyGrid
    params: MapParams
    image: Path | None


def prepare(
    source: MapSource,
    start: Sequence[float] | None = None,
    goal: Sequence[float] | None = None,
    *,
    heading: float | None = None,
    robot_radius: float | None = None,
    robot: RobotParams | None = None,
    snap: bool = False,
    options: ReadingOptions = DEFAULT_OPTIONS,
    resolution: float | None = None,
    units: MapUnits = PIXELS,
) -> Prepared:
    """Reads a map and determines start, goal, heading and body radius.

    Args:
        source: Bundled name; path of an image, ROS `map.yaml`, MovingAI `.map` or
            `.npy` grid; folder with `occupancy.npy` and `params.json`; or a bool
            array `[y, x]`, True = occupied, also as nested lists of bools or 0 and 1.
        start: (x, y) or (x, y, heading), px and rad; from the params if None.
        goal: (x, y), px; from the params if None.
        heading: Start heading, rad; overrides `start[2]`.
        robot_radius: Body radius, px; from the robot or the params if None. An image
            without a resolution has a default of 15, one with a resolution has none.
        robot: The robot, px, instead of that of the params or the default.
        snap: Whether to move start and goal to the nearest place where the body fits.
        options: Polarity and threshold of an image, where the user gave them.
        resolution: Metres per pixel of an image that gives none.
        units: Units of messages and notes, from `units_of`.

    Raises:
        MapError: The map cannot be read or used.
        TaskError: Start or goal is missing, or a number is not valid.
    """
    if robot_radius is not None:
        robot_radius = positive("robot_radius", robot_radius)
    given = _TaskOptions.of(
        start, goal, heading, robot_radius, robot, snap, options, resolution, units
    )
    if not isinstance(source, str | Path):
        _refuse(given, "a grid")
        return _with_task(_from_cells(_as_cells(source), "array"), given)
    # To load a folder with the name of a bundled map, write `./maze`.
    if isinstance(source, str) and source in bundled_maps():
        bundled = bundled_map(source)
        return _from_image(bundled.image, given.or_else(bundled))
    path = Path(source)
    if path.is_dir():
        _check_is_map_folder(path)
        _refuse(given, str(path))
        return _with_task(_from_folder(path), given)
    if path.suffix == ".npy":
        _refuse(given, str(path))
        return _with_task(_from_npy(path), given)
    check_exists(path)
    return _from_image(path, given)


@dataclass(frozen=True, slots=True)
class _TaskOptions:
    """The caller's options of the task; None stands for the map's own value."""

    start: Point | None
    goal: Point | None
    heading: float | None
    robot_radius: float | None
    robot: RobotParams | None
    snap: bool
    options: ReadingOptions
    resolution: float | None
    units: MapUnits = PIXELS

    @classmethod
    def of(
        cls,
        start: Sequence[float] | None,
        goal: Sequence[float] | None,
        heading: float | None,
        robot_radius: float | None,
        robot: RobotParams | None,
        snap: bool,
        options: ReadingOptions,
        resolution: float | None,
        units: MapUnits,
    ) -> _TaskOptions:
        at = end = None
        if start is not None:
            count = 3 if np.size(start) == 3 else 2
            numbers = finite_numbers("start", start, count)
            at = (numbers[0], numbers[1])
            heading = numbers[-1] if count == 3 and heading is None else heading
        if goal is not None:
            end = finite_point("goal", goal)
        if heading is not None:
            heading = finite("heading", heading)
        body = robot_radius, robot
        return cls(at, end, heading, *body, snap, options, resolution, units)

    @property
    def radius(self) -> float | None:
        """The body radius: that of the robot, if there is no other, px."""
        if self.robot_radius is None and self.robot is not None:
            return self.robot.radius
        return self.robot_radius

    def or_else(self, bundled: BundledMap) -> _TaskOptions:
        """These options, with the values of a bundled map instead of None."""
        return replace(
            self,
            start=self.start or bundled.start,
            goal=self.goal or bundled.goal,
            heading=bundled.heading if self.heading is None else self.heading,
            robot_radius=self.radius or bundled.robot_radius,
        )


def _with_task(prepared: Prepared, given: _TaskOptions) -> Prepared:
    """Overrides the task in the params with the options that are not None."""
    changes: dict[str, Any] = {
        name: value
        for name in ("start", "goal", "heading")
        if (value := getattr(given, name)) is not None
    }
    robot, radius = given.robot or prepared.params.robot, given.robot_radius
    if radius is not None and radius != robot.radius:
        robot = robot.changed(radius=radius, axle_length=2 * radius)
    changes["robot"] = robot
    params = prepared.params.model_copy(update=changes)
    missing = [name for name in ("start", "goal") if getattr(params, name) is None]
    if missing:
        unit, flag = (
            ("pixels", "") if given.units == PIXELS else ("metres", " --metres")
        )
        raise TaskError(
            f"no {' and no '.join(missing)} for {params.source}: give start and goal "
            f"in {unit} (`tdac map IMAGE{flag}` draws rulers for reading them)"
        )
    if given.snap:
        params = _snapped(prepared.grid, params, given.units)
    return Prepared(prepared.grid, params, prepared.image)


def _snapped(grid: OccupancyGrid, params: MapParams, units: MapUnits) -> MapParams:
    """Moves start and goal to the nearest pixels where the body fits."""
    ends = params.start, params.goal
    moved = snap(grid.cells, *ends, params.robot.radius, units)
    notes = (*params.notes, *moved.notes)
    changes = {"start": moved.start, "goal": moved.goal, "notes": notes}
    return params.model_copy(update=changes)


def units_of(
    source: MapSource, frame: str, resolution: float | None = None
) -> MapUnits:
    """The units of places and lengths on a map: pixels, or metres in its frame.

    Args:
        source: As for `prepare`.
        frame: `"pixels"` or `"metres"`: what the user gives and reads.
        resolution: As for `prepare`.

    Raises:
        TaskError: There is no such frame, or the map can have no metres.
        MapError: Metres are wanted, but the map cannot be read or has no resolution.
    """
    one_of("frame", frame, get_args(FrameName))
    if frame == "pixels":
        return PIXELS
    if not isinstance(source, str | Path):
        raise TaskError("frame: an array has no scale, which metres need; give pixels")
    if isinstance(source, str) and source in bundled_maps():
        raise TaskError(f"frame: the bundled map {source} has no scale; give pixels")
    path = Path(source)
    check_exists(path)
    if path.is_dir():
        _check_is_map_folder(path)
        return MapUnits.metres(_from_folder(path).grid)
    return MapUnits.metres(load_image(path, resolution))


def has_resolution(source: str, resolution: float | None = None) -> bool:
    """Whether metres are known on a map file: ROS maps have a resolution.

    Args:
        source: Path of the file.
        resolution: Metres per pixel of an image that gives none, as for `prepare`.
    """
    return resolution is not None or Path(source).suffix in _YAML


def metric_units(source: MapSource, resolution: float | None = None) -> MapUnits | None:
    """Metres in the frame of a map; None if it has no resolution.

    Raises:
        MapError: There is no such map.
    """
    try:
        return units_of(source, "metres", resolution)
    except (TaskError, MapError):
        if isinstance(source, str | Path) and str(source) not in bundled_maps():
            check_exists(Path(source))
        return None


def _from_image(image: Path, given: _TaskOptions) -> Prepared:
    # Not cached for a ROS map.yaml: the digest does not cover the image that it names.
    read = _read_image.__wrapped__ if image.suffix in _YAML else _read_image
    ends = given.start, given.goal
    how = given.snap, given.options, given.resolution, given.units
    prepared = read(image, sha256_of(read_bytes(image)), *ends, given.radius, *how)
    if given.snap:  # preprocessing has already moved the points
        given = replace(given, start=None, goal=None, snap=False)
    return _with_task(prepared, given)


# Preprocessing takes most of the time of `gym.make`; a grid takes one byte per pixel.
@lru_cache(maxsize=16)
def _read_image(
    image: Path,
    digest: str,  # noqa: ARG001 - part of the cache key, as the file may change
    start: Point | None,
    goal: Point | None,
    radius: float | None,
    snap: bool,
    options: ReadingOptions,
    resolution: float | None,
    units: MapUnits,
) -> Prepared:
    # Imported late: grids need no preprocessing.
    from tdac_envs.mapping.preprocessing import preprocess

    how: Any = {
        "polarity": options.polarity,
        "threshold": options.threshold,
        "units": units,
    }
    picture = load_image(image, resolution)
    grid, params = preprocess(picture, start, goal, radius, snap=snap, **how)
    return Prepared(grid, params, image)


def _refuse(given: _TaskOptions, what: str) -> None:
    """Refuses image options for a map that is not an image."""
    if given.options != DEFAULT_OPTIONS:
        raise TaskError(
            f"{what} already defines which cells are obstacles; leave out polarity and "
            "threshold"
        )
    if given.resolution is not None:
        raise TaskError(f"{what}: leave out the resolution, which is for images")


def _as_cells(source: NDArray[Any] | Sequence[Sequence[Any]]) -> NDArray[Any]:
    """The array of a map that is an array or, from JSON, nested lists."""
    if isinstance(source, np.ndarray):
        return source
    try:
        rows = np.array(source)
    except ValueError:
        raise MapError("expected all rows of the map to have the same length") from None
    whole = rows.dtype.kind in "iu" and np.isin(rows, (0, 1)).all()
    return rows.astype(np.bool_) if whole else rows


def _from_folder(folder: Path) -> Prepared:
    params = MapParams.load(folder / "params.json")
    grid = _read_cells(folder / "occupancy.npy")
    if (grid.width, grid.height) != (params.width, params.height):
        raise MapError(
            f"{folder}: occupancy.npy has {grid.width} x {grid.height} pixels, "
            f"params.json says {params.width} x {params.height}"
        )
    return Prepared(
        OccupancyGrid(grid.cells, params.resolution, params.origin), params, None
    )


def _from_npy(path: Path) -> Prepared:
    return _from_cells(_read_cells(path).cells, printable(path.name))


def _from_cells(cells: NDArray[Any], name: str) -> Prepared:
    if cells.dtype != np.bool_:
        raise MapError(f"expected a bool array (True = occupied), got {cells.dtype}")
    grid = OccupancyGrid(cells)
    params = MapParams(
        source=name,
        source_sha256=grid.sha256(),
        width=grid.width,
        height=grid.height,
        polarity="given",
        method="given",
    )
    return Prepared(grid, params, None)


def _read_cells(path: Path) -> OccupancyGrid:
    try:
        cells = read_array(read_bytes(path))
    except ValueError as error:
        raise MapError(f"cannot read the grid {path}: {error}") from error
    if cells.ndim == 2:
        check_size(path.name, cells.shape[1], cells.shape[0])
    if cells.dtype != np.bool_:
        raise MapError(f"{path}: expected a bool array, got {cells.dtype}")
    return OccupancyGrid(cells)


def _check_is_map_folder(folder: Path) -> None:
    if not (folder / "params.json").is_file():
        raise MapError(
            f"{folder} is a folder without a params.json: give a map file, or a folder "
            "written by `tdac map`"
        )


def check_exists(path: Path) -> None:
    """Checks that a map exists.

    Raises:
        MapError: It does not; the message suggests a file beside it or a bundled map
            with a similar name.
    """
    if path.exists():
        return
    known = file_hint(path)
    if not path.suffix:
        names = bundled_maps()
        known = f"{hint(str(path), names)}; bundled maps: {', '.join(names)}"
    raise MapError(f"no map {str(path)!r}: no such file{known}")
