"""The arrays of the movers of one robot, which the compiled step reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_MOVERS = 256
"""Largest number of movers of a robot."""
MOST_PIECES = 16
"""Largest number of straight pieces in a mover's motion within a step."""
ROUTE, BOUNCE = range(2)
"""Kinds of movers, in `traits`."""

# Columns of `Movers.traits`.
KIND, RADIUS, SPEED, FIRST, COUNT = range(5)
N_TRAITS = 5
# Columns of `Movers.now`.
X, Y, VX, VY, OWN = range(5)
N_NOW = 5
# Columns of `Movers.pieces`.
TIME, FROM_X, FROM_Y, RATE_X, RATE_Y, STATE = range(6)
N_PIECE = 6
# Columns of `Movers.path`; the first three are those of `Movers.pieces`.
HEADING, FORWARD, TURN = range(3, 6)
MOST_ARCS = 108
"""Rows of `Movers.path`; `tdac_envs.drive.sliding` needs at most 3 * 34 + 1."""
STANDING_SECONDS = 0.5
"""A robot stands if it has hardly moved in this time."""


class Movers(NamedTuple):
    """Arrays of n movers and of the robot among them; float64.

    Times within a step are fractions of it, from 0 to 1.

    Attributes:
        traits: Shape (n, 5): kind; radius (px); speed (px/s); of a route, the row of
            its first way-point in `points` and their number, else 0.
        now: Shape (n, 5): x, y (px); velocity at the end of the last step (px/s); what
            a kind remembers: of a route, the number of the next way-point; of a
            bouncing disc, its heading (rad).
        points: Shape (k, 2): way-points of all routes, px. Each is driven in a circle;
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
    """

    traits: Array
    now: Array
    points: Array
    pieces: Array
    path: Array
    past: Array

    @classmethod
    def blank(cls, count: int, points: Array, dt: float) -> Movers:
        """Arrays of `count` movers for steps of `dt` s; all zeros but the points."""
        steps = max(round(STANDING_SECONDS / dt), 1)
        return cls(
            np.zeros((count, N_TRAITS)),
            np.zeros((count, N_NOW)),
            np.ascontiguousarray(points, np.float64).reshape(-1, 2),
            np.zeros((count, MOST_PIECES + 2, N_PIECE)),
            np.zeros((MOST_ARCS, N_PIECE)),
            np.zeros((steps, 2)),
        )

    @classmethod
    def none(cls) -> Movers:
        """No movers."""
        return cls.blank(0, np.zeros((0, 2)), STANDING_SECONDS)

    def fresh(self) -> Movers:
        """Copies of these arrays, for an episode that begins with them."""
        return Movers(*(array.copy() for array in self))

    def discs(self) -> Array:
        """x, y and radius of each mover, shape (n, 3), px; a copy."""
        return np.column_stack([self.now[:, :2], self.traits[:, RADIUS]])
