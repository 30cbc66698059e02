"""Compiled motion of a disc that slides along obstacles instead of stopping.

The motion is the limit of rigid-body dynamics with dry friction in which the tyres
reach their speed immediately. Up to a contact, the robot follows its arc exactly. In
contact, its wheels slip: the body keeps turning as commanded and loses its velocity
component into the obstacle. Friction between its rim and the obstacle changes its
tangential velocity by at most `friction` times the lost component, until the rim no
longer slides. The body never moves faster than commanded. In a corner, where every
velocity would lead into an obstacle, it turns on the spot.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import subkernel
from tdac_envs.drive.stepping import HEADING, Array, X, Y, move, wrap_angle

MOST_NORMALS = 16
"""Largest number of contacts considered at a time."""
_FEWEST_PIECES, _MOST_PIECES, _TURN_OF_A_PIECE = 8, 32, 0.1
_INTO = -1e-9


@subkernel
def _forget(
    obstacles: Any,
    row: int,
    time: float,
    x: float,
    y: float,
    heading: float,
    forward: float,
    turn: float,
) -> None:
    """Notes nothing."""


def sliding(find_contact: Any, find_normals: Any, note: Any = _forget) -> Any:
    """Returns the subkernel `slide` for one kind of obstacle.

    Args:
        find_contact: Subkernel `(obstacles, x, y, heading, forward, turn, radius)` that
            returns the fraction of an arc at which the disc first touches an obstacle,
            or 2.0.
        find_normals: Subkernel `(obstacles, x, y, reach, normals)` that writes the unit
            vectors away from the obstacles within `reach` of a point, shape
            (`MOST_NORMALS`, 2), and returns their number.
        note: Subkernel `(obstacles, row, time, x, y, heading, forward, turn)` that is
            called for each arc of the motion, in their order, and for its end: the
            number of the arc; the fraction of the step at which it begins; the pose
            there; speed and turn, per step.
    """

    @subkernel
    def slide(
        obstacles: Any,
        state: Array,
        forward: float,
        turn: float,
        radius: float,
        friction: float,
        gap: float,
    ) -> bool:
        """Moves a disc for one step; it slides along obstacles that are in its way.

        Args:
            obstacles: First argument of the functions of `sliding`.
            state: Begins with x, y (any unit of length) and heading (rad); overwritten.
            forward: Length of the commanded arc, negative backwards.
            turn: Commanded change of heading, rad.
            radius: Radius of the disc.
            friction: Coulomb friction coefficient between disc and obstacles.
            gap: Distance along its motion at which the disc stops before an obstacle.

        Returns:
            Whether an obstacle was in the way.
        """
        x, y, heading = state[X], state[Y], state[HEADING]
        pieces = math.ceil(abs(turn) / _TURN_OF_A_PIECE)
        piece = 1.0 / min(max(pieces, _FEWEST_PIECES), _MOST_PIECES)
        rest, touched, row = 1.0, False, 0
        while rest > 0.0:
            arc, bend = rest * forward, rest * turn
            note(obstacles, row, 1.0 - rest, x, y, heading, forward, turn)
            row += 1
            part = find_contact(obstacles, x, y, heading, arc, bend, radius)
            if part > 1.0:
                x, y, heading = move(x, y, heading, arc, bend)
                break
            touched = True
            part = max(part - gap / abs(arc), 0.0)
            x, y, heading = move(x, y, heading, part * arc, part * bend)
            rest -= part * rest
            share = min(piece, rest)
            normals = np.empty((MOST_NORMALS, 2))
            count = find_normals(obstacles, x, y, radius + 2.0 * gap, normals)
            along_x, along_y = slide_velocity(
                forward, heading + 0.5 * share * turn, radius * turn, friction,
                normals[:count],
            )  # fmt: skip
            length = share * math.sqrt(along_x * along_x + along_y * along_y)
            if length > 0.0:
                bearing = math.atan2(along_y, along_x)
                part = find_contact(obstacles, x, y, bearing, length, 0.0, radius)
                part = max(part - gap / length, 0.0) if part <= 1.0 else 1.0
                note(obstacles, row, 1.0 - rest, x, y, bearing, length / share, 0.0)
                x, y, _ = move(x, y, bearing, part * length, 0.0)
                row += 1
            else:
                part = 0.0
            note(obstacles, row, 1.0 - rest + part * share, x, y, heading, 0.0, 0.0)
            row += 1
            heading += share * turn
            rest -= share
        note(obstacles, row, 1.0, x, y, heading, 0.0, 0.0)
        state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
        return touched

    return slide


@subkernel
def slide_velocity(
    forward: float,
    heading: float,
    rim: float,
    friction: float,
    normals: NDArray[np.float64],
) -> tuple[float, float]:
    """The velocity of a disc in contact with obstacles; see the module docstring.

    Args:
        forward: Commanded speed, negative backwards.
        heading: rad.
        rim: Commanded speed of the rim due to turning, positive counter-clockwise.
        friction: Coulomb friction coefficient.
        normals: Shape (n, 2): unit vectors from the obstacles to the disc.
    """
    to_x, to_y = forward * math.cos(heading), forward * math.sin(heading)
    is_blocked, best, best_x, best_y = False, -math.inf, 0.0, 0.0
    for i in range(normals.shape[0]):
        away_x, away_y = normals[i, 0], normals[i, 1]
        into = to_x * away_x + to_y * away_y
        if into >= 0.0:
            continue
        is_blocked = True
        along = to_y * away_x - to_x * away_y
        slip = along - rim
        along -= math.copysign(min(-friction * into, abs(slip)), slip)
        along = min(max(along, -abs(forward)), abs(forward))
        x, y = -away_y * along, away_x * along
        agrees = x * to_x + y * to_y
        if agrees > best and not _enters(x, y, abs(forward), normals):
            best, best_x, best_y = agrees, x, y
    return (best_x, best_y) if is_blocked else (to_x, to_y)


@subkernel
def _enters(x: float, y: float, speed: float, normals: NDArray[np.float64]) -> bool:
    """Whether a velocity leads into an obstacle."""
    for j in range(normals.shape[0]):
        if x * normals[j, 0] + y * normals[j, 1] < _INTO * speed:
            return True
    return False
