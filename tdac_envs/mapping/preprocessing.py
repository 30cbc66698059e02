"""Preprocessing: from a map picture to the occupancy grid of a task (Algorithm 1)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import PolarityError, RefusedError, TaskError
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.mapping.candidates import MapCandidate, Preset, ranked
from tdac_envs.mapping.image import MapImage, from_array
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.params import (
    DEFAULT_OPTIONS,
    METRIC_RADIUS,
    MapParams,
    ReadingOptions,
    RobotParams,
    Shade,
)
from tdac_envs.mapping.readings import readings
from tdac_envs.mapping.scene import (
    MapProblem,
    MapReading,
    decide_light_free,
    is_polarity_unclear,
)
from tdac_envs.mapping.score import Point
from tdac_envs.mapping.snapping import body_fits, snap
from tdac_envs.mapping.wording import with_hints

Source = str | Path | NDArray[np.generic] | MapImage

_CLOSE_CALL = "dark and light obstacles are both likely"


def preprocess(
    image: Source,
    start: tuple[float, float] | None = None,
    goal: tuple[float, float] | None = None,
    robot_radius: float | None = None,
    *,
    preset: Preset = "default",
    snap: bool = False,
    heading: float = 0.0,
    polarity: Shade | None = None,
    threshold: float | None = None,
    units: MapUnits = PIXELS,
) -> tuple[OccupancyGrid, MapParams]:
    """The occupancy grid of a map picture, and the parameters that were chosen.

    Args:
        image: Path of a picture, a ROS `map.yaml` or a MovingAI `.map`; or an array:
            bool (True = occupied), or uint8 grey, RGB or RGBA.
        start: Pixel (x, y), or None to use the picture alone.
        goal: Pixel (x, y), or None.
        robot_radius: Body radius, px. Default: 15 px; if the picture has a resolution,
            0.2 m without a task, and a task needs it.
        preset: "default" tries readings from the plain one to bolder ones and takes the
            first feasible one; "paper" is the literal grid of Algorithm 1.
        snap: Move start and goal to the nearest connected pixels that are free for the
            body; `MapParams.notes` records the move.
        heading: Start heading, rad, from +x towards +y.
        polarity: Which pixels are obstacles; inferred from the picture if None.
        threshold: Luminance, 0..255, above which a pixel is light; inferred if None.
        units: Units of messages and notes.

    Raises:
        MapError: The image cannot be used.
        PolarityError: There is a task, and both polarities are likely.
        RefusedError: The task is feasible on no reading.
        TaskError: An argument is invalid.
    """
    source, options = as_image(image), ReadingOptions(polarity, threshold)
    scene, notes = _scene(source, start, goal, robot_radius, snap, options, units)
    candidates = ranked(scene, preset)
    if is_polarity_unclear(scene, candidates[0].reading.polarity):
        if scene.trip is not None:
            raise _close_call(scene, source, preset, heading)
        notes.append(f"{_CLOSE_CALL}; give polarity='dark' or 'light'")
    return _result(scene, candidates[0], preset, heading, notes)


def preprocess_with_candidates(
    image: Source,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    robot_radius: float | None,
    *,
    preset: Preset,
    snap: bool,
    heading: float,
    options: ReadingOptions,
    units: MapUnits = PIXELS,
) -> tuple[OccupancyGrid, MapParams, list[MapCandidate]]:
    """The results of `preprocess`, and all evaluated candidates; see `ranked`.

    Raises:
        MapError: As `preprocess` does.
        PolarityError: Both polarities are likely, even without a task.
        RefusedError: As `preprocess` does.
        TaskError: As `preprocess` does.
    """
    source = as_image(image)
    scene, notes = _scene(source, start, goal, robot_radius, snap, options, units)
    candidates = ranked(scene, preset)
    if is_polarity_unclear(scene, candidates[0].reading.polarity):
        raise _close_call(scene, source, preset, heading)
    grid, params = _result(scene, candidates[0], preset, heading, notes)
    return grid, params, candidates


def _scene(
    source: MapImage,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    robot_radius: float | None,
    snapping: bool,
    options: ReadingOptions,
    units: MapUnits,
) -> tuple[MapProblem, list[str]]:
    """The picture with its task, and notes on moved points."""
    if source.occupied is not None and options != DEFAULT_OPTIONS:
        raise TaskError(
            f"{source.name} itself defines which cells are obstacles; leave out "
            "polarity and threshold"
        )
    radius = _radius(source, robot_radius, start is not None or goal is not None, units)
    alone = MapProblem.of(source, None, None, radius, options, units)
    for name, point in (("start", start), ("goal", goal)):
        if point is not None and not np.isfinite(point).all():
            raise TaskError(f"expected {name} to be two finite numbers, got {point}")
        if point is not None and not _is_inside(source, point):
            raise _outside(alone, name, start, goal)
    ends = [None if point is None else _pixel(point) for point in (start, goal)]
    if not snapping:
        return alone.with_ends(ends[0], ends[1]), []
    light_free = source.occupied is None and decide_light_free(alone)
    return _snapped(alone.with_ends(ends[0], ends[1]), light_free)


def _radius(
    source: MapImage, given: float | None, has_task: bool, units: MapUnits
) -> float:
    """The body radius, px: the given one, else a default for this picture.

    Raises:
        TaskError: A task on a map with a resolution needs one. The paper's pixels say
            nothing about the size of a robot in metres.
    """
    resolution = source.resolution
    if given is not None:
        return given
    if resolution is None:
        return RobotParams().radius
    if not has_task:
        return METRIC_RADIUS / resolution
    if units == PIXELS:
        size = METRIC_RADIUS / resolution
        which = f"in px (--radius {size:g}, robot_radius={size:g}: {METRIC_RADIUS} m)"
    else:
        size = METRIC_RADIUS
        which = f"in metres (--radius {size:g}, robot_radius={size:g})"
    raise TaskError(
        f"{source.name}: the map has a resolution: give the body's radius {which} or a "
        "robot (--robot NAME)"
    )


def _result(
    scene: MapProblem,
    best: MapCandidate,
    preset: Preset,
    heading: float,
    notes: list[str],
) -> tuple[OccupancyGrid, MapParams]:
    """The grid and the parameters of the best candidate.

    Raises:
        RefusedError: The task is infeasible on it.
    """
    params = _params(scene, best, heading, notes + _changed(best.reading, preset))
    if best.reason is not None:
        raise _refusal(scene, best.reading, params, best.reason())
    return _grid(scene, best.reading), params


def _refusal(
    scene: MapProblem, reading: MapReading, params: MapParams, reason: str
) -> RefusedError:
    """The error with a picture of a reading on which the task is infeasible."""
    name = scene.image.name
    grid = _grid(scene, reading)
    reason = with_hints(reason, grid, params, scene.units)
    picture = (scene.image, grid, params, scene.units)
    return RefusedError(f"{name}: {reason}", name, {"refused": picture})


def _grid(scene: MapProblem, reading: MapReading) -> OccupancyGrid:
    image = scene.image
    return OccupancyGrid(reading.cells, image.resolution, image.origin)


def _close_call(
    scene: MapProblem, source: MapImage, preset: Preset, heading: float
) -> PolarityError:
    """The error that describes both readings of a picture and has their previews.

    Args:
        scene: The picture as it was evaluated.
        source: The original picture.
        preset: As for `preprocess`.
        heading: As for `preprocess`.
    """
    summaries: list[str] = []
    pictures: dict[str, Any] = {}
    for polarity in scene.polarities:
        one = replace(scene, options=replace(scene.options, polarity=polarity))
        best = ranked(one, preset)[0]
        free = float(1 - best.reading.cells.mean())
        summaries.append(
            f"{polarity} obstacles leave {free:.0%} free{_path(best, scene.units)}"
        )
        params = _params(one, best, heading, [])
        grid = _grid(one, best.reading)
        pictures[f"preview-{polarity}"] = (source, grid, params, scene.units)
    message = f"{scene.image.name}: {_CLOSE_CALL}: {', '.join(summaries)}"
    advice = "give polarity='dark' or 'light' (--polarity dark or --polarity light)"
    return PolarityError(f"{message}; {advice}", scene.image.name, pictures)


def _path(best: MapCandidate, units: MapUnits) -> str:
    """A remark on the length of the path."""
    if best.terms is not None:
        return f" and a grid path of {units.length(best.terms.path_length, 0)}"
    return "" if best.reason is None else " and no path"


def rank_candidates(
    image: Source,
    start: Point | None,
    goal: Point | None,
    robot_radius: float = 15.0,
    *,
    preset: Preset = "default",
) -> list[MapCandidate]:
    """All evaluated candidates, the chosen one first; see `ranked`."""
    return ranked(MapProblem.of(as_image(image), start, goal, robot_radius), preset)


def as_image(image: Source) -> MapImage:
    """The decoded map of a path or an array; a `MapImage` is returned as it is."""
    if isinstance(image, MapImage):
        return image
    if isinstance(image, np.ndarray):
        return from_array(image)
    return load_image(image)


def _is_inside(image: MapImage, point: tuple[float, float]) -> bool:
    x, y = np.floor(np.add(point, 0.5))
    return bool(0 <= x < image.width and 0 <= y < image.height)


def _pixel(point: tuple[float, float]) -> Point:
    """The pixel that contains the point."""
    return int(np.floor(point[0] + 0.5)), int(np.floor(point[1] + 0.5))


def _outside(
    alone: MapProblem,
    name: str,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
) -> RefusedError:
    """The error for the start or goal, called `name`, outside the map.

    Args:
        alone: The picture without its task.
        name: `start` or `goal`.
        start: As given, px.
        goal: As given, px.
    """
    x, y = {"start": start, "goal": goal}[name] or (0.0, 0.0)
    image, units = alone.image, alone.units
    reading = next(readings(alone))
    params = _params(alone, MapCandidate(reading), 0.0, [])
    params = params.model_copy(update={"start": start, "goal": goal})
    reason = (
        f"{name} {units.point(x, y)} lies outside the map; "
        f"expected {extent_text(image.width, image.height, units)}"
    )
    return _refusal(alone, reading, params, reason)


def extent_text(width: int, height: int, units: MapUnits) -> str:
    """Describes which coordinates lie on a map of this size, px."""
    if units == PIXELS:
        return f"0 <= x < {width} and 0 <= y < {height}"
    corners = [
        units.coordinates(x - 0.5, y - 0.5) for x in (0, width) for y in (0, height)
    ]
    (left, right), (low, high) = (
        (units.rounded(min(values)), units.rounded(max(values)))
        for values in zip(*corners, strict=True)
    )
    return f"{left} <= x < {right} and {low} <= y < {high} (m, in the map's frame)"


def _snapped(scene: MapProblem, light_free: bool) -> tuple[MapProblem, list[str]]:
    """The scene with its ends moved to free pixels, and notes on the moves.

    Args:
        scene: The picture with the task as given.
        light_free: The polarity by the picture alone: a start in a wall says nothing.
    """
    reading = _clearest(scene, light_free)
    moved = snap(reading.cells, scene.start, scene.goal, scene.radius, scene.units)
    ends = [None if p is None else _pixel(p) for p in (moved.start, moved.goal)]
    pointed = tuple(scene.ends) if reading.lettering else ()
    return scene.with_ends(ends[0], ends[1], pointed), list(moved.notes)


def _clearest(scene: MapProblem, light_free: bool) -> MapReading:
    """The plainest reading on which as few ends as possible need a move."""
    best, most = None, (-1, -1)
    for reading in readings(scene, light_free):
        fitting = sum(body_fits(reading.cells, p, scene.radius) for p in scene.ends)
        # Thin lines and specks under a start may be obstacles, words are not.
        if best is None or (fitting, reading.lettering) > most:
            best, most = reading, (fitting, reading.lettering)
        if fitting == len(scene.ends):
            break
    assert best is not None
    return best


def _changed(reading: MapReading, preset: Preset) -> list[str]:
    """Notes on the obstacles that the reading removes from the picture."""
    if not (reading.opening or reading.cleanup or reading.lettering):
        return []
    if preset == "paper":
        what = f"pieces and holes under {reading.cleanup} px removed, gaps closed"
        return [f"cleaned with strength {reading.cleanup}: {what}; check the preview"]
    parts = ["words over start or goal"] if reading.lettering else []
    if reading.opening:
        parts.append(f"lines under {reading.opening} px")
    if reading.cleanup:
        parts.append(f"specks up to {reading.cleanup} px")
    what = " and ".join(parts)
    return [f"treated as free space: {what}; check the preview"]


def _params(
    scene: MapProblem, best: MapCandidate, heading: float, notes: list[str]
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
        robot=RobotParams.disc(scene.radius, image.resolution),
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
        notes=(*image.notes, *notes),
    )
