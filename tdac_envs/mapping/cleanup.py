"""Cleaning a thresholded map: specks, holes, small gaps and thin drawn lines."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.grid.grid import BoolGrid

Labels = NDArray[np.int32]
Counts = NDArray[np.int64]

_SQUARE = np.ones((3, 3), np.uint8)
_ACROSS, _DOWN = np.array([1, -1, 0, 0]), np.array([0, 0, 1, -1])


def cleanings(cells: BoolGrid, strengths: Sequence[int]) -> list[BoolGrid]:
    """Removes noise, fills holes and closes hairline gaps, at several strengths.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        strengths: In ascending order, px. Obstacle pieces (8-connected) and then holes
            (free pieces, 4-connected) with fewer pixels than this are removed, and
            obstacles are closed with a 3 x 3 square. 0 changes nothing.

    Returns:
        One grid per strength, shape (height, width), bool; the same array again if two
        successive strengths have the same result.
    """
    pieces, holes = _labels(cells, 8), _labels(~cells, 4)
    first_hole = int(pieces.max()) + 1
    size = np.zeros(first_hole + int(holes.max()) + 1, np.int64)
    _measure(pieces, holes, first_hole, size)
    joined, parent = size.copy(), np.arange(size.size)
    found: list[BoolGrid] = []
    for strength in strengths:
        _free_small(pieces, holes, first_hole, strength, size, joined, parent)
        occupied = np.empty(size.size, np.bool_)
        _decide(first_hole, strength, size, joined, parent, occupied)
        filled = np.empty(cells.shape, np.bool_)
        _fill(pieces, holes, first_hole, occupied, filled)
        if strength > 0:
            closed = cv2.morphologyEx(filled.view(np.uint8), cv2.MORPH_CLOSE, _SQUARE)
            filled = np.asarray(closed, np.uint8).view(np.bool_)
        same = bool(found) and np.array_equal(found[-1], filled)
        found.append(found[-1] if same else filled)
    return found


def _labels(mask: BoolGrid, connectivity: int) -> Labels:
    found = cv2.connectedComponents(mask.astype(np.uint8), connectivity=connectivity)
    return np.asarray(found[1], np.int32)


@kernel
def _measure(pieces: Labels, holes: Labels, first_hole: int, size: Counts) -> None:
    """Counts the pixels of each piece and of each hole."""
    for y in range(pieces.shape[0]):
        for x in range(pieces.shape[1]):
            if pieces[y, x] > 0:
                size[pieces[y, x]] += 1
            else:
                size[first_hole + holes[y, x]] += 1


@subkernel
def _root(parent: Counts, node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@kernel
def _free_small(
    pieces: Labels,
    holes: Labels,
    first_hole: int,
    strength: int,
    size: Counts,
    joined: Counts,
    parent: Counts,
) -> None:
    """Joins each removed piece with the holes beside it, which become one hole."""
    height, width = pieces.shape
    for y in range(height):
        for x in range(width):
            piece = pieces[y, x]
            if piece == 0 or size[piece] >= strength:
                continue
            for k in range(4):
                i, j = x + _ACROSS[k], y + _DOWN[k]
                if i < 0 or j < 0 or i >= width or j >= height or holes[j, i] == 0:
                    continue
                one, other = (
                    _root(parent, piece),
                    _root(parent, first_hole + holes[j, i]),
                )
                if one != other:
                    parent[one] = other
                    joined[other] += joined[one]


@kernel
def _decide(
    first_hole: int,
    strength: int,
    size: Counts,
    joined: Counts,
    parent: Counts,
    occupied: BoolGrid,
) -> None:
    """Decides which pieces stay and which holes are filled."""
    for node in range(size.size):
        stays = node < first_hole and size[node] >= strength
        occupied[node] = stays or joined[_root(parent, node)] < strength


@kernel
def _fill(
    pieces: Labels, holes: Labels, first_hole: int, occupied: BoolGrid, cells: BoolGrid
) -> None:
    for y in range(pieces.shape[0]):
        for x in range(pieces.shape[1]):
            piece = pieces[y, x]
            cells[y, x] = occupied[piece if piece > 0 else first_hole + holes[y, x]]


def _pieces(
    mask: BoolGrid, connectivity: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    found = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=connectivity
    )
    return np.asarray(found[1], np.int32), np.asarray(found[2], np.int32)


def without_specks(cells: BoolGrid, extent: int) -> BoolGrid:
    """Drops obstacle pieces that fit in a box of `extent` px: noise, letters, dashes.

    Solid pieces of at least 6 px stay: they are pillars rather than letters.
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
