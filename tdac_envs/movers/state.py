"""The arrays of the movers of one robot, and what reads and writes their pieces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import subkernel
from tdac_envs.movers.destinations import Destinations
from tdac_envs.movers.orca import N_PLANE
from tdac_envs.movers.walls import MOST_WALLS, Cells

Array = NDArray[np.float64]

MOST_PIECES = 16
"""Largest number of straight pieces in a mover's motion within a step."""
ROUTE, BOUNCE, CROWD = range(3)
"""Kinds of movers, in `traits`."""

# Columns of `Movers.traits`.
KIND, RADIUS, SPEED, FIRST, COUNT = range(5)
N_TRAITS = 5
# Columns of `Movers.now`.
X, Y, VX, VY, OWN = range(5)
N_NOW = 5
# Columns of `Movers.people`.
SEES, SEED, STUCK, NEXT_VX, NEXT_VY, NEXT_GOAL = range(6)
N_PEOPLE = 6
MOST_NEIGHBOURS = 10
"""A person takes notice of this many others, the nearest ones."""
MOST_PLANES = MOST_WALLS + MOST_NEIGHBOURS
"""Largest number of half-planes that limit the velocity of a person."""
# Columns of `Movers.pieces`.
TIME, FROM_X, FROM_Y, RATE_X, RATE_Y, STATE = range(6)
N_PIECE = 6
# Columns of `Movers.path`; the first three are those of `Movers.pieces`.
HEADING, FORWARD, TURN = range(3, 6)
MOST_ARCS = 108
"""Rows of `Movers.path`; `tdac_envs.drive.sliding` needs at most 3 * 34 + 1."""
STANDING_SECONDS = 0.5
"""A robot stands if it has hardly moved in this time."""


_N_ROWS = 2 * MOST_PLANES + MOST_NEIGHBOURS
_CHANGING = "now", "pieces", "path", "past", "people", "planes"


class Movers(NamedTuple):
    """Arrays of n movers and of the robot among them; float64.

    Times within a step are fractions of it, from 0 to 1.

    Attributes:
        traits: Shape (n, 5): kind; radius (px); speed (px/s); of a route, the row of
            its first waypoint in `points` and their number, else 0.
        now: Shape (n, 5): x, y (px); velocity at the end of the last step (px/s); what
            a kind remembers: of a route, the number of the next waypoint; of a
            bouncing disc, its heading (rad); of a person, the number of its place.
        points: Shape (k, 2): waypoints of all routes, px. Each is driven in a circle;
            one that goes back and forth also lists the way back.
        pieces: Shape (n, `MOST_PIECES` + 2, 6): motion in the current step. A row has
            the time at which a piece begins, x, y (px), velocity (px per step), and the
            last entry of `now` during the piece. The row after the last piece has the
            time 1.
        path: Shape (`MOST_ARCS`, 6): motion of the robot in the current step. A row has
            the time at which an arc begins, x, y (px), heading (rad), speed (px per
            step) and turn (rad per step). The row after the last arc has the time 1.
        past: Shape (s, 2): positions of the robot at the starts of the last steps, px,
            a ring buffer over `STANDING_SECONDS`.
        people: Shape (n, 6), (0, 6) without a crowd: whether a person sees the robot;
            the state of its random numbers; for how long it has been stuck (s); its
            velocity (px/s) and place in the current step.
        planes: Shape (2 * `MOST_PLANES` + `MOST_NEIGHBOURS`, 4), or (0, 4): scratch.
        walls: The last five arrays are those of `Destinations`, which are only read.
        first: See `Destinations`.
        listed: See `Destinations`.
        fields: See `Destinations`.
        spacing: See `Destinations`.
    """

    traits: Array
    now: Array
    points: Array
    pieces: Array
    path: Array
    past: Array
    people: Array
    planes: Array
    walls: Array
    first: Cells
    listed: Cells
    fields: NDArray[np.float32]
    spacing: Array

    @classmethod
    def blank(
        cls,
        count: int,
        points: Array,
        dt: float,
        destinations: Destinations | None = None,
    ) -> Movers:
        """Arrays of `count` movers for steps of `dt` s; all zeros but what is given.

        Args:
            count: Number of movers.
            points: Waypoints.
            dt: Duration of a step, s.
            destinations: What people know of the map; None without a crowd.
        """
        steps = max(round(STANDING_SECONDS / dt), 1)
        people, rows = (0, 0) if destinations is None else (count, _N_ROWS)
        return cls(
            np.zeros((count, N_TRAITS)),
            np.zeros((count, N_NOW)),
            np.ascontiguousarray(points, np.float64).reshape(-1, 2),
            np.zeros((count, MOST_PIECES + 2, N_PIECE)),
            np.zeros((MOST_ARCS, N_PIECE)),
            np.zeros((steps, 2)),
            np.zeros((people, N_PEOPLE)),
            np.zeros((rows, N_PLANE)),
            *(Destinations.none() if destinations is None else destinations),
        )

    @classmethod
    def none(cls) -> Movers:
        """No movers."""
        return cls.blank(0, np.zeros((0, 2)), STANDING_SECONDS)

    def fresh(self) -> Movers:
        """These movers with own arrays, for an episode that begins with them."""
        own = {name: getattr(self, name).copy() for name in _CHANGING}
        return self._replace(**own)

    def discs(self) -> Array:
        """x, y and radius of each mover, shape (n, 3), px; a copy."""
        return np.column_stack([self.now[:, :2], self.traits[:, RADIUS]])


