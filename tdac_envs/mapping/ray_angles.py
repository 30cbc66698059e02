"""Directions of a robot's range rays, in its own frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FULL_CIRCLE = 360.0
"""Field of view whose rays go all around, degrees."""
_SLACK = 1.01
"""A fan is round if it lacks less than this many of its gaps between rays."""


def fan(field_of_view_deg: float, n_rays: int) -> NDArray[np.float64]:
    """Angles from the heading at which the rays of an even fan point, rad.

    Rays are in order from the first to the last edge of the field of view, and both
    edges have a ray. Those of a full circle begin behind the robot and are 360°/n
    apart, so that no two rays coincide. A single ray points ahead.

    Args:
        field_of_view_deg: Whole angle of the fan, degrees.
        n_rays: Number of rays.
    """
    # Bit for bit as in `tdac_envs.controller_kit.sensors`.
    if n_rays == 1:
        return np.zeros(1)
    view = math.radians(field_of_view_deg)
    gaps = n_rays if field_of_view_deg == FULL_CIRCLE else n_rays - 1
    return np.asarray(-0.5 * view + view / gaps * np.arange(n_rays))


def is_round(angles: Sequence[float] | NDArray[np.float64]) -> bool:
    """Whether rays look all around: no gap is wider than that between two of them."""
    if len(angles) < 2:
        return False
    ordered = np.sort(angles)
    rest = math.tau - float(ordered[-1] - ordered[0])
    return rest <= _SLACK * float(np.diff(ordered).max())


def faces(angles: Sequence[float] | NDArray[np.float64], bearing: float) -> bool:
    """Whether a direction lies in the field of view that rays span.

    Args:
        angles: Angles of the rays from the heading, rad.
        bearing: Angle of the direction from the heading, rad.
    """
    first = float(np.min(angles))
    span = float(np.max(angles)) - first
    return is_round(angles) or (bearing - first) % math.tau <= span
