"""What a robot without progress does: it stands, spins, oscillates or loops."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.units import Points, Units
from tdac_agent.verification.diagnosis.motion import (
    find_returns,
    flips,
    lengths,
    swing,
    turns,
    wheels_differ,
    wheels_turn,
)
from tdac_agent.verification.diagnosis.report import Cause

# Coming nearer by less, px or mm, is no progress: even a turn in place drifts by that.
PROGRESS = 1.0
# Least share of reversals for oscillating: a period of at most 40 steps (2 s).
FLIPS = 0.05
# Least share of positions passed before, for driving over its own trail.
_AGAIN = 0.6
# Radius of the largest circle that counts as spinning, body radii.
_CIRCLE = 4.0
# Least number of turns in the second half of the stall, for spinning.
_ROUNDS = 1.0
# Mean wheel speed below which a robot is idle.
_IDLE = 0.01
# If a standstill follows the last progress by more steps, the text reports both.
_AT_ONCE = 10

Behaviour = tuple[Cause, str]


class Finding(NamedTuple):
    """What happened, and in which step."""

    cause: Cause
    text: str
    step: int


def why_stalled(
    trajectory: Trajectory, since: int, radius: float, units: Units
) -> Finding:
    """Finds what a robot did after the step of its last progress."""
    rest = standing_since(trajectory)
    if trajectory.steps - rest >= 0.5 * (trajectory.steps - since):
        place = units.point(*trajectory.poses[-1, :2])
        text = f"it stood still from step {rest} to the end at {place}"
        if rest - since > _AT_ONCE:
            text += f", and made no progress after step {since}"
        return Finding("stuck", f"{text}.", rest)
    # In the first half, the robot may not yet have settled into its final behaviour.
    late = since + (trajectory.steps - since) // 2
    cause, text = (
        _spinning(trajectory, late, radius, units)
        or _retracing(trajectory, since, late, radius, units)
        or _jittering(trajectory, late, radius, units)
        or _wandering(trajectory, late, units)
    )
    place = units.point(*trajectory.poses[since, :2])
    return Finding(cause, f"no progress after step {since} at {place}; {text}.", since)


def _spinning(
    trajectory: Trajectory, late: int, radius: float, units: Units
) -> Behaviour | None:
    turned = turns(trajectory)[late:]
    net, total = float(turned.sum()), float(np.abs(turned).sum())
    rounds, driven = abs(net) / math.tau, float(lengths(trajectory)[late:].sum())
    small = driven <= rounds * math.tau * _CIRCLE * radius
    if rounds < _ROUNDS or abs(net) < 0.7 * total or not small:
        return None
    side = "right" if net > 0 else "left"
    circle = driven / (rounds * math.tau)
    wide = f"on a circle of radius {units.far(circle, 0)}"
    where = wide if circle >= PROGRESS else "in place"
    return "spinning", (
        f"in the last {trajectory.steps - late} steps it made {rounds:.1f} full turns "
        f"to the {side} {where}"
    )


def _jittering(
    trajectory: Trajectory, late: int, radius: float, units: Units
) -> Behaviour | None:
    turned, share = turns(trajectory)[late:], flips(trajectory, late)
    actions = np.abs(trajectory.actions[late:])
    turns_round = abs(turned.sum()) >= 0.3 * max(np.abs(turned).sum(), 1.0)
    steady = share < FLIPS and not _sweeping(trajectory, late, radius)
    if turns_round or steady or actions.mean() < _IDLE:
        return None
    return "oscillating", (
        f"in the last {trajectory.steps - late} steps it reversed its turning or "
        f"driving direction every {1 / share:.1f} steps, its heading within "
        f"{math.degrees(swing(trajectory, late)):.0f}°, its position within "
        f"{units.far(_extent(trajectory, late))}"
    )


def _sweeping(trajectory: Trajectory, late: int, radius: float) -> bool:
    """Whether a robot mostly turns back and forth on the spot."""
    reversals = flips(trajectory, late) * (trajectory.steps - late)
    turning = wheels_differ(trajectory)[late:].mean()
    return reversals >= 4 and turning >= 0.5 and _extent(trajectory, late) < 3 * radius


def _retracing(
    trajectory: Trajectory, since: int, late: int, radius: float, units: Units
) -> Behaviour | None:
    if _extent(trajectory, late) < 3.0 * radius:
        return None
    box = units.box(*_box(trajectory, since), less=1)
    again = find_returns(trajectory, since, radius)
    if again.same_way < _AGAIN:
        return None
    cause: Cause = "oscillating" if again.other_way >= _AGAIN else "looping"
    how = "back and forth" if cause == "oscillating" else "in loops"
    return cause, (
        f"since then it drove {how} over its own trail with a period of "
        f"{again.period} steps, within {box}"
    )


def _wandering(trajectory: Trajectory, late: int, units: Units) -> Behaviour:
    box = units.box(*_box(trajectory, late))
    driven = float(lengths(trajectory)[late:].sum())
    return "stuck", (
        f"in the last {trajectory.steps - late} steps it drove "
        f"{units.far(driven)} within {box}"
    )


def _box(trajectory: Trajectory, since: int) -> tuple[Points, Points]:
    """The smallest and the largest (x, y) since a step."""
    places = trajectory.poses[since:, :2]
    return places.min(axis=0), places.max(axis=0)


def _extent(trajectory: Trajectory, since: int) -> float:
    """Diagonal of the box around all positions since a step."""
    low, high = _box(trajectory, since)
    return float(np.hypot(*(high - low)))


def standing_since(trajectory: Trajectory) -> int:
    """First step of the standstill at the end of an episode; T if there is none.

    Jittering on the spot is no standstill.
    """
    x, y, heading = trajectory.poses.T
    moved = np.hypot(x - x[-1], y - y[-1]) > 0.5 * PROGRESS
    moved |= np.abs(np.unwrap(heading) - np.unwrap(heading)[-1]) > 0.05
    moved[:-1] |= wheels_turn(trajectory)
    return int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else 0


def percent(share: float) -> str:
    """Formats a share, such as `12 %`."""
    return f"{100 * share:.0f} %"
