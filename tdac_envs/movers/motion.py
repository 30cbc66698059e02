"""Compiled motion of discs within a step: along routes, and bouncing off walls.

`tdac_envs.movers` describes the phases of a step.
"""

from __future__ import annotations

import math
from typing import Any

from tdac_envs.core.compiled import subkernel
from tdac_envs.movers.state import (
    BOUNCE,
    COUNT,
    FIRST,
    KIND,
    MOST_PIECES,
    OWN,
    RADIUS,
    ROUTE,
    SPEED,
    Array,
    X,
    Y,
    begin_piece,
    end_pieces,
)

GAP = 1e-6
"""A disc stops or bounces at this distance along its motion before a wall, px."""


@subkernel
def follow_route(
    traits: Array, now: Array, points: Array, pieces: Array, m: int, dt: float
) -> None:
    """Plans the step of a mover on a route: from waypoint to waypoint."""
    x, y, goal = now[m, X], now[m, Y], int(now[m, OWN])
    first, count = int(traits[m, FIRST]), int(traits[m, COUNT])
    length = traits[m, SPEED] * dt
    time, row, drives = 0.0, 0, count > 1 and length > 0.0
    while drives and row < MOST_PIECES - 1:
        to_x, to_y = points[first + goal, 0], points[first + goal, 1]
        off_x, off_y = to_x - x, to_y - y
        far, rest = math.sqrt(off_x * off_x + off_y * off_y), 1.0 - time
        scale = length / far if far > 0.0 else 0.0
        rate_x, rate_y = scale * off_x, scale * off_y
        if far > 0.0:
            row = begin_piece(pieces, m, row, time, x, y, rate_x, rate_y, float(goal))
        if far > rest * length:
            end_pieces(pieces, m, row, x + rest * rate_x, y + rest * rate_y)
            return
        x, y, time = to_x, to_y, min(time + far / length, 1.0)
        goal = (goal + 1) % count
    row = begin_piece(pieces, m, row, time, x, y, 0.0, 0.0, float(goal))
    end_pieces(pieces, m, row, x, y)


def moving(find_contact: Any, find_normal: Any) -> tuple[Any, Any, Any]:
    """Returns the subkernels `plan`, `plan_one` and `advance_straight`.

    They are those for one kind of obstacle.

    Args:
        find_contact: Subkernel `(obstacles, x, y, heading, forward, turn, radius)` that
            returns the fraction of an arc at which the disc first touches an obstacle,
            or 2.0.
        find_normal: Subkernel `(obstacles, x, y, reach, vx, vy)` that returns the unit
            vector to a point from the nearest obstacle within `reach` that is in the
            way of a velocity, or (0, 0).
    """

    @subkernel
    def advance_straight(
        obstacles: Any,
        pieces: Array,
        m: int,
        row: int,
        time: float,
        x: float,
        y: float,
        heading: float,
        speed: float,
        radius: float,
        own: float,
    ) -> tuple[int, float, float, float]:
        """Plans a piece of mover m that lasts until the next wall or the step's end.

        Args:
            obstacles: First argument of `find_contact`.
            pieces: `Movers.pieces`.
            m: The mover.
            row: Number of the piece.
            time: Fraction of the step at which it begins.
            x: Place there, px.
            y: px.
            heading: rad.
            speed: px per step.
            radius: px.
            own: Last entry of `Movers.now` during the piece.

        Returns:
            The row of the next piece, the fraction of the step at which this piece
            ends (1.0 without a contact), and the place there.
        """
        length = speed * (1.0 - time)
        part = find_contact(obstacles, x, y, heading, length, 0.0, radius)
        part = max(part - GAP / length, 0.0) if part <= 1.0 else 1.0
        rate_x, rate_y = speed * math.cos(heading), speed * math.sin(heading)
        since = part * (1.0 - time)
        if since > 0.0:
            row = begin_piece(pieces, m, row, time, x, y, rate_x, rate_y, own)
        end = time + since if part < 1.0 else 1.0
        return row, end, x + since * rate_x, y + since * rate_y

    @subkernel
    def bounce(
        obstacles: Any, traits: Array, now: Array, pieces: Array, m: int, dt: float
    ) -> None:
        """Plans the step of a disc that bounces off obstacles, elastically.

        After `MOST_PIECES` bounces within a step it stands until the next step.
        """
        x, y, heading = now[m, X], now[m, Y], now[m, OWN]
        radius, speed = traits[m, RADIUS], traits[m, SPEED] * dt
        time, row = 0.0, 0
        for _ in range(MOST_PIECES - 1):
            if speed == 0.0:
                break
            row, time, x, y = advance_straight(
                obstacles, pieces, m, row, time, x, y, heading, speed, radius, heading
            )  # fmt: skip
            if time >= 1.0:
                break
            vx, vy = math.cos(heading), math.sin(heading)
            away_x, away_y = find_normal(obstacles, x, y, radius + 2.0 * GAP, vx, vy)
            into = vx * away_x + vy * away_y
            # Where it came from there is room.
            vx, vy = (
                (vx - 2.0 * into * away_x, vy - 2.0 * into * away_y)
                if into < 0.0
                else (-vx, -vy)
            )
            heading = math.atan2(vy, vx)
        if time < 1.0:
            row = begin_piece(pieces, m, row, time, x, y, 0.0, 0.0, heading)
        end_pieces(pieces, m, row, x, y)

    @subkernel
    def plan_one(
        obstacles: Any, traits: Array, now: Array, points: Array, pieces: Array,
        m: int, dt: float,
    ) -> None:  # fmt: skip
        """Plans the step of mover m on a route or bouncing; arguments as for `plan`."""
        if traits[m, KIND] == ROUTE:
            follow_route(traits, now, points, pieces, m, dt)
        elif traits[m, KIND] == BOUNCE:
            bounce(obstacles, traits, now, pieces, m, dt)

    @subkernel
    def plan(
        obstacles: Any, traits: Array, now: Array, points: Array, pieces: Array,
        dt: float,
    ) -> None:  # fmt: skip
        """Plans the motion of these movers in a step of `dt` s, without the robot.

        Args:
            obstacles: First argument of `find_contact` and `find_normal`.
            traits: `Movers.traits`; the arrays after it are those of `Movers`, too.
            now: Only read.
            points: Only read.
            pieces: Overwritten.
            dt: Duration of the step, s.
        """
        for m in range(traits.shape[0]):
            plan_one(obstacles, traits, now, points, pieces, m, dt)

    return plan, plan_one, advance_straight
