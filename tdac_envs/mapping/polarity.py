"""Estimates from the picture alone which side of the threshold is free space."""

from __future__ import annotations

import math

import cv2
import numpy as np

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.binarize import saved_level, unknown_level
from tdac_envs.mapping.image import GreyImage

# Weights of the evidence, from a logistic fit on 63 public maps whose free side is
# known. Every term changes its sign in the negative of a picture, so that a map and its
# negative get the same obstacles.
_W_CONNECTED, _W_BORDER, _W_WIDTH, _W_PIECES = 1.5, -1.7, 1.1, -1.5
_W_THIN, _W_OUTSIDE, _W_EXTREMES, _W_SAVER = 1.0, 1.0, 4.0, 3.0
_W_SAVED = 15.0
"""More than all other evidence, since the levels of the file define what is free."""
_TOO_THIN = 2.5
"""Mean distance to the other side, px, below which no robot fits."""
_WIDE = 0.01
"""The distance above which a shape is too wide for a wall, as a share of the side."""


def light_free_evidence(
    luminance: GreyImage, light: BoolGrid, photo: bool = False
) -> float:
    """Log-odds that the light pixels are the free ones.

    Free space tends to be one connected, wide piece. Obstacles are thin walls in many
    pieces, or the outside, which fills the border.

    Args:
        luminance: Shape (height, width), uint8.
        light: Shape (height, width), bool, the pixels above the threshold.
        photo: Whether it is a photograph, whose exact levels mean nothing.
    """
    light = _without_frame(light)
    share, border = float(light.mean()), float(_rim(light).mean())
    connected_l, pieces_l = _pieces(light)
    connected_d, pieces_d = _pieces(~light)
    width_l, width_d = _mean_width(light), _mean_width(~light)
    pieces = math.log((pieces_l + 3) / (pieces_d + 3))
    return (
        _W_CONNECTED * (connected_l - connected_d)
        + _W_BORDER * (border - 0.5) * (1 - abs(2 * share - 1))
        + _W_WIDTH * _clip(math.log(width_l / width_d), 3.0)
        + _W_PIECES * _clip(pieces, 1.0)
        + _W_THIN * (_thinness(width_d) - _thinness(width_l))
        + _W_OUTSIDE * _outside(border, width_l, width_d, math.sqrt(light.size))
        + (0.0 if photo else _levels(luminance))
    )


def _levels(luminance: GreyImage) -> float:
    """Evidence from the exact grey levels, which mapping tools write."""
    written = saved_level(luminance)
    if written is not None:
        return _W_SAVED if written > 127 else -_W_SAVED
    return _W_EXTREMES * _extremes(luminance) + _W_SAVER * _map_saver(luminance)


def _rim(side: BoolGrid) -> BoolGrid:
    return np.concatenate([side[0], side[-1], side[:, 0], side[:, -1]])


def _without_frame(light: BoolGrid) -> BoolGrid:
    """The picture without a narrow one-coloured margin (5 % on each side at most)."""
    if _rim(light).min() != _rim(light).max():
        return light
    rows, columns = np.nonzero(light != light[0, 0])
    if rows.size == 0:
        return light
    top, bottom = int(rows.min()), int(rows.max()) + 1
    left, right = int(columns.min()), int(columns.max()) + 1
    height, width = light.shape
    widest = max(top / height, 1 - bottom / height, left / width, 1 - right / width)
    inner = light[top:bottom, left:right]
    return inner if widest <= 0.05 and inner.min() != inner.max() else light


def _thinness(width: float) -> float:
    return _clip(_TOO_THIN - width, 1.5) if width < _TOO_THIN else 0.0


def _outside(border: float, width_l: float, width_d: float, side: float) -> float:
    """Evidence from the side that fills the border.

    It is the outside of a free area if the other side is too wide for walls; otherwise
    it is the paper around the walls.
    """
    if abs(2 * border - 1) < 0.9:
        return 0.0
    inner = width_d if border > 0.5 else width_l
    wide = _clip(math.log(inner / side / _WIDE), 1.0)
    return -wide if border > 0.5 else wide


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _pieces(side: BoolGrid) -> tuple[float, int]:
    """Share of the largest connected piece, and the number of pieces except specks."""
    stats = cv2.connectedComponentsWithStats(side.astype(np.uint8), connectivity=4)[2]
    areas = stats[1:, cv2.CC_STAT_AREA]
    smallest = max(20, side.size // 10000)
    return float(areas.max() / areas.sum()), int((areas >= smallest).sum())


def _mean_width(side: BoolGrid) -> float:
    """Mean distance to the other side or to the border of the map, px."""
    framed = np.pad(side, 1).astype(np.uint8)
    distance = cv2.distanceTransform(framed, cv2.DIST_L2, 5)
    return float(distance[framed > 0].mean())


def _extremes(luminance: GreyImage) -> float:
    """Evidence from an "unknown" grey: the larger of black and white is then free."""
    level = unknown_level(luminance)
    if level is None:
        return 0.0
    dark = float((luminance < min(level, 128) - 20).mean())
    light = float((luminance > max(level, 127) + 20).mean())
    return _clip(math.log((light + 1e-3) / (dark + 1e-3)), 1.0)


def _map_saver(luminance: GreyImage) -> float:
    """1 for the levels of ROS `map_saver` (254 free, 0 occupied), -1 for a negative."""
    counts = np.bincount(luminance.ravel(), minlength=256) / luminance.size
    free_light = counts[254] > 0.02 and counts[0] > 0.002 and counts[255] < 0.002
    free_dark = counts[1] > 0.02 and counts[255] > 0.002 and counts[0] < 0.002
    return float(free_light) - float(free_dark)
