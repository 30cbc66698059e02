"""Reads a folder of maps whose tasks `index.json` lists."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import AliasChoices, Field, ValidationError

from tdac_envs.core.errors import TaskError, TdacError, first_problem, one_line_reason
from tdac_envs.core.intake import RECORD_BYTES, parse_json, printable, read_file
from tdac_envs.core.strict_model import LenientModel
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.ladder.files.file_world import FileWorld
from tdac_envs.map2d.source import prepare
from tdac_envs.mapping.image import luminance
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.params import ReadingOptions

INDEX = "index.json"
MOST_TASKS = 10_000
_SHADES: dict[str, Literal["dark", "light"]] = {
    "dark": "dark",
    "light": "light",
    "dark_obstacle": "dark",
    "light_obstacle": "light",
}


class MapEntry(LenientModel):
    """A task of `index.json`; other keys are not read.

    Places are px and y is down, or m in the frame of the map's `map.yaml`.
    """

    file: str = Field(min_length=1, description="Map, relative to the folder.")
    start: tuple[float, float] = Field(description="Rounded to whole px.")
    goal: tuple[float, float] = Field(description="Rounded to whole px.")
    heading: float = Field(0.0, ge=-math.pi, le=math.pi, description="rad")
    name: str = Field("", max_length=200)
    kind: str = Field("maps", min_length=1, max_length=60)
    origin: str | None = Field(
        None, validation_alias=AliasChoices("origin", "repo"), max_length=500
    )
    polarity: (
        Literal["dark", "light", "dark_obstacle", "light_obstacle", "mixed"] | None
    ) = Field(None, description="dark or light obstacles; `mixed` if neither")
    truth: str | None = Field(
        None, description="Picture of the obstacles in black, instead of the map."
    )


def read_folder(
    folder: Path,
    radius: float,
    skipped: list[str] | None,
    metres: float | None = None,
) -> list[FileWorld]:
    """The worlds of a folder, in the order of its index.

    Args:
        folder: The folder.
        radius: Radius of the body, px; it helps to tell walls from floor in a picture.
        skipped: Takes the reasons why maps cannot be used; None to raise them.
        metres: Metres per px of the maps, if places are in metres; None for px.

    Raises:
        TaskError: The index or a map is missing or not valid.
    """
    entries = _entries(folder)
    grids: dict[tuple[object, ...], BoolGrid] = {}
    found = []
    for written in entries:
        try:
            entry = written if metres is None else _in_pixels(folder, written, metres)
            key = (entry.truth or entry, radius)
            if key not in grids:
                grids[key] = _cells(folder, entry, radius)
        except TdacError as error:
            if skipped is None:
                raise
            skipped.append(str(error))
            continue
        found.append(_world(entry, grids[key]))
    return found


def files_of(folder: Path) -> list[Path]:
    """The index and the files that it names, without reading them.

    Raises:
        TaskError: The index is missing or not valid.
    """
    named = {folder / each.file for each in _entries(folder)}
    named |= {folder / each.truth for each in _entries(folder) if each.truth}
    return [folder / INDEX, *sorted(named)]


def _entries(folder: Path) -> list[MapEntry]:
    if not folder.is_dir():
        raise TaskError(f"no folder {folder}; expected one with maps and {INDEX}")
    path = folder / INDEX
    try:
        values = parse_json(read_file(path, RECORD_BYTES))
    except FileNotFoundError:
        raise TaskError(
            f"the folder {folder} has no {INDEX}, which lists maps with tasks: "
            '[{"file": "map.png", "start": [x, y], "goal": [x, y]}, ...]'
        ) from None
    except (OSError, ValueError) as error:
        raise TaskError(f"{path}: {one_line_reason(error)}") from None
    if not isinstance(values, list) or not values:
        raise TaskError(f"{path} lists no maps; expected a list of tasks")
    if len(values) > MOST_TASKS:
        raise TaskError(f"{path}: {len(values)} tasks; at most {MOST_TASKS} are read")
    return [_entry(path, number, value) for number, value in enumerate(values)]


def _entry(path: Path, number: int, value: Any) -> MapEntry:
    try:
        entry = MapEntry.model_validate(value)
    except ValidationError as error:
        where = f"{path}, task {number}"
        raise TaskError(f"{where}: {first_problem(error, MapEntry)}") from None
    for name in (entry.file, entry.truth or entry.file):
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise TaskError(
                f"{path}, task {number}: {printable(name)} is not in the folder"
            )
    return entry


def _in_pixels(folder: Path, entry: MapEntry, metres: float) -> MapEntry:
    """A task in metres of its map's frame, in px.

    Raises:
        TaskError: The map cannot be read, or has another resolution.
    """
    try:
        image = load_image(folder / entry.file)
        if image.resolution is None:
            image = load_image(folder / entry.file, metres)
    except TdacError as error:
        raise TaskError(f"{entry.file}: {error}") from None
    if not math.isclose(image.resolution or 0.0, metres, rel_tol=1e-6):
        raise TaskError(
            f"{entry.file}: its map has {image.resolution:g} m per px, and the set "
            f"{metres:g}: give `resolution: {image.resolution:g}`"
        )
    units = MapUnits.metres(image)
    heading = math.remainder(units.heading_in_pixels(entry.heading), math.tau)
    places = {
        "start": units.pixels(entry.start),
        "goal": units.pixels(entry.goal),
        "heading": heading,
    }
    return entry.model_copy(update=places)


def _cells(folder: Path, entry: MapEntry, radius: float) -> BoolGrid:
    """The map of a task, from the picture of its obstacles or as `tdac map` reads it.

    Raises:
        TaskError: It cannot be read.
    """
    path = folder / (entry.truth or entry.file)
    try:
        if entry.truth is not None:
            return np.asarray(luminance(load_image(path).colour) < 128)
        options = ReadingOptions(_SHADES.get(entry.polarity or ""))
        task = (entry.start, entry.goal)
        return prepare(path, *task, robot_radius=radius, options=options).grid.cells
    except TdacError as error:
        text = str(error)
        named = path.name in text
        raise TaskError(text if named else f"{entry.file}: {text}") from None


def _world(entry: MapEntry, cells: BoolGrid) -> FileWorld:
    height, width = cells.shape
    (x, y), (goal_x, goal_y) = entry.start, entry.goal
    return FileWorld(
        name=entry.name or entry.file,
        file=entry.file,
        kind=entry.kind,
        origin=entry.origin,
        shape=(height, width),
        packed=np.packbits(cells).tobytes(),
        start=(round(x), round(y)),
        heading=entry.heading,
        goal=(round(goal_x), round(goal_y)),
    )
