"""From a map picture to the occupancy grid that a task runs on (Algorithm 1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdac_envs.candidates import Candidate, Preset, ranked
from tdac_envs.errors import TaskError
from tdac_envs.grid import OccupancyGrid, body_free, clearance
from tdac_envs.image import MapImage, from_array, load_image
from tdac_envs.params import MapParams, RobotParams
from tdac_envs.readings import readings
from tdac_envs.scene import Reading, Scene
from tdac_envs.score import Point, nearest_free

Source = str | Path | NDArray[np.generic] | MapImage


def preprocess(
    image: Source,
    start: tuple[float, float] | None = None,
    goal: tuple[float, float] | None = None,
    robot_radius: float = 15.0,
    *,
    preset: Preset = "default",
    snap: bool = False,
    heading: float = 0.0,
) -> tuple[OccupancyGrid, MapParams]:
    """The occupancy grid of a map picture, and what was chosen to get it.

    Args:
        image: Path of a picture, a ROS `map.yaml` or a MovingAI `.map`; or an array:
            bool (True = occupied), or uint8 grey, RGB or RGBA.
        start: Pixel (x, y), or None to judge by the picture alone.
        goal: Pixel (x, y), or None.
        robot_radius: Body radius, px.
        preset: "default" searches from the plain reading outwards and stops at the
            first that is feasible; "paper" is the literal grid of Algorithm 1.
        snap: Move start and goal to the nearest pixel that is free for the body;
            `MapParams.notes` says from where.
        heading: Start heading, rad, from +x towards +y.

    Raises:
        MapError: The image cannot be used.
        TaskError: No reading of it makes the task feasible; says why.
    """
    grid, params, _ = examine(
        image, start, goal, robot_radius, preset=preset, snap=snap, heading=heading
    )
    return grid, params


def examine(
    image: Source,
    start: tuple[float, float] | None,
    goal: tuple[float, float] | None,
    robot_radius: float,
    *,
    preset: Preset,
    snap: bool,
    heading: float,
) -> tuple[OccupancyGrid, MapParams, list[Candidate]]:
    """The same as `preprocess`, and every candidate that was looked at; see `ranked`.

    Raises:
        MapError: As `preprocess` does.
        TaskError: As `preprocess` does.
    """
    source = as_image(image)
    notes: list[str] = []
    ends: list[Point | None] = []
    for name, point in (("start", start), ("goal", goal)):
        pixel = None if point is None else _to_pixel(source, name, point)
        if pixel is not None and snap:
            pixel = _snapped(source, name, pixel, robot_radius, notes)
        ends.append(pixel)
    scene = Scene.of(source, ends[0], ends[1], robot_radius)
    candidates = ranked(scene, preset)
    best = candidates[0]
    if best.reason is not None:
        raise TaskError(f"{source.name}: {best.reason()}")
    grid = OccupancyGrid(best.reading.cells, source.resolution, source.origin)
    notes += _changed(best.reading, preset)
    return grid, _params(scene, best, heading, notes), candidates


def rank_candidates(
    image: Source,
    start: Point | None,
    goal: Point | None,
    robot_radius: float = 15.0,
    *,
    preset: Preset = "default",
) -> list[Candidate]:
    """Every candidate that was looked at, the chosen one first; see `ranked`."""
    return ranked(Scene.of(as_image(image), start, goal, robot_radius), preset)


def as_image(image: Source) -> MapImage:
    """The decoded map of a path, an array, or itself."""
    if isinstance(image, MapImage):
        return image
    if isinstance(image, np.ndarray):
        return from_array(image)
    return load_image(image)


def _to_pixel(image: MapImage, name: str, point: tuple[float, float]) -> Point:
    """The pixel that holds the point; refused outside the map."""
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
    image: MapImage, name: str, point: Point, radius: float, notes: list[str]
) -> Point:
    """The point moved to the nearest pixel that is free for the body."""
    reading = next(readings(Scene.of(image, None, None, radius)))
    free = body_free(clearance(reading.cells), radius)
    moved = nearest_free(free, *point)
    if moved is None or moved == point:
        return point
    notes.append(f"{name} moved from {point} to {moved}")
    return moved


def _changed(reading: Reading, preset: Preset) -> list[str]:
    """In what the reading goes beyond the picture."""
    if not (reading.opening or reading.cleanup):
        return []
    if preset == "paper":
        what = f"pieces and holes under {reading.cleanup} px removed, gaps closed"
        return [f"cleaned with strength {reading.cleanup}: {what}; look at the preview"]
    what = f"specks up to {reading.cleanup} px"
    if reading.opening:
        what = f"lines under {reading.opening} px and {what}"
    return [f"taken for free space in the picture: {what}; look at the preview"]


def _params(
    scene: Scene, best: Candidate, heading: float, notes: list[str]
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
