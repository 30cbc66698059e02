"""The smallest gap between body and obstacles in an episode, and the required one.

The gap is measured along the exact arcs of all steps; see `gap_search`, which also
says when a gap is too close.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

LEAST_SHARE = 0.05
"""Least required gap, as a share of the body radius."""
MOST_SHARE = 0.5
"""Largest required gap, as a share of the gap of the widest path to the goal."""


class SmallestGap(NamedTuple):
    """The smallest gap of an episode.

    Attributes:
        gap: Distance between body and obstacle (px or m); 0 at a contact.
        step: Step in which it occurred; 0 is the start.
        x: Place of the robot's centre there, px or m.
        y: Place, px or m.
        heading: Heading there, rad.
        mover: Index of the mover; None for other obstacles.
    """

    gap: float
    step: int
    x: float
    y: float
    heading: float
    mover: int | None


def required_gap(
    radius: float,
    stopping_distance: float = 0.0,
    widest: Callable[[], float] = lambda: math.inf,
) -> float:
    """The gap that a robot should keep, in the unit of its arguments.

    It is the stopping distance, but no more than `MOST_SHARE` of what the world leaves,
    and at least `LEAST_SHARE` of the radius. The error of the observed pose is not
    added: where a drive has one, the true gap already includes it.

    Args:
        radius: Radius of the body.
        stopping_distance: Distance in which the robot stops from full speed.
        widest: Returns the radius of the largest disc that gets from start to goal;
            called only if it matters.
    """
    least = LEAST_SHARE * radius
    if stopping_distance <= least:
        return least
    return max(min(stopping_distance, MOST_SHARE * (widest() - radius)), least)