@subkernel
def begin_piece(
    pieces: Array,
    m: int,
    row: int,
    time: float,
    x: float,
    y: float,
    rate_x: float,
    rate_y: float,
    own: float,
) -> int:
    """Writes a piece of the motion of mover m; returns the row of the next piece.

    Args:
        pieces: `Movers.pieces`.
        m: The mover.
        row: Number of the piece.
        time: Fraction of the step at which the piece begins.
        x: Place there, px.
        y: px.
        rate_x: Velocity, px per step.
        rate_y: px per step.
        own: Last entry of `Movers.now` during the piece.
    """
    pieces[m, row, TIME] = time
    pieces[m, row, FROM_X], pieces[m, row, FROM_Y] = x, y
    pieces[m, row, RATE_X], pieces[m, row, RATE_Y] = rate_x, rate_y
    pieces[m, row, STATE] = own
    return row + 1


@subkernel
def end_pieces(pieces: Array, m: int, row: int, x: float, y: float) -> None:
    """Ends the motion of mover m at a place: `row` is the one after the last piece."""
    begin_piece(pieces, m, row, 1.0, x, y, 0.0, 0.0, pieces[m, row - 1, STATE])


@subkernel
def place_at(pieces: Array, m: int, time: float) -> tuple[int, float, float]:
    """The piece in which mover m is at a fraction of the step, and its place, px."""
    row = 0
    while pieces[m, row + 1, TIME] < time:
        row += 1
    since = time - pieces[m, row, TIME]
    return (
        row,
        pieces[m, row, FROM_X] + since * pieces[m, row, RATE_X],
        pieces[m, row, FROM_Y] + since * pieces[m, row, RATE_Y],
    )


@subkernel
def hold(pieces: Array, m: int, time: float) -> None:
    """Stops mover m from a fraction of the step until the end of the step."""
    row, x, y = place_at(pieces, m, time)
    own = pieces[m, row, STATE]
    row = begin_piece(pieces, m, row + 1, time, x, y, 0.0, 0.0, own)
    end_pieces(pieces, m, row, x, y)


@subkernel
def stop(now: Array, pieces: Array, m: int, time: float, dt: float) -> None:
    """Moves mover m to its place at a fraction of the step of `dt` s."""
    row, x, y = place_at(pieces, m, time)
    now[m, X], now[m, Y] = x, y
    now[m, VX], now[m, VY] = pieces[m, row, RATE_X] / dt, pieces[m, row, RATE_Y] / dt
    now[m, OWN] = pieces[m, row, STATE]
