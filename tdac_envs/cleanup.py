"""Cleaning a thresholded map: specks, holes, small gaps and thin drawn lines."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid import BoolGrid

_SQUARE = np.ones((3, 3), np.uint8)


def clean(cells: BoolGrid, strength: int) -> BoolGrid:
    """Removes noise, fills holes and closes hairline gaps.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        strength: Obstacle pieces (8-connected) and holes (free pieces, 4-connected)
            of fewer than this many pixels go; above 0 the obstacles are then closed
            with a 3 x 3 square. 0 changes nothing.
    """
    if strength <= 0:
        return cells.copy()
    kept = _without_small(cells, strength, connectivity=8)
    filled = ~_without_small(~kept, strength, connectivity=4)
    closed = cv2.morphologyEx(filled.astype(np.uint8), cv2.MORPH_CLOSE, _SQUARE)
    return np.asarray(closed > 0)


def _without_small(mask: BoolGrid, smallest: int, connectivity: int) -> BoolGrid:
    labels, stats = _pieces(mask, connectivity)
    keep = stats[:, cv2.CC_STAT_AREA] >= smallest
    keep[0] = False
    return np.asarray(keep[labels])


def _pieces(
    mask: BoolGrid, connectivity: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    found = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=connectivity
    )
    return np.asarray(found[1], np.int32), np.asarray(found[2], np.int32)


def without_specks(cells: BoolGrid, extent: int) -> BoolGrid:
    """Drops obstacle pieces within a box of `extent` px: noise, letters, dashes.

    Solid ones of 6 px and more stay, since they are pillars rather than letters.
    """
    labels, stats = _pieces(cells, 8)
    sides = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    filled = stats[:, cv2.CC_STAT_AREA] > 0.6 * sides.prod(axis=1)
    pillar = filled & (sides.min(axis=1) >= 6)
    keep = (sides.max(axis=1) > extent) | pillar
    keep[0] = False
    return np.asarray(keep[labels])


def without_lines(cells: BoolGrid, width: int) -> BoolGrid:
    """Drops obstacle strokes thinner than `width` px; thicker ones keep their shape."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    framed = np.pad(cells, width, mode="edge").astype(np.uint8)
    opened = cv2.morphologyEx(framed, cv2.MORPH_OPEN, kernel)
    regrown = (cv2.dilate(opened, kernel) > 0) & (framed > 0)
    return np.asarray(regrown[width:-width, width:-width])


def thick_share(cells: BoolGrid, width: int) -> float:
    """Share of the obstacle pixels in strokes at least `width` px thick."""
    occupied = int(cells.sum())
    return float(without_lines(cells, width).sum()) / occupied if occupied else 0.0
