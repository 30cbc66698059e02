"""Drawing primitives of the bundled maps: shapes and pens on a fine sheet.

A sheet is an RGB image `FINE` times finer than the map; `scan` downsamples it by
averaging, so edges are as soft as those of a scanned page. Points are (x, y), map px.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Noise = NDArray[np.float32]
Point = tuple[float, float]
Points = Sequence[Point]
Colour = tuple[int, int, int]
Area = tuple[float, float, float, float]
"""Left, top, right and bottom of a rectangle, px."""

FINE = 4
"""Sheet pixels per map pixel."""


def sheet(width: int, height: int, colour: Colour) -> Image:
    """An empty sheet for a map of `width` x `height` px."""
    return np.full((height * FINE, width * FINE, 3), colour, np.uint8)


def _fine(points: Points | NDArray[np.float64]) -> NDArray[np.int32]:
    """Map points as whole pixels of the sheet, shape (n, 2)."""
    scaled = (np.asarray(points, np.float64) + 0.5) * FINE - 0.5
    return np.round(scaled).astype(np.int32)


def polygon(page: Image, points: Points, colour: Colour) -> None:
    """Fills a polygon."""
    cv2.fillPoly(page, [_fine(points)], colour)


def box(page: Image, area: Area, colour: Colour) -> None:
    """Fills an upright rectangle."""
    left, top, right, bottom = area
    polygon(page, [(left, top), (right, top), (right, bottom), (left, bottom)], colour)


def disc(page: Image, centre: Point, radius: float, colour: Colour) -> None:
    """Fills a circle."""
    (x, y) = _fine([centre])[0]
    cv2.circle(page, (int(x), int(y)), round(radius * FINE), colour, -1)


def line(
    page: Image, points: Points, width: float, colour: Colour, *, closed: bool = False
) -> None:
    """Draws a polyline with round joints."""
    cv2.polylines(page, [_fine(points)], closed, colour, max(round(width * FINE), 1))


def wall(
    page: Image,
    ends: tuple[Point, Point],
    width: float,
    colour: Colour,
    doors: Sequence[tuple[float, float]] = (),
) -> None:
    """Draws a straight wall with square ends and doors left open.

    Args:
        page: Sheet, changed in place.
        ends: The wall's first and last point, px.
        width: Thickness, px.
        colour: RGB.
        doors: (from, to) of each opening, px from the first point.
    """
    (x0, y0), (x1, y1) = ends
    length = math.hypot(x1 - x0, y1 - y0)
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    half = width / 2
    edges = [-half, *(edge for door in doors for edge in door), length + half]
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        corners = [
            (x0 + ux * s - uy * t, y0 + uy * s + ux * t)
            for s, t in ((a, -half), (b, -half), (b, half), (a, half))
        ]
        polygon(page, corners, colour)


def arc(centre: Point, radius: float, first: float, last: float) -> list[Point]:
    """Points of a circular arc; angles in degrees, from +x towards +y (down)."""
    count = max(int(abs(last - first) * radius / 100), 8)
    angles = np.radians(np.linspace(first, last, count))
    x, y = centre
    return [(x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles]


def write(page: Image, text: str, middle: Point, size: float, colour: Colour) -> None:
    """Writes a label of `size` px cap height, centred on a point."""
    font, scale = cv2.FONT_HERSHEY_DUPLEX, size * FINE / 22
    stroke = max(round(scale), 1)
    (width, height), _ = cv2.getTextSize(text, font, scale, stroke)
    x, y = _fine([middle])[0]
    at = (int(x) - width // 2, int(y) + height // 2)
    cv2.putText(page, text, at, font, scale, colour, stroke, cv2.LINE_AA)


def smooth_noise(
    rng: np.random.Generator, width: int, height: int, scale: float
) -> Noise:
    """Noise of mean 0 and deviation about 1, smooth on a scale of `scale` px."""
    rows, columns = int(height / scale) + 3, int(width / scale) + 3
    coarse = rng.standard_normal((rows, columns)).astype(np.float32)
    size = (int(columns * scale), int(rows * scale))
    fine = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(fine[:height, :width] * np.float32(1.4))


def pen(
    page: Image,
    rng: np.random.Generator,
    points: Points,
    *,
    width: float,
    wobble: float,
    colour: Colour,
) -> None:
    """Draws one felt-pen stroke: unsteady, of uneven width.

    Args:
        page: Sheet, changed in place.
        rng: Source of the unsteadiness.
        points: Corners of the stroke, px.
        width: Mean width, px.
        wobble: Deviation of the stroke's line, px.
        colour: RGB.
    """
    corners = np.asarray(points, np.float64)
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(lengths)))
    at = np.arange(0.0, along[-1] + 0.4, 0.5)
    track = np.stack([np.interp(at, along, corners[:, k]) for k in (0, 1)], axis=1)
    sway = [smooth_noise(rng, len(at), 1, 70)[0] for _ in range(2)]
    track += wobble * np.stack(sway, axis=1)
    pressure = smooth_noise(rng, len(at), 1, 40)[0]
    grain = smooth_noise(rng, len(at), 1, 6)[0]
    radii = FINE * (0.5 * width * (1 + 0.1 * pressure) + 0.25 * grain)
    for (x, y), radius in zip(_fine(track), radii, strict=True):
        cv2.circle(page, (int(x), int(y)), max(round(radius), 2), colour, -1)


def scan(page: Image, rng: np.random.Generator, stains: float) -> Image:
    """The sheet at map size, with dust, and stains of `stains` grey levels."""
    height, width = page.shape[0] // FINE, page.shape[1] // FINE
    small = cv2.resize(page, (width, height), interpolation=cv2.INTER_AREA)
    # Quantising the shades along edges makes the largest files a quarter smaller.
    image = np.round(small.astype(np.float32) / 6) * 6
    image += np.round(stains * smooth_noise(rng, width, height, 90))[..., None]
    for _ in range(width * height // 1500):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        image[y, x] -= np.float32(rng.integers(6, 30))
    return np.clip(image, 0, 255).astype(np.uint8)
