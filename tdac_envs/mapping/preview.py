"""Draws the preview of a preprocessed map."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import (
    FREE,
    GREEN,
    GREY,
    INK,
    PAPER,
    TRAIL,
    WALL,
    Canvas,
    Colour,
)
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.image import ColourImage
from tdac_envs.mapping.params import MapParams

Picture = NDArray[np.uint8]
Path = NDArray[np.float64]

_FREE_TINT: Colour = (150, 214, 178)
_WALL_TINT: Colour = (196, 84, 76)
_LEFT, _TOP, _RIGHT, _ROW = 52, 30, 14, 22


def draw_preview(
    source: ColourImage, cells: BoolGrid, params: MapParams, path: Path
) -> Picture:
    """The tinted source image with task, legend and rulers, uint8 RGB.

    Args:
        source: Shape (height, width, 3), uint8 RGB, as read.
        cells: Shape (height, width), bool, True = occupied.
        params: The parameters that preprocessing chose.
        path: Shape (n, 2), the shortest path for the body; may be empty.
    """
    lines = _lines(params)
    floor = (_shade(source, ~cells, _FREE_TINT), "free")
    solid = (_shade(source, cells, _WALL_TINT), "obstacle")
    legend = [row for row in ([floor, solid], _places(params)) if row]
    canvas = Canvas(cells, strip=12 + _ROW * (len(legend) + len(lines)))
    _lay_source(canvas, source, cells)
    _draw_task(canvas, params, path)
    map_rows = canvas.strip_top
    origin = np.ceil(canvas.to_frame((-0.5, -0.5))[0]).astype(int)
    canvas.image = _framed(canvas.image)
    _rulers(canvas, cells.shape, origin, map_rows)
    baseline = _TOP + map_rows + 24
    for entries in legend:
        _draw_entries(canvas, baseline, entries)
        baseline += _ROW
    for line in lines:
        canvas.text(_LEFT, baseline, line, GREY)
        baseline += _ROW
    return canvas.image


def _lay_source(canvas: Canvas, source: ColourImage, cells: BoolGrid) -> None:
    """Replaces the map on the canvas by the faded and tinted source."""
    height, width = cells.shape
    size = (round(width * canvas.scale), round(height * canvas.scale))
    method = cv2.INTER_AREA if canvas.scale < 1 else cv2.INTER_NEAREST
    picture = cv2.resize(source, size, interpolation=method).astype(np.float32)
    wall = cv2.resize(cells.astype(np.float32), size, interpolation=method)[..., None]
    tint = wall * np.array(_WALL_TINT) + (1 - wall) * np.array(_FREE_TINT)
    mixed = _mixed(picture, tint)
    left = int(np.ceil(canvas.to_frame((-0.5, -0.5))[0][0]))
    canvas.image[: size[1], left : left + size[0]] = mixed


def _draw_task(canvas: Canvas, params: MapParams, path: Path) -> None:
    body = max(params.robot.radius * canvas.scale, 4.0)
    if len(path) > 1:
        canvas.line(path, FREE, 5, 0.8)
        canvas.line(path, TRAIL, 2)
    if params.start is not None:
        turn = np.array([np.cos(params.heading), np.sin(params.heading)])
        nose = np.array(params.start) + turn * body / canvas.scale
        canvas.disc(params.start, body, TRAIL, 0.85)
        canvas.disc(params.start, body, FREE, width=2)
        canvas.line(np.array([params.start, nose]), FREE, 2)
    if params.goal is not None:
        canvas.disc(params.goal, body, GREEN, 0.35)
        canvas.disc(params.goal, body, GREEN, width=2)
        canvas.disc(params.goal, 4, GREEN)


def _framed(image: Picture) -> Picture:
    """The picture with a margin for the rulers."""
    rows, columns = image.shape[:2]
    framed = np.empty((rows + _TOP, columns + _LEFT + _RIGHT, 3), np.uint8)
    framed[...] = PAPER
    framed[_TOP:, _LEFT : _LEFT + columns] = image
    return framed


def _rulers(
    canvas: Canvas, shape: tuple[int, ...], origin: NDArray[np.int64], map_rows: int
) -> None:
    """Ticks with pixel numbers along the top and the left, and faint grid lines."""
    height, width = shape
    step = _tick_step(canvas.scale)
    image = canvas.image
    for value in range(0, width, step // 5):
        x = _LEFT + int(origin[0] + (value + 0.5) * canvas.scale)
        long = value % step == 0
        image[_TOP - (8 if long else 4) : _TOP, x] = INK
        if long:
            _faint(image[_TOP : _TOP + map_rows, x])
            label = str(value)
            canvas.text(x - canvas.text_width(label) // 2, _TOP - 12, label, INK)
    for value in range(0, height, step // 5):
        y = _TOP + int(origin[1] + (value + 0.5) * canvas.scale)
        long = value % step == 0
        image[y, _LEFT - (8 if long else 4) : _LEFT] = INK
        if long:
            _faint(image[y, _LEFT : _LEFT + round(width * canvas.scale) + origin[0]])
            label = str(value)
            canvas.text(_LEFT - 11 - canvas.text_width(label), y + 5, label, INK)


def _faint(line: Picture) -> None:
    line[...] = np.rint(0.8 * line + 0.2 * np.array(WALL)).astype(np.uint8)


def _tick_step(scale: float) -> int:
    """Distance between numbered ticks, map px; at least 70 frame px."""
    for step in (5, 10, 25, 50, 100, 250, 500, 1000, 2500):
        if step * scale >= 70:
            return step
    return 5000


def _mixed(picture: NDArray[Any], tint: NDArray[Any]) -> Picture:
    return np.asarray(np.rint(0.55 * picture + 0.45 * tint), np.uint8)


def _shade(source: ColourImage, chosen: BoolGrid, tint: Colour) -> Colour:
    """The average colour of the chosen pixels after tinting."""
    colour = np.array(cv2.mean(source, chosen.astype(np.uint8))[:3])
    red, green, blue = _mixed(colour, np.array(tint)).tolist()
    return red, green, blue


def _places(params: MapParams) -> list[tuple[Colour, str]]:
    """Legend entries of start, goal and path, each if it is given."""
    entries: list[tuple[Colour, str]] = []
    if params.start is not None:
        entries.append((TRAIL, f"start {_text(params.start)}"))
    if params.goal is not None:
        entries.append((GREEN, f"goal {_text(params.goal)}"))
    if params.score_terms is not None and params.score_terms.path_length:
        entries.append((TRAIL, f"path {params.score_terms.path_length:.0f} px"))
    return entries


def _draw_entries(
    canvas: Canvas, baseline: int, entries: list[tuple[Colour, str]]
) -> None:
    x = _LEFT
    for colour, label in entries:
        top = 6 if label.startswith("path") else 10
        canvas.image[baseline - top : baseline + 1 - (10 - top), x : x + 14] = colour
        x = canvas.text(x + 20, baseline, label, INK) + 14


def _lines(params: MapParams) -> list[str]:
    """Lines of text below the legend."""
    size = f"{params.source}: {params.width} x {params.height} px"
    if params.resolution is not None:
        size += f", {params.resolution:g} m per px"
    shade = "" if params.polarity == "given" else f"{params.polarity} "
    return [size, f"{shade}obstacles: {params.method}"]


def _text(point: tuple[float, float]) -> str:
    return f"({point[0]:g}, {point[1]:g})"
