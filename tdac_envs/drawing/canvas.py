"""A canvas for maps: takes map coordinates and draws anti-aliased frame pixels."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.grid.grid import BoolGrid

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]

FREE: Colour = (250, 249, 245)
WALL: Colour = (56, 65, 81)
PAPER: Colour = (236, 236, 231)
INK: Colour = (52, 58, 70)
GREY: Colour = (138, 145, 156)
TRAIL: Colour = (88, 72, 198)
GREEN: Colour = (14, 140, 92)
RED: Colour = (208, 38, 52)
AMBER: Colour = (196, 122, 0)
BLUE: Colour = (0, 128, 190)
ORANGE: Colour = (226, 124, 22)
MOVER: Colour = (176, 58, 120)

LARGEST = 1200
ENLARGE_TO = 900
NARROWEST = 320
TEXT_SIZE = 0.45
_HALF_DIGIT = 5  # Half the height of a digit, frame px.
_SHIFT = 4
# Points beyond are drawn here: OpenCV's coordinates are 32-bit integers.
_FARTHEST = 1 << 28
_ENTRIES_PER_PX = 8.0
_TEXT_ZOOM = 4


def frame_scale(width: int, height: int) -> float:
    """Frame pixels per map pixel: an integer for small maps, below 1 for huge ones."""
    longest = max(width, height)
    if longest > LARGEST:
        return LARGEST / longest
    return float(max(1, ENLARGE_TO // longest))


class Canvas:
    """A frame with the map on top and a strip for text below it.

    Points are (x, y) in map pixels; sizes (radii, widths, dashes) are in frame
    pixels, except where an argument says otherwise.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        strip: Height of the strip, frame px.
        scale: Frame pixels per map pixel; by default `frame_scale`.
        origin: Map pixel (x, y) of the first cell, for a part of a map.
        narrowest: Minimum width, frame px.

    Attributes:
        image: Shape (rows, columns, 3), uint8 RGB; both sides are even, as video
            codecs require.
        scale: Frame pixels per map pixel.
        strip_top: First row of the strip.
    """

    def __init__(
        self,
        cells: BoolGrid,
        strip: int = 30,
        *,
        scale: float | None = None,
        origin: tuple[int, int] = (0, 0),
        narrowest: int = NARROWEST,
    ) -> None:
        height, width = cells.shape
        self.scale = frame_scale(width, height) if scale is None else scale
        picture = _map_picture(cells, self.scale)
        rows, columns = picture.shape[:2]
        total = max(columns + columns % 2, narrowest)
        self._left = (total - columns) // 2
        self._origin = origin
        self.strip_top = rows
        strip += (rows + strip) % 2
        self.image: Image = blank(rows + strip, total, PAPER)
        if columns < total:
            self.image[:rows] = WALL
        self.image[:rows, self._left : self._left + columns] = picture

    @staticmethod
    def frame_width(cells: BoolGrid) -> int:
        """Width of the frame of a map, frame px."""
        height, width = cells.shape
        columns = max(1, round(width * frame_scale(width, height)))
        return int(max(columns + columns % 2, NARROWEST))

    @staticmethod
    def text_width(text: str) -> int:
        """Width of `text`, frame px."""
        return int(_text_mask(text).shape[1])

    def copy(self) -> Canvas:
        """An independent canvas with the same content."""
        twin = object.__new__(Canvas)
        twin.scale, twin._left, twin.strip_top = self.scale, self._left, self.strip_top
        twin._origin = self._origin
        twin.image = self.image.copy()
        return twin

    def to_frame(self, points: ArrayLike) -> NDArray[np.float64]:
        """Frame coordinates of map points, shape (n, 2); pixel centres are integers."""
        at = np.asarray(points, np.float64).reshape(-1, 2) - self._origin
        return (at + 0.5) * self.scale - 0.5 + (self._left, 0.0)

    def polygon(self, points: ArrayLike, colour: Colour, alpha: float = 1.0) -> None:
        """Fills a polygon."""
        at = self.to_frame(points)
        patch, origin = self._patch(at, 2)
        fixed = _fixed(at - origin)
        cv2.fillPoly(patch, [fixed], colour, cv2.LINE_AA, _SHIFT)
        self._blend(patch, origin, alpha)

    def line(
        self,
        points: ArrayLike,
        colour: Colour,
        width: int = 1,
        alpha: float = 1.0,
        dash: float = 0.0,
    ) -> None:
        """Draws a polyline; `dash` is the length of its dashes, 0 for a solid line."""
        at = self.to_frame(points)
        if len(at) >= 2:
            pieces = _dashes(at, dash) if dash else [at]
            self._lines(at, pieces, colour, width, alpha)

    def fan(
        self, centre: ArrayLike, tips: ArrayLike, colour: Colour, alpha: float
    ) -> None:
        """Draws one thin line from the centre to each tip."""
        at, hub = self.to_frame(tips), self.to_frame(centre)
        pieces = [np.vstack([hub, tip]) for tip in at]
        self._lines(np.vstack([hub, at]), pieces, colour, 1, alpha)

    def disc(
        self,
        centre: ArrayLike,
        radius: float,
        colour: Colour,
        alpha: float = 1.0,
        width: int = -1,
    ) -> None:
        """Draws a filled disc, or a circle of the given line width."""
        at = self.to_frame(centre)
        reach = radius + max(width, 0) / 2
        patch, origin = self._patch(np.vstack([at - reach, at + reach]), 2)
        turns = np.linspace(0, 2 * np.pi, round(np.clip(3 * reach, 24, 360)))
        circle = np.column_stack([np.cos(turns), np.sin(turns)])
        # Two outlines leave a hole; OpenCV's own thick circles are polygons.
        radii = [reach] if width < 0 else [reach, max(radius - width / 2, 0.0)]
        rims = [_fixed(at - origin + rim * circle) for rim in radii]
        cv2.fillPoly(patch, rims, colour, cv2.LINE_AA, _SHIFT)
        self._blend(patch, origin, alpha)

    def paste(
        self, centre: ArrayLike, heading: float, sprite: NDArray[np.float32]
    ) -> None:
        """Draws a picture, rotated by `heading`.

        Args:
            centre: Position of its centre.
            heading: rad, clockwise on the screen.
            sprite: Shape (n, n, 4): RGB premultiplied by alpha, and alpha in [0, 1];
                three times as large as it is drawn.
        """
        at = self.to_frame(centre)
        half = sprite.shape[0] / 3 * 0.75 + 2
        patch, origin = self._patch(np.vstack([at - half, at + half]), 0)
        rows, columns = patch.shape[:2]
        cos, sin = np.cos(heading), np.sin(heading)
        turn = np.array([[cos, -sin], [sin, cos]])
        middle = np.full(2, (sprite.shape[0] - 1) / 2)
        shift = (at[0] - origin) * 3 + 1 - turn @ middle
        matrix = np.column_stack([turn, shift])
        large = cv2.warpAffine(sprite, matrix, (3 * columns, 3 * rows))
        small = cv2.resize(large, (columns, rows), interpolation=cv2.INTER_AREA)
        mixed = small[..., :3] + patch * (1 - small[..., 3:])
        self._blend(np.clip(mixed + 0.5, 0, 255).astype(np.uint8), origin, 1.0)

    def text(self, x: int, baseline: int, text: str, colour: Colour) -> int:
        """Writes ASCII text at frame coordinates; returns the x at its end."""
        return write_text(self.image, x, baseline, text, colour)

    def label(self, centre: ArrayLike, text: str, colour: Colour) -> None:
        """Writes ASCII text around a point of the map, if there is room for it."""
        (x, y), width = self.to_frame(centre)[0].tolist(), self.text_width(text)
        left, baseline = round(x - width / 2), round(y) + _HALF_DIGIT
        fits = 0 <= left <= self.image.shape[1] - width
        if fits and 3 * _HALF_DIGIT <= baseline <= self.strip_top - _HALF_DIGIT:
            self.text(left, baseline, text, colour)

    def _lines(
        self,
        around: NDArray[np.float64],
        pieces: Iterable[NDArray[np.float64]],
        colour: Colour,
        width: int,
        alpha: float,
    ) -> None:
        patch, origin = self._patch(around, width + 2)
        # Many joints in a straight line would be visible as dots.
        fixed = [cv2.approxPolyDP(_fixed(p - origin), 4, False) for p in pieces]
        cv2.polylines(patch, fixed, False, colour, width, cv2.LINE_AA, _SHIFT)
        self._blend(patch, origin, alpha)

    def _patch(
        self, points: NDArray[np.float64], margin: float
    ) -> tuple[Image, NDArray[np.int64]]:
        """A copy of the map around some points, and its upper left corner (x, y)."""
        size = np.array([self.image.shape[1], self.strip_top])
        low = np.clip(np.floor(points.min(axis=0) - margin), 0, size - 1).astype(int)
        high = np.clip(np.ceil(points.max(axis=0) + margin) + 1, low + 1, size)
        stop = high.astype(int)
        return self.image[low[1] : stop[1], low[0] : stop[0]].copy(), low

    def _blend(self, patch: Image, origin: NDArray[np.int64], alpha: float) -> None:
        x, y = origin.tolist()
        target = self.image[y : y + patch.shape[0], x : x + patch.shape[1]]
        if alpha < 1.0:
            patch = np.asarray(cv2.addWeighted(patch, alpha, target, 1 - alpha, 0))
        target[...] = patch


def blank(rows: int, columns: int, colour: Colour) -> Image:
    """A picture of one colour."""
    picture = np.empty((rows, columns, 3), np.uint8)
    # Much faster than a broadcast over three channels.
    cv2.rectangle(picture, (0, 0), (columns, rows), colour, cv2.FILLED)
    return picture


def write_text(image: Image, x: int, baseline: int, text: str, colour: Colour) -> int:
    """Writes ASCII text on a picture; returns the x at its end."""
    mask = _text_mask(text)
    rows, columns = mask.shape
    top = baseline - round(rows * 0.7)
    target = image[max(top, 0) : top + rows, x : x + columns]
    cover = mask[max(-top, 0) :][: target.shape[0], : target.shape[1], None]
    target[...] = np.rint(target * (1 - cover) + np.array(colour) * cover)
    return int(x + columns)


def _fixed(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """OpenCV's fixed-point coordinates."""
    fixed = np.clip(np.rint(points * (1 << _SHIFT)), -_FARTHEST, _FARTHEST)
    return fixed.astype(np.int32)


