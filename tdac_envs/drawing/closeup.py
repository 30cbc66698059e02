"""A picture of one run: the whole map, a close-up of where it ended, and a caption."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from tdac_envs.drawing.backdrop import (
    CLOSE_UP,
    Backdrop,
    Chart,
    CloseUpWindow,
    Points,
    discs_on,
)
from tdac_envs.drawing.canvas import (
    FREE,
    GREEN,
    GREY,
    INK,
    MOVER,
    PAPER,
    TRAIL,
    Canvas,
    Colour,
    Image,
    blank,
    write_text,
)
from tdac_envs.drawing.marks import draw_movers

# Distinguishable from the goal's green with every kind of colour vision.
EVENT: Colour = (213, 94, 0)
EARLY: Colour = (176, 168, 232)
COLUMN, MARGIN = 400, 14
_LINE, _CHARACTERS = 21, 50
_PIECES = 16
# Minimum margin around the event in a close-up, body radii.
_MARGIN_RADII = 5.0
# The same beside another picture, which shows the surroundings.
_NEAR_RADII = 2.0
# Minimum enlargement that justifies a close-up.
_MIN_ZOOM = 1.5
_SMALLEST_BODY = 4.0
# Length of an axis, frame px.
_AXIS = 42.0


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """The event that the picture of a run shows.

    Attributes:
        title: First line of the caption, ASCII.
        facts: Further lines of the caption; long ones are wrapped.
        where: Shape (n, 2): points that the close-up must contain.
        contact: Point of a wall that the body touched.
        way: Shape (m, 2): the shortest path from the last position.
        movers: Movers in the last steps, oldest first, each of shape (k, 3): x, y,
            radius.
        axes: Headings of the x and the y axis of coordinates from the start, rad; None
            if other coordinates are used.
    """

    title: str
    facts: tuple[str, ...]
    where: Points
    contact: tuple[float, float] | None = None
    way: Points | None = None
    movers: Sequence[Points] = ()
    axes: tuple[float, float] | None = None


def run_picture(background: Backdrop, poses: Points, event: Event) -> Image:
    """The picture of a run, uint8 RGB.

    Args:
        background: Background of the run's task.
        poses: Shape (T + 1, 3): x, y, heading.
        event: The event to show.
    """
    chart = background.whole()
    column = _draw(background, chart, poses, event)
    return _side_by_side(_map_of(chart), column)


def bounded_picture(
    background: Backdrop, poses: Points, event: Event, side: int
) -> Image:
    """Like `run_picture`, at most `side` px wide and high.

    The map is shrunk and the text is not, as long as that suffices. No side is shorter
    than three quarters of the other.
    """
    chart = background.whole()
    room = side - COLUMN, side
    column = _draw(background, chart, poses, event, _zoom(_map_of(chart), *room))
    picture = _side_by_side(_shrunk(_map_of(chart), *room), column)
    picture = _shrunk(picture, side, side)
    rows, columns = picture.shape[:2]
    rows, columns = max(rows, 3 * columns // 4), max(columns, 3 * rows // 4)
    padded = blank(rows, columns, PAPER)
    padded[: picture.shape[0], : picture.shape[1]] = picture
    return padded


def with_close_up(
    whole: Image, background: Backdrop, poses: Points, event: Event
) -> Image:
    """Another picture of a map, with the close-up and the caption of a run beside it.

    It stays as it is if a close-up would show little more.

    Args:
        whole: The picture, uint8 RGB.
        background: Background of the run's task.
        poses: Shape (T + 1, 3): x, y, heading.
        event: The event to show.
    """
    scale = background.whole().scale
    window = _window(background, event, poses, scale, _NEAR_RADII)
    if window is None:
        return whole
    chart = background.close_up(window)
    close = _close_up(chart, poses, event, background.radius)
    return _side_by_side(whole, _column(event, close))


def _draw(
    background: Backdrop, chart: Chart, poses: Points, event: Event, zoom: float = 1.0
) -> Image:
    """Draws the run on the whole map, and returns the column beside it.

    `zoom` is how much the map is shrunk later.
    """
    radius = background.radius
    window = _window(background, event, poses, chart.scale * zoom)
    _draw_run(chart, poses, event, radius, show_path=window is None)
    close = None
    if window is not None:
        _draw_window(chart, window)
        close = _close_up(background.close_up(window), poses, event, radius)
    return _column(event, close)


def _map_of(chart: Chart) -> Image:
    return chart.canvas.image[: chart.canvas.strip_top]


def _side_by_side(whole: Image, column: Image) -> Image:
    rows, columns = max(whole.shape[0], column.shape[0]), whole.shape[1]
    picture = blank(rows, columns + COLUMN, PAPER)
    picture[: whole.shape[0], :columns] = whole
    picture[: column.shape[0], columns:] = column
    return picture


def _shrunk(picture: Image, width: int, height: int) -> Image:
    """A picture that fits into a box; unchanged if it does already."""
    zoom = _zoom(picture, width, height)
    if zoom == 1.0:
        return picture
    rows, columns = (max(1, int(zoom * n)) for n in picture.shape[:2])
    size = (columns, rows)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _zoom(picture: Image, width: int, height: int) -> float:
    """The largest scale, 1 at most, at which a picture fits into a box."""
    rows, columns = picture.shape[:2]
    return float(min(1.0, width / columns, height / rows))


def _draw_run(
    chart: Chart, poses: Points, event: Event, radius: float, *, show_path: bool
) -> None:
    """Draws trail, last pose and contact; optionally the shortest path from there."""
    canvas, places = chart.canvas, chart.at(poses[:, :2])
    if show_path and event.way is not None:
        canvas.line(chart.at(event.way), GREEN, 2, 0.9, dash=6)
    draw_movers(canvas, [discs_on(chart, discs) for discs in event.movers])
    body = max(radius * chart.scale, _SMALLEST_BODY)
    canvas.disc(places[0], 4, FREE)
    canvas.disc(places[0], 4, EARLY, width=2)
    _draw_trail(canvas, places)
    x, y = places[-1]
    canvas.disc((x, y), body, TRAIL, 0.35)
    canvas.disc((x, y), body, TRAIL, width=2)
    turns = chart.turned(float(poses[-1, 2])) + np.array([0.0, 2.6, -2.6])
    nose = np.column_stack([np.cos(turns), np.sin(turns)]) * 0.6 * body / canvas.scale
    canvas.polygon(np.add(nose, (x, y)), TRAIL)
    if event.axes is not None:
        _draw_axes(chart, places[0], event.axes)
    if event.contact is not None:
        size, contact = max(0.3 * body, 6.0), chart.at(np.array([event.contact]))
        canvas.disc(contact, size, FREE, 0.9, 5)
        canvas.disc(contact, size, EVENT, width=3)


def _draw_axes(chart: Chart, start: Points, axes: tuple[float, float]) -> None:
    """Draws arrows with the names of the axes at the start."""
    canvas, size = chart.canvas, _AXIS / chart.canvas.scale
    for name, heading in zip("xy", axes, strict=True):
        turn = chart.turned(heading)
        ahead = size * np.array([np.cos(turn), np.sin(turn)])
        left = np.array([ahead[1], -ahead[0]])
        tip = start + ahead
        for colour, width in ((FREE, 4), (INK, 2)):
            canvas.line(np.array([start, tip]), colour, width)
        barbs = [tip - 0.3 * ahead + each * 0.15 * left for each in (1.0, -1.0)]
        canvas.polygon(np.array([tip, *barbs]), INK)
        canvas.label(start + 1.35 * ahead, name, INK)


def _draw_trail(canvas: Canvas, places: Points) -> None:
    """Draws a line that gets darker along the driven path."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    cuts = np.searchsorted(along, np.linspace(0.0, along[-1], _PIECES + 1))
    early, late = np.array(EARLY), np.array(TRAIL)
    for k, (first, last) in enumerate(itertools.pairwise(cuts.tolist())):
        shade = k / (_PIECES - 1)
        red, green, blue = np.rint((1.0 - shade) * early + shade * late).tolist()
        canvas.line(places[first : last + 1], (red, green, blue), 2)


