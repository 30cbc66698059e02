"""The picture of a map or world on which a user clicks start and goal."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from tdac_envs.drawing.canvas import Image as Picture
from tdac_envs.grid.grid import BoolGrid, FloatGrid, clearance
from tdac_envs.mapping.bundled import bundled_map, bundled_maps
from tdac_envs.mapping.image import MapImage
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.map_folder import png
from tdac_envs.mapping.params import ReadingOptions
from tdac_envs.mapping.preprocessing import preprocess_with_candidates
from tdac_envs.mapping.score import widest_radius
from tdac_envs.mapping.wording import obstacles_text, scale_text
from tdac_envs.robots.bundled import bundled_robots, load_robot
from tdac_envs.robots.robot_file import RobotFile
from tdac_envs.worlds.bodies import bodies
from tdac_envs.worlds.bundled import bundled_worlds, world_file
from tdac_envs.worlds.picture import WorldCanvas, bounds_of, draw_things
from tdac_envs.worlds.wbt.reader import load_world

Kind = Literal["map", "world"]
Place = tuple[float, float]
WIDTH = 900
"""Small maps are enlarged to about this width, large ones reduced to twice that, px."""
OCCUPIED = 24, 90, 150
SHARE = 0.75
"""Opacity of the occupied grid over the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class SourceView:
    """A picture, and the conversion between its pixels and places.

    Attributes:
        kind: Whether it shows a map or a world.
        png: The picture.
        width: Its width, px.
        height: Its height, px.
        unit: Unit of places, `px` or `m`.
        scale: Picture px per unit, in x and in y.
        origin: Point of the picture for the place (0, 0).
        reading: How it was read, in a sentence.
        notes: What the reader is to know.
        start: Where the robot of the file starts, with its heading, if it says so.
        goal: Where the file has its goal.
        radius: Body radius of a bundled map, or the usual one, px.
        widest: Largest body radius that gets from one place to another, in the unit;
            negative for none. None for worlds, whose robot has one size.
        resolution: Metres per px of a map that gives them.
        room: Distance from a place to the nearest obstacle, in the unit; 0 inside of
            one. None for worlds.
        laid_over: The picture with another occupied grid over it: the reading of a
            map may depend on start and goal. None for worlds.
    """

    kind: Kind
    png: bytes
    width: int
    height: int
    unit: str
    scale: tuple[float, float]
    origin: tuple[float, float]
    reading: str
    notes: tuple[str, ...] = ()
    start: tuple[float, float, float] | None = None
    goal: Place | None = None
    radius: float | None = None
    widest: Callable[[Place, Place], float] | None = None
    room: Callable[[Place], float] | None = None
    laid_over: Callable[[BoolGrid], bytes] | None = None
    resolution: float | None = None

    @property
    def robots(self) -> tuple[RobotFile, ...]:
        """The bundled robots that drive here: in metres, where metres are known."""
        if self.kind == "map" and self.resolution is None:
            return ()
        drives = "disc" if self.kind == "map" else "e-puck"
        known = map(load_robot, bundled_robots())
        return tuple(r for r in known if (r.drives, r.unit) == (drives, "m"))

    def at(self, places: ArrayLike) -> NDArray[np.float64]:
        """Points of the picture for places, shape (n, 2)."""
        return np.asarray(places, np.float64).reshape(-1, 2) * self.scale + self.origin

    def place(self, x: float, y: float) -> Place:
        """The place at a point of the picture."""
        over, down = np.subtract((x, y), self.origin) / self.scale
        return float(over), float(down)


def names_of(kind: Kind) -> tuple[str, ...]:
    """Names of the bundled maps or worlds."""
    return tuple(bundled_maps() if kind == "map" else bundled_worlds())


def view_of(kind: Kind, source: str, polarity: str | None = None) -> SourceView:
    """The view of a bundled map or world, or of a file.

    Args:
        kind: Which of them.
        source: Name, or path.
        polarity: Which pixels of a map image are obstacles, if the user has said it.

    Raises:
        MapError: The map cannot be used.
        WorldError: The world cannot be used.
        TaskError: The map may be read in two ways, and `polarity` is None.
    """
    if kind == "world":
        return _of_world(source)
    return _of_map(source, polarity)


