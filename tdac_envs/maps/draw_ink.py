"""What the bundled maps are drawn with: a fine canvas, pens and paper.

Everything is drawn on a canvas `FINE` times finer than the map and averaged down,
so that edges are as soft as those of a scan. Points are (x, y) in map pixels.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Mask = NDArray[np.uint8]
Noise = NDArray[np.float32]
Points = Sequence[tuple[float, float]]
Colour = tuple[int, int, int]

FINE = 4
"""Canvas pixels per map pixel."""


def smooth_noise(
    rng: np.random.Generator, width: int, height: int, scale: float
) -> Noise:
    """Noise of mean 0 and deviation about 1 whose blots are `scale` px wide."""
    rows, columns = int(height / scale) + 3, int(width / scale) + 3
    coarse = rng.standard_normal((rows, columns)).astype(np.float32)
    size = (int(columns * scale), int(rows * scale))
    fine = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(fine[:height, :width] * np.float32(1.4))


def blank(width: int, height: int) -> Mask:
    """An empty fine mask for a map of `width` x `height` px."""
    return np.zeros((height * FINE, width * FINE), np.uint8)


def fine(points: Points | NDArray[np.float64]) -> NDArray[np.int32]:
    """Map points as whole pixels of the fine canvas, shape (n, 2)."""
    scaled = (np.asarray(points, np.float64) + 0.5) * FINE - 0.5
    return np.round(scaled).astype(np.int32)


def soften(mask: Mask) -> Noise:
    """Coverage of each map pixel by a fine mask, 0 to 1."""
    height, width = mask.shape
    size = (width // FINE, height // FINE)
    small = cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
    return small.astype(np.float32) / np.float32(255.0)


def lay(image: Noise, coverage: Noise, colour: Colour) -> None:
    """Lays an RGB colour over the image, in place, as far as `coverage` says."""
    alpha = coverage[..., None]
    image *= 1 - alpha
    image += alpha * np.array(colour, np.float32)


def pen(
    mask: Mask, rng: np.random.Generator, points: Points, width: float, wobble: float
) -> None:
    """Draws one felt-pen stroke into a fine mask: unsteady, of uneven width.

    Args:
        mask: Fine mask, changed in place.
        rng: Source of the unsteadiness.
        points: Corners of the stroke, px.
        width: Mean width, px.
        wobble: Deviation of the stroke's line, px.
    """
    corners = np.asarray(points, np.float64)
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.concatenate(([0.0], np.cumsum(lengths)))
    at = np.arange(0.0, along[-1] + 0.4, 0.5)
    line = np.stack([np.interp(at, along, corners[:, k]) for k in (0, 1)], axis=1)
    sway = [smooth_noise(rng, len(at), 1, 70)[0] for _ in range(2)]
    line += wobble * np.stack(sway, axis=1)
    pressure = smooth_noise(rng, len(at), 1, 40)[0]
    grain = smooth_noise(rng, len(at), 1, 6)[0]
    radii = FINE * (0.5 * width * (1 + 0.1 * pressure) + 0.25 * grain)
    for (x, y), radius in zip(fine(line), radii, strict=True):
        cv2.circle(mask, (int(x), int(y)), max(round(radius), 2), 255, -1)


def paper(
    rng: np.random.Generator, width: int, height: int, colour: Colour, blots: float
) -> Noise:
    """A sheet of scanned paper: faint blots `blots` grey levels deep, and specks."""
    sheet = np.empty((height, width, 3), np.float32)
    sheet[...] = colour
    stain = smooth_noise(rng, width, height, 90)
    sheet += np.round(blots * stain)[..., None]
    for _ in range(width * height // 1500):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        sheet[y, x] -= np.float32(rng.integers(6, 30))
    return sheet


def finish(image: Noise) -> Image:
    """The image as 8-bit RGB."""
    return np.clip(np.round(image), 0, 255).astype(np.uint8)
