"""Readings of a picture: which pixels are dark, marked, unknown or unlike the floor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid import BoolGrid
from tdac_envs.image import ColourImage, GreyImage

MARK_CHROMA = 80
"""Largest minus smallest RGB value from which a pixel counts as saturated colour."""


def otsu(luminance: GreyImage) -> float:
    """Otsu's threshold: pixels above it are light.

    It lies in the middle of the empty stretch of the histogram where there is one,
    so that a picture and its negative are cut at the same place.
    """
    low = int(cv2.threshold(luminance, 0, 255, cv2.THRESH_OTSU)[0])
    counts = np.bincount(luminance.ravel(), minlength=256)
    high = low
    while high < 254 and counts[high + 1] == 0:
        high += 1
    return (low + high) / 2


def unknown_level(luminance: GreyImage) -> int | None:
    """The grey that a mapping tool wrote for "not seen", or None.

    Map savers write 205 (ROS `map_saver`) or 127..128 between black and white; a
    negative has 50. It counts only as one exact, large, flat level between the two.
    """
    share = np.bincount(luminance.ravel(), minlength=256) / luminance.size
    if min(share[:20].sum(), share[-20:].sum()) < 0.002:
        return None
    for level in (205, 50, 128, 127):
        around = share[level - 3 : level + 4].sum()
        if share[level] >= 0.01 and share[level] > 0.8 * around:
            return level
    return None


def saturated(colour: ColourImage) -> BoolGrid:
    """Pixels of strong colour, where marks and coloured lines are drawn."""
    chroma = colour.max(axis=2).astype(np.int16) - colour.min(axis=2)
    return np.asarray(chroma >= MARK_CHROMA)


def local_light(luminance: GreyImage, window: int) -> BoolGrid:
    """Pixels lighter than their surroundings say; for uneven lighting.

    The paper's brightness is estimated as the closing (light paper) of the picture
    and divided out.

    Args:
        luminance: Shape (height, width), uint8.
        window: Side of the surroundings, px; wider than any wall.
    """
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (window, window))
    paper = cv2.morphologyEx(luminance, cv2.MORPH_CLOSE, kernel)
    paper = cv2.GaussianBlur(paper, (0, 0), window / 2).astype(np.float32)
    even = np.clip(luminance * (255.0 / np.maximum(paper, 1.0)), 0, 255)
    levels = np.rint(even).astype(np.uint8)
    return np.asarray(levels > otsu(levels))


def disc(shape: tuple[int, ...], x: float, y: float, radius: float) -> BoolGrid:
    """Pixels within `radius` px of (x, y), at least the pixel itself."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    within = (columns - x) ** 2 + (rows - y) ** 2 <= max(radius, 0.71) ** 2
    return np.asarray(within)


def floor_distance(colour: ColourImage, floor: NDArray[np.float64]) -> GreyImage:
    """How unlike the floor each pixel is: RGB distance, clipped to 255."""
    gap = colour.astype(np.float32) - floor.astype(np.float32)
    return np.clip(np.rint(np.linalg.norm(gap, axis=2)), 0, 255).astype(np.uint8)
