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
    RED,
    TRAIL,
    Canvas,
    Colour,
)
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.plan import path_length
from tdac_envs.mapping.binarize import otsu, saturated
from tdac_envs.mapping.fault import MapFault
from tdac_envs.mapping.image import ColourImage, MapImage, luminance
from tdac_envs.mapping.params import MapParams
from tdac_envs.mapping.readings import unknown_grey
from tdac_envs.mapping.rulers import RIGHT, TOP, Rulers
from tdac_envs.mapping.wording import OUTSIDE_CLOSED, obstacles_text

Picture = NDArray[np.uint8]
Path = NDArray[np.float64]
Classes = NDArray[np.uint8]
Entry = tuple[Colour, str]

_NAMES = (
    *("free", "obstacle", "unknown, not free", "outside of the plan, not free"),
    *("reach of the start", "reach of the goal"),
)
_OPEN, _SOLID, _UNKNOWN, _OUTSIDE, _START_SIDE, _GOAL_SIDE = range(6)
_TINTS: tuple[Colour, ...] = (
    *((150, 200, 240), (222, 120, 30), (110, 110, 110), (222, 120, 30)),
    *((166, 148, 240), (240, 208, 96)),
)
_ROW = 22


def draw_preview(
    image: MapImage,
    cells: BoolGrid,
    params: MapParams,
    path: tuple[str, Path],
    units: MapUnits = PIXELS,
    fault: MapFault | None = None,
    reason: str = "",
    tolerance: float | None = None,
) -> Picture:
    """The tinted source image with task, legend and rulers, uint8 RGB.

    Args:
        image: The map as read.
        cells: Shape (height, width), bool, True = occupied.
        params: The parameters that preprocessing chose.
        path: Name of the path for the body, and its points, shape (n, 2), px.
        units: Units of rulers and legend.
        fault: Where the task fails, if it does.
        reason: Why it fails.
        tolerance: Distance at which the goal is reached, px.
    """
    classes = _classes(image, cells, params, fault)
    rulers = Rulers(cells.shape, units)
    room = Canvas.frame_width(cells)
    kinds = [
        (_shade(image.colour, classes == kind, _TINTS[kind]), _NAMES[kind])
        for kind in range(len(_NAMES))
        if kind in (_OPEN, _SOLID) or (classes == kind).any()
    ]
    legend = _in_rows(kinds, room) + _in_rows(
        _places(params, path, units, fault, tolerance), room
    )
    lines = [
        row for text in _texts(params, units, reason) for row in _folded(text, room)
    ]
    canvas = Canvas(cells, strip=12 + _ROW * (len(legend) + len(lines)))
    _lay_source(canvas, image.colour, classes)
    _draw_task(canvas, params, path[1])
    if fault is not None:
        _draw_fault(canvas, fault)
    framed = _framed(canvas.image, rulers.left)
    rulers.draw(canvas, framed)
    canvas.image = framed
    baseline = TOP + canvas.strip_top + 24
    for entries in legend:
        _draw_entries(canvas, rulers.left, baseline, entries)
        baseline += _ROW
    for line in lines:
        canvas.text(rulers.left, baseline, line, GREY)
        baseline += _ROW
    return canvas.image


def _classes(
    image: MapImage, cells: BoolGrid, params: MapParams, fault: MapFault | None
) -> Classes:
    """What each pixel is: an index of `_NAMES`, shape (height, width)."""
    classes = cells.astype(np.uint8)
    unknown = image.unknown
    level = unknown_grey(params.method)
    if level is not None:
        unknown = np.abs(luminance(image.colour).astype(np.int16) - level) <= 3
    if unknown is not None:
        classes[unknown & cells] = _UNKNOWN
    if OUTSIDE_CLOSED in params.method:
        classes[_like_floor(image, params) & (classes == _SOLID)] = _OUTSIDE
    if fault is not None:
        classes[fault.goal_side] = _GOAL_SIDE
        classes[fault.start_side] = _START_SIDE
    return classes


def _like_floor(image: MapImage, params: MapParams) -> BoolGrid:
    """The pixels that are free within the plan: of the lighter side, if walls are dark.

    Walls in a strong light colour are not among them.
    """
    shade = luminance(image.colour)
    threshold = otsu(shade) if params.threshold is None else params.threshold
    light = shade > threshold
    floor = light if params.polarity == "dark" else ~light
    return np.asarray(floor & ~saturated(image.colour))


