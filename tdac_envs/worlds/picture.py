"""Draws a world from above, x to the right and y up."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.drawing.canvas import (
    FREE,
    GREEN,
    GREY,
    INK,
    NARROWEST,
    RED,
    WALL,
    Canvas,
    Colour,
    Image,
)
from tdac_envs.drawing.marks import draw_disc
from tdac_envs.worlds.bodies import BODY_RADIUS, at_body_height, bodies, floor_under
from tdac_envs.worlds.footprint import Disc, Footprint, Rectangle
from tdac_envs.worlds.world import EPuck, Obstacle, World

SIDE = 880
"""Longest side of the drawn world, px."""
OUTSIDE: Colour = (222, 223, 219)
STEEL: Colour = (98, 108, 126)
_KINDS: dict[str, Colour] = {
    "CardboardBox": (206, 176, 128),
    "CircleArena": WALL,
    "OilBarrel": (66, 112, 158),
    "PlasticCrate": (200, 78, 70),
    "RectangleArena": WALL,
    "Rock": (138, 134, 127),
    "TrafficCone": (232, 116, 34),
    "WoodenBox": (190, 146, 94),
    "WoodenPallet": (190, 146, 94),
}
_ROUND = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_MARGIN, _STRIP, _LEFT = 0.05, 64, 12
_PALE, _TOLERANCE = 0.3, 0.02
_LEVEL = 0.0025
"""Parts that end within this height of the floor are drawn as floor, m."""


class WorldCanvas:
    """A canvas with a mapping from world to canvas coordinates.

    Args:
        bounds: (left, low, right, high) of the visible area, m.
        strip: Height of the text strip, px.
        side: Longest side of the drawn world, px.
        margin: Margin around the bounds, as a fraction of their longest side.

    Attributes:
        canvas: Canvas to draw on, in canvas coordinates.
        scale: Pixels per metre.
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        *,
        strip: int = _STRIP,
        side: int = SIDE,
        margin: float = _MARGIN,
    ) -> None:
        left, low, right, high = bounds
        pad = margin * max(right - left, high - low)
        self._left, self._low = left - pad, low - pad
        self._right, self._high = right + pad, high + pad
        size = np.array([self._high - self._low, self._right - self._left])
        self.scale = float(side / size.max())
        rows, columns = np.maximum(np.rint(size * self.scale), 40).astype(int).tolist()
        narrowest = min(side, NARROWEST)
        cells = np.zeros((rows, columns), np.bool_)
        self.canvas = Canvas(cells, strip, scale=1.0, narrowest=narrowest)
        self.canvas.image[: self.canvas.strip_top] = OUTSIDE

    def at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Canvas coordinates of points (x, y), shape (n, 2)."""
        x, y = np.asarray(points, np.float64).reshape(-1, 2).T
        return np.column_stack([x - self._left, self._high - y]) * self.scale - 0.5

    def place(self, x: float, y: float) -> tuple[float, float]:
        """The point of the world, m, at canvas coordinates."""
        over, down = (x + 0.5) / self.scale, (y + 0.5) / self.scale
        return self._left + over, self._high - down

    def fill(self, shape: Footprint, colour: Colour, alpha: float = 1.0) -> None:
        """Paints a footprint."""
        if isinstance(shape, Disc):
            radius = shape.radius * self.scale
            self.canvas.disc(self.at((shape.x, shape.y)), radius, colour, alpha)
        else:
            self.canvas.polygon(self.at(shape.vertices), colour, alpha)

    def outline(self, shape: Footprint, colour: Colour, alpha: float = 1.0) -> None:
        """Draws the edge of a footprint."""
        if isinstance(shape, Disc):
            radius = shape.radius * self.scale
            self.canvas.disc(self.at((shape.x, shape.y)), radius, colour, alpha, 1)
        else:
            # Two lines: the canvas simplifies a closed line and would lose an edge.
            corners = self.at(shape.vertices)
            self.canvas.line(corners, colour, 1, alpha)
            self.canvas.line(corners[[-1, 0]], colour, 1, alpha)

    def wash(self, shapes: Iterable[Footprint], colour: Colour, alpha: float) -> None:
        """Paints footprints as one transparent layer; overlaps are not darker."""
        before = self.canvas.image.copy()
        for shape in shapes:
            self.fill(shape, colour)
        image = self.canvas.image
        image[...] = np.rint(alpha * image + (1.0 - alpha) * before)

    def grid(self) -> None:
        """Draws faint grid lines, slightly stronger through the origin."""
        step = self.round_length(60.0)
        for x in np.arange(np.ceil(self._left / step), self._right / step) * step:
            self._grid_line([(x, self._low), (x, self._high)], x)
        for y in np.arange(np.ceil(self._low / step), self._high / step) * step:
            self._grid_line([(self._left, y), (self._right, y)], y)

    def _grid_line(self, ends: ArrayLike, value: float) -> None:
        at_origin = abs(value) * self.scale < 1.0
        self.canvas.line(self.at(ends), WALL, 1, 0.30 if at_origin else 0.09)

    def round_length(self, least: float) -> float:
        """The smallest round length, m, that is at least `least` px long."""
        return next((r for r in _ROUND if r * self.scale >= least), _ROUND[-1])

    def scale_bar(self) -> None:
        """Draws a scale bar of a round length, with its label, in the strip."""
        image, length = self.canvas.image, self.round_length(70.0)
        right, row = image.shape[1] - 16, self.canvas.strip_top + 30
        left = right - round(length * self.scale)
        image[row : row + 2, left:right] = INK
        for end in (left, right - 2):
            image[row - 4 : row + 6, end : end + 2] = INK
        label = f"{length:g} m"
        middle = (left + right - self.canvas.text_width(label)) // 2
        self.canvas.text(middle, row - 10, label, INK)


def draw_world(world: World) -> Image:
    """Draws arenas, obstacles, robots, goal, scale and legend, uint8 RGB.

    Parts that the robot cannot hit are pale: they are above or below it, or not solid.
    Unmodelled nodes that may be solid are marked with a cross.
    """
    view = WorldCanvas(bounds_of(world))
    draw_things(view, world, bodies(world))
    if world.goal is not None:
        _draw_goal(view, world.goal)
    for robot in reversed(world.robots):
        _draw_robot(view, robot, driven=robot is world.robots[0])
    for node in world.unmodelled:
        if node.may_be_solid:
            _draw_cross(view, (node.x, node.y))
    _write_strip(view, world)
    return view.canvas.image


def draw_things(view: WorldCanvas, world: World, things: Iterable[Obstacle]) -> None:
    """Draws the floors, the grid, and all things except robots."""
    floor = floor_under(world)
    for arena in world.arenas:
        view.fill(arena.inside, FREE)
        view.outline(arena.inside, GREY, 0.6)
    for thing in world.obstacles:
        for part in (*thing.solid, *thing.visible):
            if abs(part.top - floor) <= _LEVEL:
                view.fill(part.shape, FREE)
    view.grid()
    for thing in things:
        if thing.kind != "E-puck":
            _draw_obstacle(view, thing, floor)


def colour_of(kind: str) -> Colour:
    """The colour of obstacles of a type."""
    return _KINDS.get(kind, STEEL)


def bounds_of(world: World) -> tuple[float, float, float, float]:
    """Bounds of everything; a square metre around the origin for an empty world."""
    edges = [arena.inside.bounds for arena in world.arenas]
    edges += [part.shape.bounds for thing in bodies(world) for part in thing.solid]
    points = [(robot.x, robot.y) for robot in world.robots]
    points += [(thing.x, thing.y) for thing in world.obstacles]
    points += [(node.x, node.y) for node in world.unmodelled if node.may_be_solid]
    points += [world.goal] if world.goal else []
    edges += [(x - 0.1, y - 0.1, x + 0.1, y + 0.1) for x, y in points]
    box = np.array(edges or [(-0.5, -0.5, 0.5, 0.5)])
    left, low = box[:, :2].min(axis=0).tolist()
    right, high = box[:, 2:].max(axis=0).tolist()
    return left, low, right, high


def _draw_obstacle(view: WorldCanvas, thing: Obstacle, floor: float) -> None:
    colour = GREEN if thing.is_goal else colour_of(thing.kind)
    near = set(at_body_height(thing.solid, floor))
    pale = {
        part.shape: None
        for part in (*thing.solid, *thing.visible)
        if abs(part.top - floor) > _LEVEL
    }
    for part in near:
        pale.pop(part.shape, None)
    if pale:
        view.wash(pale, colour, _PALE)
    for part in near:
        view.fill(part.shape, colour)
    if len(thing.solid) <= 8:
        edge = tuple(round(0.72 * channel) for channel in colour)
        for part in thing.solid:
            view.outline(part.shape, (edge[0], edge[1], edge[2]))
    if thing.mass is not None:
        view.canvas.disc(view.at((thing.x, thing.y)), 3.0, FREE, 0.9)


def _draw_goal(view: WorldCanvas, goal: tuple[float, float]) -> None:
    at = view.at(goal)
    radius = max(_TOLERANCE * view.scale, 9.0)
    view.canvas.disc(at, radius, GREEN, 0.2)
    view.canvas.disc(at, radius, GREEN, width=2)
    view.canvas.disc(at, 3.0, GREEN)


def _draw_robot(view: WorldCanvas, robot: EPuck, driven: bool) -> None:
    x, y = view.at((robot.x, robot.y))[0].tolist()
    radius = max(BODY_RADIUS * view.scale, 5.0)
    view.canvas.disc((x, y), radius + 2, FREE)
    # The screen's y points down.
    draw_disc(view.canvas, (x, y, -robot.heading), radius)
    if not driven:
        view.canvas.disc((x, y), radius, FREE, 0.55)


def _draw_cross(view: WorldCanvas, place: tuple[float, float]) -> None:
    middle = view.at(place)[0]
    for width, ink in ((5, FREE), (2, RED)):
        for slope in (1.0, -1.0):
            arm = np.array([6.0, 6.0 * slope])
            view.canvas.line(np.array([middle - arm, middle + arm]), ink, width)


def _write_strip(view: WorldCanvas, world: World) -> None:
    canvas, first = view.canvas, view.canvas.strip_top + 24
    x = _LEFT
    entries = _legend(world)
    room = canvas.image.shape[1] - 150
    for label, colour in entries:
        name = label.encode("ascii", "replace").decode()
        if x + 24 + canvas.text_width(name) > room:
            break
        canvas.image[first - 10 : first + 1, x : x + 13] = colour
        x = canvas.text(x + 19, first, name, INK) + 13
    words = [world.source or "world", world.version, f"{world.time_step:g} ms"]
    arena = world.arena
    if arena is not None:
        words.append(f"{arena.kind} {_extent(arena.inside)}")
    if any(thing.mass is not None for thing in world.obstacles):
        words.append("dots: can be pushed")
    ascii_only = "  ".join(filter(None, words)).encode("ascii", "replace").decode()
    canvas.text(_LEFT, first + 24, ascii_only, GREY)
    view.scale_bar()


def _legend(world: World) -> list[tuple[str, Colour]]:
    """Labels and colours of the legend; types of one colour share an entry."""
    entries = [("goal", GREEN)] if world.goal is not None else []
    if any(node.may_be_solid for node in world.unmodelled):
        entries.append(("not modelled", RED))
    kinds: dict[Colour, list[str]] = {}
    for kind in dict.fromkeys(t.kind for t in world.obstacles if t.solid):
        kinds.setdefault(_KINDS.get(kind, STEEL), []).append(kind)
    return entries + [(", ".join(kinds[colour][:3]), colour) for colour in kinds]


def _extent(shape: Disc | Rectangle) -> str:
    if isinstance(shape, Disc):
        return f"radius {shape.radius:g} m"
    return f"{shape.length:g} x {shape.width:g} m"
