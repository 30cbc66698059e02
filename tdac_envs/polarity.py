"""Which side of the threshold is free space, judged from the picture alone."""

from __future__ import annotations

import math

import cv2
import numpy as np

from tdac_envs.binarize import unknown_level
from tdac_envs.grid import BoolGrid
from tdac_envs.image import GreyImage

# Weights of the evidence, from a logistic fit on 63 public maps whose free side is
# known. Every term changes its sign with the picture's negative, so that a map and
# its negative are decided alike.
_W_CONNECTED, _W_BORDER, _W_WIDTH, _W_PIECES = 1.5, -1.7, 1.1, -1.5
_W_EXTREMES, _W_SAVER = 2.0, 3.0


def light_free_evidence(luminance: GreyImage, light: BoolGrid) -> float:
    """Log-odds that the light pixels are the free ones.

    Free space tends to be one connected, wide piece; walls are thin and in many
    pieces, or they are the outside, which fills the border.

    Args:
        luminance: Shape (height, width), uint8.
        light: Shape (height, width), bool, the pixels above the threshold.
    """
    share = float(light.mean())
    border = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]]).mean()
    connected_l, pieces_l = _pieces(light)
    connected_d, pieces_d = _pieces(~light)
    width = math.log(_mean_width(light) / _mean_width(~light))
    pieces = math.log((pieces_l + 3) / (pieces_d + 3))
    return (
        _W_CONNECTED * (connected_l - connected_d)
        + _W_BORDER * (float(border) - 0.5) * (1 - abs(2 * share - 1))
        + _W_WIDTH * _clip(width, 3.0)
        + _W_PIECES * _clip(pieces, 1.0)
        + _W_EXTREMES * _extremes(luminance)
        + _W_SAVER * _map_saver(luminance)
    )


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _pieces(side: BoolGrid) -> tuple[float, int]:
    """Share of the largest connected piece, and the number of pieces worth a look."""
    stats = cv2.connectedComponentsWithStats(side.astype(np.uint8), connectivity=4)[2]
    areas = stats[1:, cv2.CC_STAT_AREA]
    smallest = max(20, side.size // 10000)
    return float(areas.max() / areas.sum()), int((areas >= smallest).sum())


def _mean_width(side: BoolGrid) -> float:
    """Mean distance to the other side, the border of the map counting as such."""
    framed = np.pad(side, 1).astype(np.uint8)
    distance = cv2.distanceTransform(framed, cv2.DIST_L2, 5)
    return float(distance[framed > 0].mean())


def _extremes(luminance: GreyImage) -> float:
    """With an "unknown" grey between black and white, the larger of those is free."""
    level = unknown_level(luminance)
    if level is None:
        return 0.0
    dark = float((luminance < min(level, 128) - 20).mean())
    light = float((luminance > max(level, 127) + 20).mean())
    return _clip(math.log((light + 1e-3) / (dark + 1e-3)), 1.0)


def _map_saver(luminance: GreyImage) -> float:
    """ROS `map_saver` writes 254, not 255, for free, and 0 for occupied."""
    counts = np.bincount(luminance.ravel(), minlength=256) / luminance.size
    free_light = counts[254] > 0.02 and counts[0] > 0.002 and counts[255] < 0.002
    free_dark = counts[1] > 0.02 and counts[255] > 0.002 and counts[0] < 0.002
    return float(free_light) - float(free_dark)