def as_it_is(source: str) -> bytes:
    """The picture of a map file, of which nothing is known to be an obstacle.

    Raises:
        MapError: The map cannot be read.
    """
    image = load_image(Path(source))
    none = np.zeros(image.colour.shape[:2], bool)
    return png(_laid_over(image, none, _zoom(none)))


def _of_map(source: str, polarity: str | None) -> SourceView:
    bundled = bundled_map(source) if source in bundled_maps() else None
    image = load_image(bundled.image if bundled else Path(source))
    said = ReadingOptions(None if image.occupied is not None else polarity, None)  # type: ignore[arg-type]
    grid, params, _ = preprocess_with_candidates(
        image, None, None, None, preset="default", snap=False, heading=0.0, options=said
    )
    zoom = _zoom(grid.cells)
    picture = _laid_over(image, grid.cells, zoom)

    def laid_over(cells: BoolGrid) -> bytes:
        return png(_laid_over(image, cells, zoom))

    def widest(start: Place, goal: Place) -> float:
        ends = [_pixel(grid.cells, each) for each in (start, goal)]
        return float(widest_radius(clear(), *ends))

    @functools.cache
    def clear() -> FloatGrid:
        return clearance(grid.cells)

    def room(place: Place) -> float:
        column, row = _pixel(grid.cells, place)
        return float(clear()[row, column])

    size = f"{params.width} x {params.height} px"
    text = f"{size}: {obstacles_text(params)}; {scale_text(params.resolution)}"
    return SourceView(
        "map",
        png(picture),
        picture.shape[1],
        picture.shape[0],
        "px",
        (zoom, zoom),
        (0.5 * zoom, 0.5 * zoom),
        text,
        tuple(params.notes),
        (*bundled.start, bundled.heading) if bundled else None,
        bundled.goal if bundled else None,
        bundled.robot_radius if bundled else params.robot.radius,
        widest,
        room,
        laid_over,
        params.resolution,
    )


def _of_world(source: str) -> SourceView:
    world = load_world(world_file(source))
    view = WorldCanvas(bounds_of(world), strip=0)
    draw_things(view, world, bodies(world))
    picture = view.canvas.image
    solid = [node.name or node.kind for node in world.unmodelled if node.may_be_solid]
    notes = [*world.notes]
    if solid:
        notes.append(
            f"not modelled, perhaps solid: {', '.join(solid)}; the world is refused "
            "unless they are ignored"
        )
    robot = next(iter(world.robots), None)
    ((left, low),) = (view.at([0.0, 0.0]) + 0.5).tolist()

    text = f"Webots {world.version}: {len(world.obstacles)} obstacles; places in metres"
    return SourceView(
        "world",
        png(picture),
        picture.shape[1],
        picture.shape[0],
        "m",
        (view.scale, -view.scale),
        (left, low),
        text,
        tuple(notes),
        (robot.x, robot.y, robot.heading) if robot else None,
        world.goal,
    )


def _zoom(cells: BoolGrid) -> float:
    """Picture px per map px: a whole number, or the inverse of one."""
    width = int(cells.shape[1])
    if width < WIDTH:
        return float(max(1, WIDTH // width))
    return 1.0 / max(1, -(-width // (2 * WIDTH)))


def _laid_over(image: MapImage, cells: BoolGrid, zoom: float) -> Picture:
    """The map's picture, with the occupied pixels in colour."""
    pale = 0.5 * image.colour.astype(np.float64) + 127.0
    tint = SHARE * np.array(OCCUPIED) + (1.0 - SHARE) * pale
    mixed = np.where(cells[..., None], tint, pale).astype(np.uint8)
    if zoom >= 1.0:
        return np.repeat(np.repeat(mixed, int(zoom), 0), int(zoom), 1)
    size = (round(cells.shape[1] * zoom), round(cells.shape[0] * zoom))
    return np.asarray(Image.fromarray(mixed).resize(size, Image.Resampling.BOX))


def _pixel(cells: BoolGrid, place: Place) -> tuple[int, int]:
    """The pixel at a place, or the nearest one of the map."""
    rows, columns = cells.shape
    x, y = (round(value) for value in place)
    return min(max(x, 0), columns - 1), min(max(y, 0), rows - 1)