def _window(
    background: Backdrop,
    event: Event,
    poses: Points,
    scale: float,
    margin: float = _MARGIN_RADII,
) -> CloseUpWindow | None:
    """The part to enlarge; None if no close-up is worthwhile."""
    for where in (event.where, poses[-1:, :2]):
        low, high = where.min(axis=0), where.max(axis=0)
        extent = float((high - low).max()) + 2.0 * margin * background.radius
        window = background.window((low + high) / 2.0, extent)
        if CLOSE_UP / window.side >= _MIN_ZOOM * scale:
            return window
    return None


def _draw_window(chart: Chart, window: CloseUpWindow) -> None:
    x, y, side = window
    corners = np.array([(0, 0), (side, 0), (side, side), (0, side), (0, 0)])
    at = chart.at(corners + np.array([x, y]))
    for colour, width in ((FREE, 4), (EVENT, 2)):
        # Two lines, since one that ends where it begins would be simplified away.
        chart.canvas.line(at[:3], colour, width)
        chart.canvas.line(at[2:], colour, width)


def _close_up(chart: Chart, poses: Points, event: Event, radius: float) -> Image:
    """The framed close-up of the run around the event."""
    _draw_run(chart, poses, event, radius, show_path=True)
    close = chart.canvas.image[: chart.canvas.strip_top]
    cv2.rectangle(close, (0, 0), (close.shape[1] - 1, close.shape[0] - 1), EVENT, 2)
    return close


def _column(event: Event, close: Image | None) -> Image:
    """Caption, close-up and legend, one below the other."""
    lines = [line for fact in event.facts for line in textwrap.wrap(fact, _CHARACTERS)]
    legend = [
        (GREY, True, "shortest path"),
        (TRAIL, False, "driven, light to dark"),
    ]
    if event.way is not None:
        legend.append((GREEN, True, "shortest path from the end"))
    if event.contact is not None:
        legend.append((EVENT, False, "contact"))
    if len(event.movers):
        legend.append((MOVER, False, "movers, and their last second"))
    if event.axes is not None:
        legend.append((INK, False, "x and y at the start"))
    rows = len(lines) + len(legend) + 1
    tall = 0 if close is None else close.shape[0] + MARGIN
    column = blank(2 * MARGIN + _LINE * rows + 10 + tall, COLUMN, PAPER)
    at = MARGIN + 12
    write_text(column, MARGIN, at, event.title, EVENT)
    for line in lines:
        at += _LINE
        write_text(column, MARGIN, at, line, INK)
    at += MARGIN
    if close is not None:
        column[at : at + close.shape[0], MARGIN : MARGIN + close.shape[1]] = close
        at += close.shape[0]
    at += 10
    for colour, dashed, text in legend:
        at += _LINE
        _draw_key(column, at - 5, colour, dashed)
        write_text(column, MARGIN + 34, at, text, INK)
    return column


def _draw_key(column: Image, y: int, colour: Colour, dashed: bool) -> None:
    """Draws the line sample of a legend entry."""
    ends = ((0, 7), (10, 17), (20, 26)) if dashed else ((0, 26),)
    for first, last in ends:
        begin, end = (MARGIN + first, y), (MARGIN + last, y)
        cv2.line(column, begin, end, colour, 2, cv2.LINE_AA)
