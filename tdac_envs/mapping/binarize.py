"""Classifies pixels: light, saturated, unknown, outside, unlike the floor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.image import ColourImage, GreyImage

MARK_CHROMA = 80
"""Chroma (largest minus smallest RGB value) from which a pixel is saturated."""


def otsu(luminance: GreyImage) -> float:
    """Otsu's threshold: pixels above it are light.

    In an empty stretch of the histogram it is the middle of the stretch, and of two
    equally good thresholds the one farther from middle grey, so that a picture and its
    negative are cut at the same level.
    """
    cuts = _first_cut(luminance), 254 - _first_cut(255 - luminance)
    return max(cuts, key=lambda cut: abs(cut - 127))


def _first_cut(luminance: GreyImage) -> float:
    """The lowest of the best thresholds, in the middle of its stretch."""
    low = int(cv2.threshold(luminance, 0, 255, cv2.THRESH_OTSU)[0])
    counts = np.bincount(luminance.ravel(), minlength=256)
    high = low
    while high < 254 and counts[high + 1] == 0:
        high += 1
    return (low + high) / 2


def saved_level(luminance: GreyImage) -> int | None:
    """The "unknown" grey of a picture with only the levels of ROS `map_saver`, or None.

    These are 254 free, 205 unknown and 0 occupied; in a negative 1, 50 and 255. The
    known area may be small.
    """
    share = np.bincount(luminance.ravel(), minlength=256) / luminance.size
    for unknown, free, occupied in ((205, (254, 255), 0), (50, (1, 0), 255)):
        seen = share[list(free)].sum()
        known = seen + share[occupied]
        if seen > 0 and share[unknown] > 0.01 and known + share[unknown] > 0.98:
            return unknown if share[occupied] > 0 or share[free[0]] > 0 else None
    return None


def unknown_level(luminance: GreyImage) -> int | None:
    """The grey that a mapping tool wrote for "unknown", or None.

    It is about 205 (ROS `map_saver`) or 128; in a negative 50 or 127. It counts only if
    many pixels have exactly this level and there are black and white pixels, too.
    """
    share = np.bincount(luminance.ravel(), minlength=256) / luminance.size
    written = saved_level(luminance)
    if written is not None:
        return written
    if min(share[:20].sum(), share[-20:].sum()) < 0.001:
        return None
    # Walls are often of a grey near 128, so this level must cover a larger area.
    for pair, least in (((205, 50), 0.01), ((128, 127), 0.12)):
        levels = [_commonest_near(share, usual) for usual in pair]
        found = [
            level
            for level in levels
            if share[level] >= max(least, 0.8 * share[level - 6 : level + 7].sum())
        ]
        if found:
            return max(found, key=lambda level: float(share[level]))
    return None


def _commonest_near(share: NDArray[np.float64], usual: int) -> int:
    """The commonest level within 2 of a usual one."""
    return usual - 2 + int(np.argmax(share[usual - 2 : usual + 3]))


def outside(luminance: GreyImage, light_free: bool, ignored: BoolGrid) -> BoolGrid:
    """The paper around a plan: the area connected to the border without crossing lines.

    Half the contrast of Otsu's threshold is enough for a line, so that windows drawn in
    grey count as lines.

    Args:
        luminance: Shape (height, width), uint8.
        light_free: Whether the paper is light.
        ignored: Shape (height, width), bool; pixels that are not lines, e.g. marks.

    Returns:
        Shape (height, width), bool; all False if no connected piece covers half of the
        border.
    """
    grey = luminance if light_free else 255 - luminance
    cut = otsu(grey)
    paper = int(np.bincount(grey[grey > cut], minlength=256).argmax())
    free = (grey > paper - 0.5 * (paper - cut)) | ignored
    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    rim = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    on_rim = np.bincount(rim)
    on_rim[0] = 0
    largest = int(on_rim.argmax())
    if on_rim[largest] < 0.5 * rim.size:
        return np.zeros(labels.shape, np.bool_)
    return np.asarray(labels == largest)


def chroma(colour: ColourImage) -> GreyImage:
    """Largest minus smallest of red, green and blue."""
    red, green, blue = colour[..., 0], colour[..., 1], colour[..., 2]
    largest = np.maximum(np.maximum(red, green), blue)
    return np.asarray(largest - np.minimum(np.minimum(red, green), blue))


def saturated(colour: ColourImage) -> BoolGrid:
    """Pixels of strong colour, where marks and coloured lines are drawn."""
    return np.asarray(chroma(colour) >= MARK_CHROMA)


def disc(shape: tuple[int, ...], x: float, y: float, radius: float) -> BoolGrid:
    """Pixels within `radius` px of (x, y), always including that pixel."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    within = (columns - x) ** 2 + (rows - y) ** 2 <= max(radius, 0.71) ** 2
    return np.asarray(within)


def floor_distance(colour: ColourImage, floor: NDArray[np.float64]) -> GreyImage:
    """RGB distance of each pixel from the floor's colour, clipped to 255."""
    gap = colour.astype(np.float32) - floor.astype(np.float32)
    distance = np.rint(np.linalg.norm(gap, axis=2))
    return np.asarray(np.clip(distance, 0, 255), np.uint8)
