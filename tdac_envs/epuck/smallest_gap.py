"""Compiled search for the smallest gap to the solid parts of a world, step by step.

Lengths are metres. `tdac_envs.epuck.gaps` documents `points`, `first` and `extent`.
"""

from __future__ import annotations

import math

from tdac_envs.core.addresses import Words
from tdac_envs.core.compiled import kernel, subkernel
from tdac_envs.drive.gap_search import (
    ENOUGH,
    EXACT,
    FROM_HEADING,
    FROM_X,
    FROM_Y,
    NOWHERE,
    WALL,
    begin_note,
    end_note,
    keep,
    keep_contact,
    searching,
    sought,
)
from tdac_envs.drive.stepping import (
    CLEARANCE,
    FORWARD,
    RADIUS,
    TOUCHED,
    TURN,
    X,
    Y,
)
from tdac_envs.epuck.gaps import gap_of
from tdac_envs.epuck.kernels import CONSTANTS, OUTCOME, STATE, arrays_at
from tdac_envs.epuck.prisms import MID_X, MID_Y, REACH, Array, Index


@subkernel
def _gap_to_part(
    thing: tuple[Array, Index, Array, int, float],
    _part: float,
    x: float,
    y: float,
    heading: float,
    forward: float,
) -> tuple[float, float]:
    points, first, extent, k, radius = thing
    gap, away_x, away_y = gap_of(points, first, extent, k, x, y)
    along = away_x * math.cos(heading) + away_y * math.sin(heading)
    return gap - radius, forward * along


_search = searching(_gap_to_part)


@subkernel
def _note_parts(
    points: Array,
    first: Index,
    extent: Array,
    state: Array,
    radius: float,
    found: Array,
) -> None:
    """Notes the smallest gap in a step without a contact."""
    forward, turn = state[FORWARD], state[TURN]
    for k in range(extent.shape[0]):
        off_x, off_y = extent[k, MID_X] - state[X], extent[k, MID_Y] - state[Y]
        far = math.sqrt(off_x * off_x + off_y * off_y) - extent[k, REACH]
        if far - radius - abs(forward) < sought(found):
            gap, part = _search(
                (points, first, extent, k, radius),
                found[FROM_X], found[FROM_Y], found[FROM_HEADING], forward, turn,
                0.0, 1.0, sought(found), EXACT * radius,
            )  # fmt: skip
            if part != NOWHERE:
                keep(state, found, gap, part, WALL)


@kernel
def note_gap(words: Words, found: Array) -> None:
    """Updates the smallest gap of an episode after its reset and after each step.

    Args:
        words: As for `kernels.begin`.
        found: See `tdac_envs.drive.smallest_gap`; overwritten.
    """
    own = arrays_at(words)
    state, outcome, radius = own[STATE], own[OUTCOME], own[CONSTANTS][RADIUS]
    begin_note(state, found)
    room = outcome[CLEARANCE] - radius
    if outcome[TOUCHED] == 1.0:
        if sought(found) > 0.0:
            keep_contact(state, found, WALL)
    elif room - abs(state[FORWARD]) < sought(found):
        _note_parts(own[0], own[1], own[2], state, radius, found)
    end_note(state, found, min(room, found[ENOUGH]))
