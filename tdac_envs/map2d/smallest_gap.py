"""Compiled search for the smallest gap to walls and movers, step by step.

The obstacles are those of `contact` and `encounters`. `clear` is the padded clearance.
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
    MOST,
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
    CONTACT,
    DT,
    FORWARD,
    HEADING,
    RADIUS,
    STEPS,
    TOUCHED,
    TURN,
    Array,
    X,
    Y,
    move,
)
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.among import MOVER, movers_at
from tdac_envs.map2d.contact import (
    ROUNDING,
    is_edge,
    least_room,
    most_room,
    square_distance2,
)
from tdac_envs.map2d.kernels import arrays_at
from tdac_envs.movers import state as at


@subkernel
def _gap_to_square(
    square: tuple[int, int, float],
    _part: float,
    x: float,
    y: float,
    heading: float,
    forward: float,
) -> tuple[float, float]:
    i, j, radius = square
    distance = math.sqrt(square_distance2(x, y, i, j))
    if distance == 0.0:
        return -radius, 0.0
    off_x = x - max(i - 0.5, min(x, i + 0.5))
    off_y = y - max(j - 0.5, min(y, j + 0.5))
    along = off_x * math.cos(heading) + off_y * math.sin(heading)
    return distance - radius, forward * along / distance


@subkernel
def _gap_to_disc(
    disc: tuple[float, float, float, float, float, float],
    part: float,
    x: float,
    y: float,
    heading: float,
    forward: float,
) -> tuple[float, float]:
    """The disc has its time, x, y, velocity per step, and the sum of the radii."""
    time, disc_x, disc_y, rate_x, rate_y, reach = disc
    off_x = x - (disc_x + (part - time) * rate_x)
    off_y = y - (disc_y + (part - time) * rate_y)
    distance = math.sqrt(off_x * off_x + off_y * off_y)
    if distance == 0.0:
        return -reach, 0.0
    along_x = forward * math.cos(heading) - rate_x
    along_y = forward * math.sin(heading) - rate_y
    return distance - reach, (off_x * along_x + off_y * along_y) / distance


_search_square = searching(_gap_to_square)
_search_disc = searching(_gap_to_disc)


@subkernel
def _gap_to_walls(
    clear: FloatGrid,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
    radius: float,
    best: float,
) -> tuple[float, float]:
    """The smallest gap to occupied squares on an arc; see `searching`."""
    end_x, end_y, _ = move(x, y, heading, forward, turn)
    length, where, exact = abs(forward), NOWHERE, EXACT * radius
    open_at_ends = least_room(clear, x, y) + least_room(clear, end_x, end_y)
    # On the way, the distance to obstacles changes by at most the way.
    if 0.5 * (open_at_ends - length) - radius >= best:
        return best, where
    # Bound on how far the arc leaves the bounding box of its two ends.
    swing = 0.5 * length * min(1.0, 0.25 * abs(turn))
    reach = min(best + radius, most_room(clear, x, y)) + swing + ROUNDING
    left, right = min(x, end_x), max(x, end_x)
    top, bottom = min(y, end_y), max(y, end_y)
    last_row = min(math.floor(bottom + reach + 0.5), clear.shape[0] - 2)
    for j in range(max(math.ceil(top - reach - 0.5), -1), last_row + 1):
        above = max(j - 0.5 - bottom, top - j - 0.5, 0.0)
        span = math.sqrt(max(reach * reach - above * above, 0.0)) + 0.5
        i = max(math.ceil(left - span), -1)
        last = min(math.floor(right + span), clear.shape[1] - 2)
        while i <= last:
            room = clear[j + 1, i + 1]
            if room > 0.0:
                # No square in this row can be nearer than the clearance.
                i += max(math.ceil(room + 0.5 - ROUNDING), 1)
                continue
            if is_edge(clear, i + 1, j + 1):
                best, part = _search_square(
                    (i, j, radius), x, y, heading, forward, turn, 0.0, 1.0, best, exact
                )
                where = where if part == NOWHERE else part
            i += 1
    return best, where


@subkernel
def _note_walls(
    clear: FloatGrid, constants: Array, state: Array, outcome: Array, found: Array
) -> None:
    if outcome[TOUCHED] == 1.0:
        keep_contact(state, found, WALL)
        return
    gap, part = _gap_to_walls(
        clear, found[FROM_X], found[FROM_Y], found[FROM_HEADING],
        state[FORWARD], state[TURN], constants[RADIUS], sought(found),
    )  # fmt: skip
    if part != NOWHERE:
        keep(state, found, gap, part, WALL)


@subkernel
def _note_mover(
    state: Array, found: Array, pieces: Array, m: int, reach: float, exact: float
) -> None:
    """Notes the smallest gap to a mover in a step without a contact."""
    row = 0
    while pieces[m, row, at.TIME] < 1.0:
        time, end = pieces[m, row, at.TIME], pieces[m, row + 1, at.TIME]
        disc = (
            time, pieces[m, row, at.FROM_X], pieces[m, row, at.FROM_Y],
            pieces[m, row, at.RATE_X], pieces[m, row, at.RATE_Y], reach,
        )  # fmt: skip
        gap, part = _search_disc(
            disc, found[FROM_X], found[FROM_Y], found[FROM_HEADING],
            state[FORWARD], state[TURN], time, end, sought(found), exact,
        )  # fmt: skip
        if part != NOWHERE:
            keep(state, found, gap, part, float(m))
        row += 1


@subkernel
def _note_movers(
    constants: Array,
    state: Array,
    traits: Array,
    now: Array,
    pieces: Array,
    found: Array,
) -> None:
    """Notes the smallest gap to movers in a step without a contact."""
    radius, length = constants[RADIUS], abs(state[FORWARD])
    for m in range(traits.shape[0]):
        off_x, off_y = now[m, at.X] - state[X], now[m, at.Y] - state[Y]
        reach = radius + traits[m, at.RADIUS]
        gap = math.sqrt(off_x * off_x + off_y * off_y) - reach
        if gap - length - traits[m, at.SPEED] * constants[DT] >= sought(found):
            continue
        if state[STEPS] == 0.0:
            # Their motion has not been planned yet.
            if gap < sought(found):
                keep(state, found, gap, 1.0, float(m))
        else:
            _note_mover(state, found, pieces, m, reach, EXACT * radius)


@subkernel
def _nearest_mover(state: Array, traits: Array, now: Array) -> tuple[float, float]:
    """Distance to the nearest mover, and its index."""
    best, nearest = math.inf, WALL
    for m in range(traits.shape[0]):
        off_x, off_y = now[m, at.X] - state[X], now[m, at.Y] - state[Y]
        gap = math.sqrt(off_x * off_x + off_y * off_y) - traits[m, at.RADIUS]
        if gap < best:
            best, nearest = gap, float(m)
    return best, nearest


@subkernel
def _gap_now(clear: FloatGrid, constants: Array, state: Array, found: Array) -> float:
    """The gap to walls where the robot is, up to `found[ENOUGH]`."""
    if found[MOST] >= found[ENOUGH]:
        return float(found[ENOUGH])
    gap, _ = _gap_to_walls(
        clear, state[X], state[Y], state[HEADING], 0.0, 0.0, constants[RADIUS],
        found[ENOUGH],
    )  # fmt: skip
    return gap


@kernel
def note_gap(words: Words, found: Array) -> None:
    """Updates the smallest gap of an episode after its reset and after each step.

    Args:
        words: As for `kernels.begin`.
        found: See `tdac_envs.drive.smallest_gap`; overwritten.
    """
    own = arrays_at(words)
    clear, constants, state, outcome = own[1], own[4], own[5], own[10]
    begin_note(state, found)
    if sought(found) > 0.0:
        _note_walls(clear, constants, state, outcome, found)
    end_note(state, found, _gap_now(clear, constants, state, found))


@kernel
def note_gap_among(words: Words, found: Array) -> None:
    """`note_gap` among movers; `words` as for `among.begin_among`."""
    own, movers = arrays_at(words), movers_at(words)
    clear, constants, state, outcome = own[1], own[4], own[5], own[10]
    traits, now, pieces = movers[0], movers[1], movers[3]
    begin_note(state, found)
    if outcome[CONTACT] >= MOVER:
        keep_contact(state, found, _nearest_mover(state, traits, now)[1])
    elif sought(found) > 0.0:
        _note_walls(clear, constants, state, outcome, found)
        _note_movers(constants, state, traits, now, pieces, found)
    gap = _gap_now(clear, constants, state, found)
    if found[MOST] < found[ENOUGH]:
        gap = min(gap, _nearest_mover(state, traits, now)[0] - constants[RADIUS])
    end_note(state, found, gap)
