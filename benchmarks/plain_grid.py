"""A straightforward Algorithm 1 with OpenCV and scikit-image, for comparison."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.graph import MCP_Geometric

Mask = NDArray[np.bool_]
Point = tuple[int, int]


def best_score(picture: Any, start: Point, goal: Point, radius: float) -> float:
    """Score of the best of the 40 candidates; -inf if none is feasible."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    best = -np.inf
    for kind in (cv2.THRESH_BINARY_INV, cv2.THRESH_BINARY):
        base = cv2.threshold(grey, 0, 1, kind | cv2.THRESH_OTSU)[1] > 0
        for strength in (0, 4, 8, 12, 16):
            cells = _cleaned(base, strength)
            for inflation in (0, 1, 2, 3):
                body = radius + inflation
                best = max(best, _score(cells, start, goal, body))
    return float(best)


def _cleaned(cells: Mask, strength: int) -> Mask:
    kept = _without_small(cells, strength, 8)
    filled = ~_without_small(~kept, strength, 4)
    kernel = np.ones((3, 3), np.uint8)
    return cv2.morphologyEx(filled.astype(np.uint8), cv2.MORPH_CLOSE, kernel) > 0


def _without_small(mask: Mask, smallest: int, connectivity: int) -> Mask:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=connectivity
    )
    keep = stats[:, cv2.CC_STAT_AREA] >= smallest
    keep[0] = False
    return np.asarray(keep[labels])


def _score(cells: Mask, start: Point, goal: Point, radius: float) -> float:
    size = 2 * int(np.ceil(radius)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    free = cv2.dilate(cells.astype(np.uint8), disc) == 0
    if not (free[start[::-1]] and free[goal[::-1]]):
        return -np.inf
    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    if labels[start[::-1]] != labels[goal[::-1]]:
        return -np.inf
    search = MCP_Geometric(np.where(free, 1.0, -1.0))
    costs, _ = search.find_costs([start[::-1]], [goal[::-1]])
    rows, columns = np.array(search.traceback(goal[::-1])).T
    clear = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, 5)
    flips = (cells[1:] != cells[:-1]).sum() + (cells[:, 1:] != cells[:, :-1]).sum()
    near, length = clear[rows, columns].min(), costs[goal[::-1]]
    return float(2.5 * near - 0.02 * length - 1.2 * flips / cells.size)
