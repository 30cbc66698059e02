"""Rulers around a picture of a map, in pixels or in metres of the map's frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import INK, WALL, Canvas, frame_scale, write_text
from tdac_envs.grid.map_units import MapUnits

Picture = NDArray[np.uint8]
Point = tuple[float, float]

TOP, RIGHT = 30, 14
_LEFT, _APART = 52, 70
"""Narrowest left margin, and smallest distance between numbered ticks, frame px."""


class Rulers:
    """The rulers of a map.

    Args:
        shape: Height and width of the map, px.
        units: Units of the rulers.

    Attributes:
        left: Width of the margin for the left ruler, frame px.
    """

    def __init__(self, shape: tuple[int, ...], units: MapUnits) -> None:
        self._units = units
        self._height, self._width = shape
        self._step = tick_step(frame_scale(self._width, self._height), units)
        yaw = 0.0 if units.frame is None else units.frame.origin[2]
        self._is_rotated = abs(math.remainder(yaw, 2 * math.pi)) > 1e-6
        corners = [
            units.coordinates(x, y)
            for x in (-0.5, self._width - 0.5)
            for y in (-0.5, self._height - 0.5)
        ]
        self._low, self._high = np.min(corners, axis=0), np.max(corners, axis=0)
        widest = max(
            Canvas.text_width(self._label(axis, k))
            for axis in (0, 1)
            for k in self._ticks(axis)
            if k % 5 == 0
        )
        self.left = max(_LEFT, widest + 13)

    def draw(self, canvas: Canvas, framed: Picture) -> None:
        """Draws ticks and numbers in the margins, and faint lines over the map.

        Args:
            canvas: The map.
            framed: The canvas's picture, moved by (`left`, `TOP`).
        """
        outline = ((-0.5, -0.5), (self._width - 0.5, self._height - 0.5))
        low, high = canvas.to_frame(outline)
        low, high = np.ceil(low), np.floor(high)
        taken: list[tuple[int, int, int]] = []
        for axis in (0, 1):
            for k in self._ticks(axis):
                ends = self._ends(axis, k)
                if ends is None or (k % 5 and self._is_rotated):
                    continue
                at = np.clip(np.rint(canvas.to_frame(ends)), low, high)
                pixels = at.astype(np.int64) + np.array([self.left, TOP])
                label = "" if k % 5 else self._label(axis, k)
                self._mark(framed, pixels, self.left + int(low[0]), label, taken)

    def _ticks(self, axis: int) -> range:
        """Indices of the ticks on the map, a fifth of a step apart."""
        low, high, minor = self._low[axis], self._high[axis], self._step / 5
        return range(math.ceil(low / minor - 1e-9), math.floor(high / minor + 1e-9) + 1)

    def _label(self, axis: int, k: int) -> str:
        number = f"{round(k * self._step / 5, 9):g}"
        return f"{'xy'[axis]} {number}" if self._is_rotated else number

    def _ends(self, axis: int, k: int) -> tuple[Point, Point] | None:
        """Both ends, in map px, of the line where a coordinate has a tick's value."""
        value = k * self._step / 5
        first, second = np.array(self._low), np.array(self._high)
        first[axis] = second[axis] = value
        begin, end = (np.array(self._units.pixels(tuple(p))) for p in (first, second))
        return _clipped(begin, end, self._width, self._height)

    def _mark(
        self,
        framed: Picture,
        ends: NDArray[np.int64],
        border: int,
        label: str,
        taken: list[tuple[int, int, int]],
    ) -> None:
        """Draws the tick of a line and, if it has a label, the label and the line.

        Args:
            framed: Where to draw.
            ends: Both ends of the line, frame px.
            border: Column of the left border of the map, frame px.
            label: The number, or an empty string.
            taken: Places of labels; the new one is added.
        """
        begin, end = ends
        across, down = np.abs(end - begin)
        is_top = bool(down > across)
        axis = 1 if is_top else 0
        at = min((begin, end), key=lambda point: int(point[axis]))
        if label:
            _draw_faintly(framed, begin, end)
        if at[axis] > (TOP if is_top else border) + 2:
            return
        size = 8 if label else 4
        if is_top:
            framed[TOP - size : TOP, at[0]] = INK
        else:
            framed[at[1], self.left - size : self.left] = INK
        if label:
            self._write(framed, label, at, is_top, taken)

    def _write(
        self,
        framed: Picture,
        label: str,
        at: NDArray[np.int64],
        is_top: bool,
        taken: list[tuple[int, int, int]],
    ) -> None:
        """Writes a number beside its tick, unless another number is there."""
        width = Canvas.text_width(label)
        x = at[0] - width // 2 if is_top else self.left - 11 - width
        baseline = TOP - 12 if is_top else at[1] + 5
        x = min(x, framed.shape[1] - width)
        if any(
            abs(y - baseline) < 14 and x < stop + 4 and begin - 4 < x + width
            for begin, stop, y in taken
        ):
            return
        taken.append((x, x + width, baseline))
        write_text(framed, x, baseline, label, INK)


def tick_step(scale: float, units: MapUnits) -> float:
    """Distance between numbered ticks, in the units; at least 70 frame px.

    Args:
        scale: Frame px per map px.
        units: Units of the rulers.
    """
    least = _APART / scale * units.per_pixel
    if units.frame is None:
        least = max(least, 5.0)
    power = 10.0 ** math.floor(math.log10(least))
    return next(f * power for f in (1, 2.5, 5, 10) if f * power >= least * (1 - 1e-9))


def _clipped(
    begin: NDArray[np.float64], end: NDArray[np.float64], width: int, height: int
) -> tuple[Point, Point] | None:
    """The part of a line on the map, in map px; None if there is none."""
    low, high = 0.0, 1.0
    for axis, size in ((0, width), (1, height)):
        span = end[axis] - begin[axis]
        limits = -0.5 - 1e-9 - begin[axis], size - 0.5 + 1e-9 - begin[axis]
        if abs(span) < 1e-9:
            if not limits[0] <= 0 <= limits[1]:
                return None
            continue
        first, last = sorted(limit / span for limit in limits)
        low, high = max(low, first), min(high, last)
    if low > high:
        return None
    (x0, y0), (x1, y1) = (begin + t * (end - begin) for t in (low, high))
    return (float(x0), float(y0)), (float(x1), float(y1))


def _draw_faintly(
    picture: Picture, begin: NDArray[np.int64], end: NDArray[np.int64]
) -> None:
    """Darkens the pixels of a line."""
    count = int(np.abs(end - begin).max()) + 1
    xs, ys = np.rint(np.linspace(begin, end, count)).astype(int).T
    picture[ys, xs] = np.rint(0.8 * picture[ys, xs] + 0.2 * np.array(WALL))