def _lay_source(canvas: Canvas, source: ColourImage, classes: Classes) -> None:
    """Replaces the map on the canvas by the faded and tinted source."""
    height, width = classes.shape
    size = (round(width * canvas.scale), round(height * canvas.scale))
    method = cv2.INTER_AREA if canvas.scale < 1 else cv2.INTER_NEAREST
    picture = cv2.resize(source, size, interpolation=method).astype(np.float32)
    tints = np.array(_TINTS, np.uint8)[classes]
    tint = cv2.resize(tints, size, interpolation=method).astype(np.float32)
    left = int(np.ceil(canvas.to_frame((-0.5, -0.5))[0][0]))
    canvas.image[: size[1], left : left + size[0]] = _mixed(picture, tint)


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


def _draw_fault(canvas: Canvas, fault: MapFault) -> None:
    """Rings the place where the task fails, and points to a better one."""
    if fault.better is not None:
        way = np.array([fault.at, fault.better])
        for width, ink in ((5, FREE), (2, RED)):
            canvas.line(way, ink, width, dash=6)
            canvas.disc(fault.better, 4, ink, width=width)
    for width, ink in ((7, FREE), (3, RED)):
        canvas.disc(fault.at, 18, ink, width=width)


def _framed(image: Picture, left: int) -> Picture:
    """The picture with a margin for the rulers."""
    rows, columns = image.shape[:2]
    framed = np.empty((rows + TOP, columns + left + RIGHT, 3), np.uint8)
    framed[...] = PAPER
    framed[TOP:, left : left + columns] = image
    return framed


def _mixed(picture: NDArray[Any], tint: NDArray[Any]) -> Picture:
    return np.asarray(np.rint(0.55 * picture + 0.45 * tint), np.uint8)


def _shade(source: ColourImage, chosen: BoolGrid, tint: Colour) -> Colour:
    """The average colour of the chosen pixels after tinting."""
    colour = np.array(cv2.mean(source, chosen.astype(np.uint8))[:3])
    red, green, blue = _mixed(colour, np.array(tint)).tolist()
    return red, green, blue


def _places(
    params: MapParams,
    path: tuple[str, Path],
    units: MapUnits,
    fault: MapFault | None,
    tolerance: float | None,
) -> list[Entry]:
    """Legend entries of start, goal, path and fault, each if there is one."""
    entries: list[Entry] = []
    if params.start is not None:
        entries.append((TRAIL, f"start {units.point(*params.start)}"))
    if params.goal is not None:
        text = f"goal {units.point(*params.goal)}"
        if tolerance is not None:
            many = tolerance / params.robot.radius
            text += f" within {units.length(tolerance)} ({many:.1f} radii)"
        entries.append((GREEN, text))
    name, points = path
    if len(points) > 1:
        length = units.length(path_length(points), 0)
        entries.append((TRAIL, f"{name} {length}"))
    if fault is not None:
        entries.append((RED, fault.label))
    if fault is not None and fault.better is not None:
        entries.append((RED, f"nearest free place {units.point(*fault.better)}"))
    return entries


def _in_rows(entries: list[Entry], room: int) -> list[list[Entry]]:
    """The entries in rows that are at most `room` frame px wide."""
    rows: list[list[Entry]] = []
    used = room
    for entry in entries:
        width = 34 + Canvas.text_width(entry[1])
        if used + width > room:
            rows.append([])
            used = 0
        rows[-1].append(entry)
        used += width
    return rows


def _folded(text: str, room: int) -> list[str]:
    """The text in lines that are at most `room` frame px wide, if its words are."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and Canvas.text_width(longer) <= room:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _draw_entries(
    canvas: Canvas, left: int, baseline: int, entries: list[Entry]
) -> None:
    x = left
    for colour, label in entries:
        top = 6 if " path " in label else 10
        canvas.image[baseline - top : baseline + 1 - (10 - top), x : x + 14] = colour
        x = canvas.text(x + 20, baseline, label, INK) + 14


def _texts(params: MapParams, units: MapUnits, reason: str) -> list[str]:
    """Texts below the legend."""
    size = f"{params.source}: {params.width} x {params.height} px"
    if params.resolution is not None:
        size += f", {params.resolution:g} m per px"
    if units != PIXELS:
        size += "; rulers: m in the map's frame"
    texts = [size, obstacles_text(params)]
    return [*texts, f"refused: {reason}"] if reason else texts
