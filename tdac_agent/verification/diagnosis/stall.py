"""What a robot does that makes no progress: stands, spins, oscillates, loops."""

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

# A step nearer than this, px or mm, is no progress: a turn in place drifts as much.
PROGRESS = 1.0
# Share of steps that reverse a turn or a drive: a period of 40 steps (2 s) or less.
FLIPS = 0.05
# Share of the places that a robot passed before, from which it goes over its trail.
_AGAIN = 0.6
# The largest circle that counts as spinning, radii of the body.
_CIRCLE = 4.0
# Rounds in the second half of the time without progress that count as spinning.
_ROUNDS = 1.0
# Mean wheel speed below which a robot does nothing on purpose.
_IDLE = 0.01
# Steps that a robot may trail off before it stands.
_AT_ONCE = 10


Habit = tuple[Cause, str]


class Finding(NamedTuple):
    """What happened, with the step of it."""

    cause: Cause
    text: str
    step: int


def why_stalled(
    trajectory: Trajectory, since: int, radius: float, units: Units
) -> Finding:
    """No progress since a step: standing, spinning, oscillating, looping or stuck."""
    rest = standing_since(trajectory)
    if trajectory.steps - rest >= 0.5 * (trajectory.steps - since):
        text = (
            f"it stands at {units.point(*trajectory.poses[-1, :2])} since step {rest}"
        )
        if rest - since > _AT_ONCE:
            text += f", and made no progress since step {since}"
        return Finding("stuck", f"{text}.", rest)
    # The first half may still be on the way to what the robot then did for good.
    late = since + (trajectory.steps - since) // 2
    cause, text = (
        _spinning(trajectory, late, radius, units)
        or _going_over_its_trail(trajectory, since, late, radius, units)
        or _trembling(trajectory, late, radius, units)
        or _wandering(trajectory, late, units)
    )
    place = units.point(*trajectory.poses[since, :2])
    return Finding(cause, f"no progress since step {since} at {place}; {text}.", since)


def _spinning(
    trajectory: Trajectory, late: int, radius: float, units: Units
) -> Habit | None:
    turned = turns(trajectory)[late:]
    net, total = float(turned.sum()), float(np.abs(turned).sum())
    rounds, driven = abs(net) / math.tau, float(lengths(trajectory)[late:].sum())
    small = driven <= rounds * math.tau * _CIRCLE * radius
    if rounds < _ROUNDS or abs(net) < 0.7 * total or not small:
        return None
    way = "right" if net > 0 else "left"
    circle = driven / (rounds * math.tau)
    wide = f"on a circle of {circle:.0f} {units.length}"
    where = wide if circle >= PROGRESS else "in place"
    return "spinning", (
        f"in the last {trajectory.steps - late} steps it turned {rounds:.1f} times to "
        f"the {way} {where}"
    )


def _trembling(
    trajectory: Trajectory, late: int, radius: float, units: Units
) -> Habit | None:
    turned, share = turns(trajectory)[late:], flips(trajectory, late)
    actions = np.abs(trajectory.actions[late:])
    if abs(turned.sum()) >= 0.3 * max(np.abs(turned).sum(), 1.0):
        return None
    if share < FLIPS and not _looking_about(trajectory, late, radius):
        return None
    if actions.mean() < _IDLE:
        return None
    return "oscillating", (
        f"in the last {trajectory.steps - late} steps it reversed its turn or its "
        f"drive every {1 / share:.1f} steps, its heading within "
        f"{math.degrees(swing(trajectory, late)):.0f}°, its place within "
        f"{_extent(trajectory, late):.1f} {units.length}"
    )


def _looking_about(trajectory: Trajectory, late: int, radius: float) -> bool:
    """Whether a robot turns to and fro on the spot most of the time."""
    reversals = flips(trajectory, late) * (trajectory.steps - late)
    turning = wheels_differ(trajectory)[late:].mean()
    return reversals >= 4 and turning >= 0.5 and _extent(trajectory, late) < 3 * radius


def _going_over_its_trail(
    trajectory: Trajectory, since: int, late: int, radius: float, units: Units
) -> Habit | None:
    if _extent(trajectory, late) < 3.0 * radius:
        return None
    box = units.box(*_box(trajectory, since), less=1)
    again = find_returns(trajectory, since, radius)
    if again.same_way < _AGAIN:
        return None
    cause: Cause = "oscillating" if again.other_way >= _AGAIN else "looping"
    how = "to and fro" if cause == "oscillating" else "in rounds"
    return cause, (
        f"since then it drove {how} over its own trail, every {again.period} steps the "
        f"same, within {box}"
    )


def _wandering(trajectory: Trajectory, late: int, units: Units) -> Habit:
    box = units.box(*_box(trajectory, late))
    driven = float(lengths(trajectory)[late:].sum())
    return "stuck", (
        f"in the last {trajectory.steps - late} steps it drove {driven:.1f} "
        f"{units.length} within {box}"
    )


def _box(trajectory: Trajectory, since: int) -> tuple[Points, Points]:
    """The least and the greatest (x, y) since a step."""
    places = trajectory.poses[since:, :2]
    return places.min(axis=0), places.max(axis=0)


def _extent(trajectory: Trajectory, since: int) -> float:
    """Diagonal of the box around all places since a step."""
    low, high = _box(trajectory, since)
    return float(np.hypot(*(high - low)))


def standing_since(trajectory: Trajectory) -> int:
    """First step of the rest at the end of an episode; T where it moved to the end.

    Whoever trembles on the spot does not stand.
    """
    x, y, heading = trajectory.poses.T
    moved = np.hypot(x - x[-1], y - y[-1]) > 0.5 * PROGRESS
    moved |= np.abs(np.unwrap(heading) - np.unwrap(heading)[-1]) > 0.05
    moved[:-1] |= wheels_turn(trajectory)
    return int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else 0


def percent(share: float) -> str:
    """A share in words."""
    return f"{100 * share:.0f} %"
