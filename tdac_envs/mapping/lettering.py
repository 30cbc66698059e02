"""Words drawn over a place on a map, such as `S` or `START` over the start."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.grid.grid import BoolGrid

Boxes = NDArray[np.int64]

HIGHEST, WIDEST, ALONE = 0.12, 0.3, 0.08
"""Largest height and width of a letter or of touching letters, and largest size of a
word of one letter, as shares of the map's shorter side."""
_SOLID, _HOLLOW = 0.75, 0.62
"""A piece that fills more of its box, or whose hole does, is not a letter."""
_GAP = 0.6
"""Largest gap between the letters of a word, as a share of their height."""


def without_lettering(
    cells: BoolGrid, places: Sequence[tuple[int, int]]
) -> BoolGrid | None:
    """Removes the words that cover any of the places.

    Letters are separate obstacle pieces that consist of a few strokes: neither solid
    like pillars, nor frames around an empty box. Adjacent letters of similar size form
    a word. A word covers the places in its box. Straight bars alone are not a word.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        places: Pixels (x, y).

    Returns:
        Shape (height, width), bool; None if no word covers a place.
    """
    found = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=8)
    labels, stats = np.asarray(found[1], np.int32), np.asarray(found[2], np.int64)
    sides = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    small = (sides <= np.multiply((WIDEST, HIGHEST), min(cells.shape))).all(axis=1)
    small &= sides.max(axis=1) >= 5
    small[0] = False
    numbers = np.flatnonzero(small)
    corners = stats[numbers][:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]]
    boxes = np.hstack([corners, corners + sides[numbers]])
    chosen = np.zeros(len(stats), np.bool_)
    for place in places:
        word = _word_over(labels, numbers, boxes, place)
        filled = stats[word, cv2.CC_STAT_AREA] > _SOLID * sides[word].prod(axis=1)
        largest = sides[word].max(initial=0)
        if len(word) > 1 or largest <= ALONE * min(cells.shape):
            chosen[word] = not filled.all()
    return cells & ~chosen[labels] if chosen.any() else None


def _word_over(
    labels: NDArray[np.int32],
    numbers: NDArray[np.int64],
    boxes: Boxes,
    place: tuple[int, int],
) -> NDArray[np.int64]:
    """The labels of the letters of the word over a place; empty if there is none."""
    heights = (boxes[:, 3] - boxes[:, 1]).astype(np.float64)
    point = np.array([*place, place[0] + 1, place[1] + 1])
    begun = _gaps(boxes, point) <= _GAP * heights
    members = [
        k
        for k in np.flatnonzero(begun).tolist()
        if _is_letter(labels, numbers[k], boxes[k])
    ]
    for k in members:  # the loop extends the list
        size = heights[k]
        like = (heights >= 0.5 * size) & (heights <= 2 * size)
        near = _gaps(boxes, boxes[k]) <= _GAP * np.maximum(heights, size)
        members += [
            other
            for other in np.flatnonzero(like & near).tolist()
            if other not in members and _is_letter(labels, numbers[other], boxes[other])
        ]
    if not members:
        return numbers[:0]
    word = boxes[members]
    low, high = word[:, :2].min(axis=0), word[:, 2:].max(axis=0)
    covers = bool((low <= place).all() and (place < high).all())
    return numbers[members] if covers else numbers[:0]


def _gaps(boxes: Boxes, box: NDArray[np.int64]) -> NDArray[np.int64]:
    """Distance of each box from one box, px, along the axis of the larger gap."""
    before, after = boxes[:, :2] - box[2:], box[:2] - boxes[:, 2:]
    return np.asarray(np.maximum(np.maximum(before, after), 0).max(axis=1))


def _is_letter(labels: NDArray[np.int32], number: int, box: NDArray[np.int64]) -> bool:
    """Whether a piece consists of strokes and is not a frame around an empty box."""
    x0, y0, x1, y1 = box.tolist()
    piece = labels[y0:y1, x0:x1] == number
    if piece.mean() > _SOLID:
        return bool(min(piece.shape) < 6)
    holes = cv2.connectedComponentsWithStats((~piece).astype(np.uint8), connectivity=4)
    stats = np.asarray(holes[2])[1:]
    left, top = stats[:, cv2.CC_STAT_LEFT], stats[:, cv2.CC_STAT_TOP]
    right = left + stats[:, cv2.CC_STAT_WIDTH]
    bottom = top + stats[:, cv2.CC_STAT_HEIGHT]
    height, width = piece.shape
    inner = (left > 0) & (top > 0) & (right < width) & (bottom < height)
    largest = stats[inner, cv2.CC_STAT_AREA].max(initial=0)
    return bool(largest <= _HOLLOW * piece.size)
