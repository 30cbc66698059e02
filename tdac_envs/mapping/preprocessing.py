"""Preprocessing: from a map picture to the occupancy grid of a task (Algorithm 1)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import PolarityError, TaskError
from tdac_envs.grid.grid import OccupancyGrid, body_free, clearance
from tdac_envs.mapping.candidates import Candidate, Preset, ranked
from tdac_envs.mapping.image import ColourImage, MapImage, from_array, load_image
from tdac_envs.mapping.params import (
    DEFAULT_OPTIONS,
    MapParams,
    ReadingOptions,
    RobotParams,
    Shade,
)
from tdac_envs.mapping.readings import readings
from tdac_envs.mapping.scene import MapProblem, MapReading, is_polarity_unclear
from tdac_envs.mapping.score import Point, nearest_free

Source = str | Path | NDArray[np.generic] | MapImage

_CLOSE_CALL = "dark and light obstacles are both likely"


def preprocess(
    image: Source,
    start: tuple[float, float] | None = None,
    goal: tuple[float, float] | None = None,
    robot_radius: float = 15.0,
    *,
    preset: Preset = "default",
    snap: bool = False,
    heading: float = 0.0,
    polarity: Shade | None = None,
    threshold: float | None = None,
) -> tuple[OccupancyGrid, MapParams]:
    """The occupancy grid of a map picture, and the parameters that were chosen.

    Args:
        image: Path of a picture, a ROS `map.yaml` or a MovingAI `.map`; or an array:
            bool (True = occupied), or uint8 grey, RGB or RGBA.
        start: Pixel (x, y), or None to use the picture alone.
        goal: Pixel (x, y), or None.
        robot_radius: Body radius, px.
        preset: "default" tries readings from the plain one to bolder ones and takes the
            first feasible one; "paper" is the literal grid of Algorithm 1.
        snap: Move start and goal to the nearest pixel that is free for the body;
            `MapParams.notes` records the move.
        heading: Start heading, rad, from +x towards +y.
        polarity: Which pixels are obstacles; inferred from the picture if None.
        threshold: Luminance, 0..255, above which a pixel is light; inferred if None.

    Raises:
        MapError: The image cannot be used.
        PolarityError: There is a task, and both polarities are likely.
        TaskError: An argument is invalid, or the task is feasible on no reading.
    """
    source, said = as_image(image), ReadingOptions(polarity, threshold)
    scene, notes = _scene(source, start, goal, robot_radius, snap, said)
    candidates = ranked(scene, preset)
    if is_polarity_unclear(scene, candidates[0].reading.polarity):
        if scene.trip is not None:
            raise _close_call(scene, source.colour, preset, heading)
        notes.append(f"{_CLOSE_CALL}; give polarity='dark' or 'light'")
    return _result(scene, candidates[0], preset, heading, notes)


def preprocess_with_candidates(
    image: Source,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    robot_radius: float,
    *,
    preset: Preset,
    snap: bool,
    heading: float,
    said: ReadingOptions,
) -> tuple[OccupancyGrid, MapParams, list[Candidate]]:
    """The results of `preprocess`, and all evaluated candidates; see `ranked`.

    Raises:
        MapError: As `preprocess` does.
        PolarityError: Both polarities are likely, even without a task.
        TaskError: As `preprocess` does.
    """
    source = as_image(image)
    scene, notes = _scene(source, start, goal, robot_radius, snap, said)
    candidates = ranked(scene, preset)
    if is_polarity_unclear(scene, candidates[0].reading.polarity):
        raise _close_call(scene, source.colour, preset, heading)
    grid, params = _result(scene, candidates[0], preset, heading, notes)
    return grid, params, candidates


def _scene(
    source: MapImage,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    robot_radius: float,
    snap: bool,
    said: ReadingOptions,
) -> tuple[MapProblem, list[str]]:
    """The picture with its task, and notes on moved points."""
    if source.occupied is not None and said != DEFAULT_OPTIONS:
        raise TaskError(
            f"{source.name} itself defines which cells are obstacles; leave out "
            "polarity and threshold"
        )
    notes: list[str] = []
    ends: list[Point | None] = []
    for name, point in (("start", start), ("goal", goal)):
        pixel = None if point is None else _to_pixel(source, name, point)
        if pixel is not None and snap:
            pixel = _snapped(source, name, pixel, robot_radius, said, notes)
        ends.append(pixel)
    return MapProblem.of(source, ends[0], ends[1], robot_radius, said), notes


def _result(
    scene: MapProblem, best: Candidate, preset: Preset, heading: float, notes: list[str]
) -> tuple[OccupancyGrid, MapParams]:
    """The grid and the parameters of the best candidate.

    Raises:
        TaskError: The task is infeasible on it.
    """
    if best.reason is not None:
        raise TaskError(f"{scene.image.name}: {best.reason()}")
    return _grid(scene, best), _params(
        scene, best, heading, notes + _changed(best.reading, preset)
    )


def _grid(scene: MapProblem, best: Candidate) -> OccupancyGrid:
    image = scene.image
    return OccupancyGrid(best.reading.cells, image.resolution, image.origin)


def _close_call(
    scene: MapProblem, colour: ColourImage, preset: Preset, heading: float
) -> PolarityError:
    """The error that describes both readings of a picture and has their previews.

    Args:
        scene: The picture as it was evaluated.
        colour: The original picture.
        preset: As for `preprocess`.
        heading: As for `preprocess`.
    """
    summaries: list[str] = []
    pictures: dict[str, Any] = {}
    for polarity in scene.polarities:
        one = replace(scene, said=replace(scene.said, polarity=polarity))
        best = ranked(one, preset)[0]
        free = float(1 - best.reading.cells.mean())
        summaries.append(f"{polarity} obstacles leave {free:.0%} free{_path(best)}")
        params = _params(one, best, heading, [])
        pictures[polarity] = (colour, _grid(one, best), params)
    message = f"{scene.image.name}: {_CLOSE_CALL}: {', '.join(summaries)}"
    advice = "give polarity='dark' or 'light' (--polarity dark or --polarity light)"
    return PolarityError(f"{message}; {advice}", scene.image.name, pictures)


def _path(best: Candidate) -> str:
    """A remark on the length of the path."""
    if best.terms is not None:
        return f" and a path of {best.terms.path_length:.0f} px"
    return "" if best.reason is None else " and no path"


def rank_candidates(
    image: Source,
    start: Point | None,
    goal: Point | None,
    robot_radius: float = 15.0,
    *,
    preset: Preset = "default",
) -> list[Candidate]:
    """All evaluated candidates, the chosen one first; see `ranked`."""
    return ranked(MapProblem.of(as_image(image), start, goal, robot_radius), preset)


def as_image(image: Source) -> MapImage:
    """The decoded map of a path or an array; a `MapImage` is returned as it is."""
    if isinstance(image, MapImage):
        return image
    if isinstance(image, np.ndarray):
        return from_array(image)
    return load_image(image)


def _to_pixel(image: MapImage, name: str, point: tuple[float, float]) -> Point:
    """The pixel that contains the point; raises TaskError outside the map."""
    height, width = image.colour.shape[:2]
    if not np.isfinite(point).all():
        raise TaskError(f"expected {name} to be two finite numbers, got {point}")
    x, y = int(np.floor(point[0] + 0.5)), int(np.floor(point[1] + 0.5))
    if not (0 <= x < width and 0 <= y < height):
        raise TaskError(
            f"{name} ({point[0]:g}, {point[1]:g}) lies outside the map; expected "
            f"0 <= x < {width} and 0 <= y < {height}"
        )
    return x, y


def _snapped(
    image: MapImage,
    name: str,
    point: Point,
    radius: float,
    said: ReadingOptions,
    notes: list[str],
) -> Point:
    """The point moved to the nearest pixel that is free for the body."""
    reading = next(readings(MapProblem.of(image, None, None, radius, said)))
    free = body_free(clearance(reading.cells), radius)
    moved = nearest_free(free, *point)
    if moved is None or moved == point:
        return point
    notes.append(f"{name} moved from {point} to {moved}")
    return moved


def _changed(reading: MapReading, preset: Preset) -> list[str]:
    """Notes on the obstacles that the reading removes from the picture."""
    if not (reading.opening or reading.cleanup):
        return []
    if preset == "paper":
        what = f"pieces and holes under {reading.cleanup} px removed, gaps closed"
        return [f"cleaned with strength {reading.cleanup}: {what}; check the preview"]
    what = f"specks up to {reading.cleanup} px"
    if reading.opening:
        what = f"lines under {reading.opening} px and {what}"
    return [f"treated as free space: {what}; check the preview"]


def _params(
    scene: MapProblem, best: Candidate, heading: float, notes: list[str]
) -> MapParams:
    image, reading = scene.image, best.reading
    height, width = scene.luminance.shape
    return MapParams(
        source=image.name,
        source_sha256=image.sha256,
        width=width,
        height=height,
        start=scene.start,
        heading=heading,
        goal=scene.goal,
        robot=RobotParams.disc(scene.radius),
        polarity=reading.polarity,
        method=reading.method,
        threshold=reading.threshold,
        cleanup=reading.cleanup,
        opening=reading.opening,
        inflation=best.inflation,
        score=None if best.terms is None else best.score,
        score_terms=best.terms,
        resolution=image.resolution,
        origin=image.origin,
        notes=tuple(notes),
    )
