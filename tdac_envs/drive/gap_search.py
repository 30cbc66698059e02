"""Compiled search for the smallest gap on an arc, and the watch that calls it.

A watch follows the gap next to an environment, after each step: the step itself does
not change. `found` is the watch's array.
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
# and mover; the pose after the last step.
GAP, STEP, AT_X, AT_Y, AT_HEADING, WHO, FROM_X, FROM_Y, FROM_HEADING = range(9)
N_FOUND = 9
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
    """

    def __init__(self, note: Callable[..., None], words: Any) -> None:
        self._found = np.zeros(N_FOUND)
        self._found[GAP], self._found[WHO] = math.inf, WALL
        self.note: Callable[[], None] = partial(note, words, self._found)
        """Must be called after the reset and after each step."""

    def smallest(self) -> SmallestGap:
        """The smallest gap so far."""
        gap, step, x, y, heading, who = self._found[: WHO + 1].tolist()
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
def end_note(state: Array, found: Array) -> None:
    """Ends the note of a step: the next arc begins here."""
    _leave(state, found)


@subkernel
def _leave(state: Array, found: Array) -> None:
    found[FROM_X], found[FROM_Y] = state[X], state[Y]
    found[FROM_HEADING] = state[HEADING]


@subkernel
def keep(state: Array, found: Array, gap: float, part: float, who: float) -> None:
    """Keeps a gap that is smaller than all before.

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
    found[GAP], found[STEP], found[WHO] = max(gap, 0.0), state[STEPS], who
    found[AT_X], found[AT_Y], found[AT_HEADING] = x, y, wrap_angle(heading)


@subkernel
def keep_contact(state: Array, found: Array, who: float) -> None:
    """Keeps a gap of 0 where the robot is now."""
    found[GAP], found[STEP], found[WHO] = 0.0, state[STEPS], who
    found[AT_X], found[AT_Y] = state[X], state[Y]
    found[AT_HEADING] = state[HEADING]