def _map_picture(cells: BoolGrid, scale: float) -> Image:
    """A map in colour; the floor is slightly darker along the walls."""
    height, width = cells.shape
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    cover: NDArray[Any] = cells.view(np.uint8)
    if scale < 1.0:
        # The exponent keeps thin walls visible when the map is shrunk.
        cover = cv2.resize(255 * cover, size, interpolation=cv2.INTER_AREA)
        cover = (cover / np.float32(255)) ** 0.6
    elif scale > 1.0:
        cover = cv2.resize(cover, size, interpolation=cv2.INTER_NEAREST)
    floor = (cover < 0.5).astype(np.uint8)
    # Without any wall, what OpenCV returns depends on the number of its threads.
    distance: NDArray[Any] = np.full(floor.shape, 1e3, np.float32)
    if not floor.all():
        distance = cv2.distanceTransform(floor, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # A colour table, to draw a whole map within milliseconds.
    entries = cv2.convertScaleAbs(distance, alpha=_ENTRIES_PER_PX)
    picture: Any = cv2.applyColorMap(entries, _map_colours())
    partly = (cover > 0.0) & (cover < 1.0)
    if partly.any():
        share = cover[partly][:, None]
        shade = _map_colours()[np.maximum(entries[partly], 1), 0]
        picture[partly] = np.rint(share * np.array(WALL) + (1.0 - share) * shade)
    return np.asarray(picture, np.uint8)


def _map_colours() -> Image:
    """Colours by distance to the nearest wall, shape (256, 1, 3); entry 0 is a wall."""
    distance = np.arange(256) / _ENTRIES_PER_PX
    shade = 1.0 - 0.10 * np.exp(-distance / 5.0)
    colours = np.rint(shade[:, None] * np.array(FREE)).astype(np.uint8)
    colours[0] = WALL
    return np.asarray(colours[:, None], np.uint8)


def _dashes(points: NDArray[np.float64], dash: float) -> list[NDArray[np.float64]]:
    """Cuts a polyline into dashes with gaps of the same length."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    begins = np.arange(0.0, along[-1], 2 * dash)
    ends = np.minimum(begins + dash, along[-1])
    stops = np.unique(np.concatenate([along, begins, ends]))
    cut = np.column_stack([np.interp(stops, along, points[:, k]) for k in (0, 1)])
    first, last = np.searchsorted(stops, begins), np.searchsorted(stops, ends)
    return [cut[i : j + 1] for i, j in zip(first, last, strict=True)]


def _text_mask(text: str) -> NDArray[np.float32]:
    """Coverage of a text, drawn large and shrunk: OpenCV's small text is coarse."""
    zoom = TEXT_SIZE * _TEXT_ZOOM
    font, weight = cv2.FONT_HERSHEY_SIMPLEX, max(1, round(1.6 * zoom))
    (width, height), _ = cv2.getTextSize(text, font, zoom, weight)
    rows = (round(height * 1.8) // _TEXT_ZOOM + 1) * _TEXT_ZOOM
    columns = (width // _TEXT_ZOOM + 2) * _TEXT_ZOOM
    large = np.zeros((rows, columns), np.uint8)
    origin = (_TEXT_ZOOM // 2, round(rows * 0.7))
    cv2.putText(large, text, origin, font, zoom, 255, weight, cv2.LINE_AA)
    small = (columns // _TEXT_ZOOM, rows // _TEXT_ZOOM)
    mask = cv2.resize(large, small, interpolation=cv2.INTER_AREA)
    return np.asarray(mask / np.float32(255), np.float32)
