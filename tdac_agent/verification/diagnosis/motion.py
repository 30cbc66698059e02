"""Features of the motion in an episode: turns, reversals, loops.

Lengths and headings are in units of the screen; see `tdac_agent.tasks.units`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory

# Wheel speeds, and differences of wheel speeds, below this count as zero.
_DEAD_BAND = 0.02
# A wheel this near its limit counts as saturated.
_SATURATED = 0.999
_SAMPLES = 300
_SAME_WAY = math.radians(45.0)


def turns(trajectory: Trajectory) -> NDArray[np.float64]:
    """Change of heading in each step, rad, right positive."""
    return np.asarray(np.diff(np.unwrap(trajectory.poses[:, 2])))


def lengths(trajectory: Trajectory) -> NDArray[np.float64]:
    """Length driven in each step."""
    return np.asarray(np.hypot(*np.diff(trajectory.poses[:, :2], axis=0).T))


def ahead(trajectory: Trajectory) -> NDArray[np.float64]:
    """Motion of each step along the mean of its headings, negative backwards."""
    step = np.diff(trajectory.poses[:, :2], axis=0)
    middle = trajectory.poses[:-1, 2] + turns(trajectory) / 2.0
    return np.asarray(np.cos(middle) * step[:, 0] + np.sin(middle) * step[:, 1])


def arc_of(
    chord: NDArray[np.float64], turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Lengths of arcs with these chords and turns, rad."""
    return np.asarray(chord / np.sinc(turn / (2.0 * np.pi)))


def forward(trajectory: Trajectory) -> NDArray[np.float64]:
    """Forward speed of each step as a fraction of the wheel limit."""
    return np.asarray(trajectory.actions.mean(axis=1, dtype=np.float64))


def saturated(trajectory: Trajectory) -> float:
    """Share of steps in which a wheel was at its limit."""
    return float((np.abs(trajectory.actions) >= _SATURATED).any(axis=1).mean())


def wheels_turn(trajectory: Trajectory) -> NDArray[np.bool_]:
    """Whether a wheel turned, for each step."""
    return np.asarray((np.abs(trajectory.actions) >= _DEAD_BAND).any(axis=1))


def wheels_differ(trajectory: Trajectory) -> NDArray[np.bool_]:
    """Whether the wheel speeds differ, for each step."""
    actions = trajectory.actions
    return np.asarray(np.abs(actions[:, 0] - actions[:, 1]) >= _DEAD_BAND)


def flips(trajectory: Trajectory, since: int) -> float:
    """Share of steps that reversed turning or driving direction, the larger one."""
    actions = trajectory.actions[since:]
    shares = [0.0]
    for signal in (actions[:, 0] - actions[:, 1], actions.sum(axis=1)):
        signs = np.sign(signal[np.abs(signal) > _DEAD_BAND])
        if len(actions):
            shares.append(float((signs[1:] != signs[:-1]).sum()) / len(actions))
    return max(shares)


def swing(trajectory: Trajectory, since: int) -> float:
    """Angle between the leftmost and the rightmost heading, rad."""
    return float(np.ptp(np.unwrap(trajectory.poses[since:, 2])))


def rounds_about(
    trajectory: Trajectory, since: int, centre: tuple[float, float]
) -> float:
    """Number of revolutions about a point, positive if clockwise on the screen."""
    off = trajectory.poses[since:, :2] - np.asarray(centre)
    angles = np.unwrap(np.arctan2(off[:, 1], off[:, 0]))
    return float(angles[-1] - angles[0]) / (2.0 * math.pi)


@dataclass(frozen=True, slots=True)
class Returns:
    """How much a robot drove over its own trail.

    Attributes:
        same_way: Share of positions that it passed again in the same direction.
        other_way: Share of positions that it passed again in the opposite direction.
        period: Median number of steps between two passes in the same direction; 0 if
            there are none.
    """

    same_way: float
    other_way: float
    period: int


def find_returns(trajectory: Trajectory, since: int, reach: float) -> Returns:
    """Finds loops, and driving back and forth.

    Args:
        trajectory: Trajectory of the episode.
        since: First step to look at.
        reach: Largest distance between poses that count as the same position. For
            opposite directions it is doubled, since the two lines seldom coincide.
    """
    steps = np.linspace(since, trajectory.steps - 1, _SAMPLES).astype(int)
    steps = np.unique(steps[steps >= since])
    if steps.size < 2:
        return Returns(0.0, 0.0, 0)
    x, y, heading = trajectory.poses[steps].T
    # In reverse, the direction of motion is opposite to the heading.
    course = heading + np.pi * (forward(trajectory)[steps] < 0.0)
    along = np.concatenate([[0.0], np.cumsum(lengths(trajectory))])[steps]
    apart = np.hypot(x[:, None] - x, y[:, None] - y)
    later = np.abs(along[:, None] - along) >= 6.0 * reach
    angle = np.abs(np.angle(np.exp(1j * (course[:, None] - course))))
    same = later & (apart <= reach) & (angle < _SAME_WAY)
    other = later & (apart <= 2.0 * reach) & (angle > np.pi - _SAME_WAY)
    lag = np.where(same, np.abs(steps[:, None] - steps), np.inf).min(axis=1)
    lags = lag[np.isfinite(lag)]
    period = int(np.median(lags)) if lags.size else 0
    return Returns(
        float(same.any(axis=1).mean()), float(other.any(axis=1).mean()), period
    )
