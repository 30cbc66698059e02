"""The smallest gap between body and obstacles in an episode, and the required one.

The gap is measured along the exact arcs of all steps; see `gap_search`, which also
says when a gap is too close.
"""

from __future__ import annotations

from typing import NamedTuple

LEAST_SHARE = 0.05
"""Least required gap, as a share of the body radius."""
DEVIATIONS = 3.0
"""Standard deviations of the pose that the required gap covers."""


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
    radius: float, pose_deviation: float = 0.0, stopping_distance: float = 0.0
) -> float:
    """The gap that a robot should keep, in the unit of its arguments.

    Args:
        radius: Radius of the body.
        pose_deviation: Standard deviation of the observed position.
        stopping_distance: Distance in which the robot stops from full speed.
    """
    needed = DEVIATIONS * pose_deviation + stopping_distance
    return max(needed, LEAST_SHARE * radius)
