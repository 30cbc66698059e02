"""Compiled search for the smallest gap on an arc, and the watch that calls it.

A watch follows the gap next to an environment, after each step: the step itself does
not change. `found` is the watch's array.

Two gaps are kept: the smallest one, and the smallest one that is too close. A start
may be nearer to an obstacle than required, and its controller cannot help that. So a
gap is too close if it is smaller than required, and also smaller than the robot had at
the end of an earlier step, or at the start. `SLACK` is for the wheels' slip: a robot
that turns on the spot keeps the gap of its start only approximately.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from tdac_envs.core.compiled import subkernel
from tdac_envs.drive.smallest_gap import SmallestGap
from tdac_envs.drive.stepping import (
    FORWARD,
    HEADING,
    STEPS,
    TURN,
    Array,
    X,
    Y,
    move,
    wrap_angle,
)

# Entries of the array that a watch's kernel updates: the smallest gap, its step, pose
# and mover; from `CLOSE` on, the same of the smallest gap that is too close; the pose
# after the last step; the largest gap at the end of a step so far, up to `ENOUGH`: the
# required gap and the slack.
GAP, STEP, AT_X, AT_Y, AT_HEADING, WHO = range(6)
CLOSE = 6
FROM_X, FROM_Y, FROM_HEADING, MOST, ENOUGH, LOOSE = range(12, 18)
N_FOUND = 18
SLACK = 0.01
"""A gap must be smaller than an earlier one by this part of the body radius."""
WALL = -1.0
"""`found[WHO]` of obstacles that do not move; otherwise the index of a mover."""
NOWHERE = -1.0
"""The part of a step at which nothing was found."""
EXACT = 1e-8
"""The gap is exact to this part of the body radius."""
_DEEPEST = 40


class GapWatch:
    """Follows the smallest gap of an episode.

    Args:
        note: Kernel `(words, found)` that updates `found`.
        words: Addresses of the arrays of the robot, which must stay alive.
        required: The gap that the robot should keep.
        radius: Radius of its body.
    """

    def __init__(
        self, note: Callable[..., None], words: Any, required: float, radius: float
    ) -> None:
        found = self._found = np.zeros(N_FOUND)
        found[[GAP, CLOSE + GAP]], found[[WHO, CLOSE + WHO]] = math.inf, WALL
        found[LOOSE] = SLACK * radius
        found[MOST], found[ENOUGH] = -math.inf, required + found[LOOSE]
        self.note: Callable[[], None] = partial(note, words, found)
        """Must be called after the reset and after each step."""

    def smallest(self) -> SmallestGap:
        """The smallest gap so far."""
        return self._kept(0)

    def too_close(self) -> SmallestGap | None:
        """The smallest gap so far that is too close; None without any."""
        found = self._kept(CLOSE)
        return None if found.gap == math.inf else found

    def _kept(self, at: int) -> SmallestGap:
        gap, step, x, y, heading, who = self._found[at : at + WHO + 1].tolist()
        mover = None if who == WALL else int(who)
        return SmallestGap(gap, int(step), x, y, heading, mover)


def searching(gap_at: Any) -> Any:
    """Returns the subkernel `search` for one kind of obstacle.

    Args:
        gap_at: Subkernel `(obstacle, part, x, y, heading, forward)` that returns the
            gap between an obstacle and the body after a part of the step, and its rate
            of change per step. Obstacles are convex, and move straight if at all.
    """

    @subkernel
    def search(
        obstacle: Any,
        x: float,
        y: float,
        heading: float,
        forward: float,
        turn: float,
        begin: float,
        end: float,
        best: float,
        exact: float,
    ) -> tuple[float, float]:
        """The smallest gap on an arc if it is below `best`, by branch and bound.

        The gap to a convex obstacle is convex on a straight line, and an arc leaves its
        tangent by at most `|forward * turn| h**2 / 2` within the part h of the step.
        So its value and rate in the middle of an interval bound it from below.

        Args:
            obstacle: First argument of `gap_at`.
            x: Pose at the start of the step.
            y: Pose.
            heading: rad.
            forward: Length of the arc.
            turn: Change of heading, rad.
            begin: Part of the step at which the search begins.
            end: Part at which it ends.
            best: Smallest gap so far.
            exact: Largest error.

        Returns:
            The smallest gap, and the part of the step; `best` and `NOWHERE` if no gap
            is smaller than `best - exact`.
        """
        bend, where = abs(forward * turn), NOWHERE
        ends = move(x, y, heading, end * forward, end * turn)
        gap, _ = gap_at(obstacle, end, ends[0], ends[1], ends[2], forward)
        if gap < best:
            best, where = gap, end
        index, level, half = 0, 0, 0.5 * (end - begin)
        while True:
            at = begin + (2 * index + 1) * half
            there = move(x, y, heading, at * forward, at * turn)
            gap, rate = gap_at(obstacle, at, there[0], there[1], there[2], forward)
            if gap < best:
                best, where = gap, at
            least = gap - abs(rate) * half - 0.5 * bend * half * half
            if least < best - exact and level < _DEEPEST:
                index, level, half = 2 * index, level + 1, 0.5 * half
                continue
            index += 1
            while level > 0 and index % 2 == 0:
                index, level, half = index // 2, level - 1, 2.0 * half
            if level == 0:
                return best, where

    return search


@subkernel
def begin_note(state: Array, found: Array) -> None:
    """Prepares the note of a step: the first one begins where the robot is."""
    if state[STEPS] == 0.0:
        _leave(state, found)


@subkernel
def end_note(state: Array, found: Array, gap: float) -> None:
    """Ends the note of a step: the next arc begins here.

    Args:
        state: State of the robot after the step.
        found: Overwritten.
        gap: The gap at the end of the step, up to `found[ENOUGH]`.
    """
    found[MOST] = max(found[MOST], gap)
    _leave(state, found)


@subkernel
def _leave(state: Array, found: Array) -> None:
    found[FROM_X], found[FROM_Y] = state[X], state[Y]
    found[FROM_HEADING] = state[HEADING]


@subkernel
def sought(found: Array) -> float:
    """A gap is kept if it is below this."""
    return max(float(found[GAP]), _close_below(found))


@subkernel
def _close_below(found: Array) -> float:
    return float(min(found[CLOSE + GAP], found[MOST] - found[LOOSE]))


@subkernel
def keep(state: Array, found: Array, gap: float, part: float, who: float) -> None:
    """Keeps a gap if it is smaller than those before.

    Args:
        state: State of the robot after the step.
        found: Overwritten.
        gap: The gap.
        part: Part of the step at which it occurred.
        who: The mover, or `WALL`.
    """
    x, y, heading = move(
        found[FROM_X], found[FROM_Y], found[FROM_HEADING],
        part * state[FORWARD], part * state[TURN],
    )  # fmt: skip
    _write(state, found, max(gap, 0.0), x, y, wrap_angle(heading), who)


@subkernel
def keep_contact(state: Array, found: Array, who: float) -> None:
    """Keeps a gap of 0 where the robot is now."""
    _write(state, found, 0.0, state[X], state[Y], state[HEADING], who)


@subkernel
def _write(
    state: Array,
    found: Array,
    gap: float,
    x: float,
    y: float,
    heading: float,
    who: float,
) -> None:
    is_close = gap < _close_below(found)
    for at, smaller in ((0, gap < found[GAP]), (CLOSE, is_close)):
        if smaller:
            found[at + GAP], found[at + STEP], found[at + WHO] = gap, state[STEPS], who
            found[at + AT_X], found[at + AT_Y] = x, y
            found[at + AT_HEADING] = heading
