"""Compiled crowd: people who walk to places of their own and avoid each other.

In each step, a person prefers the way along the shortest path to its place. ORCA
(`tdac_envs.movers.orca`) gives the nearest velocity that avoids its neighbours for
`HORIZON` and the walls for `WALL_HORIZON`. People share the effort of avoiding each
other; they make way for the robot, if they see it, and for movers of other kinds, as if
these kept their velocities. A wall that a person still touches stops the motion towards
it. On arrival, and when it has been stuck for some seconds, a person goes elsewhere.
"""

from __future__ import annotations

import math
from typing import Any

from tdac_envs.core.compiled import subkernel
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.movers.motion import GAP
from tdac_envs.movers.orca import (
    Array,
    add_neighbour,
    chosen_velocity,
)
from tdac_envs.movers.state import (
    CROWD,
    KIND,
    MOST_NEIGHBOURS,
    MOST_PLANES,
    NEXT_GOAL,
    NEXT_VX,
    NEXT_VY,
    OWN,
    RADIUS,
    RATE_X,
    RATE_Y,
    SEED,
    SEES,
    SPEED,
    STUCK,
    VX,
    VY,
    X,
    Y,
    begin_piece,
    end_pieces,
)
from tdac_envs.movers.walls import Cells, wall_planes

HORIZON = 2.0
"""People avoid each other's courses for this time, s."""
WALL_HORIZON = 0.3
"""A person does not get to a wall within this time, s."""
KEEP_RIGHT = 0.1
"""Angle by which people walk to the right of their way, rad."""
_COS, _SIN = math.cos(KEEP_RIGHT), math.sin(KEEP_RIGHT)
PATIENCE = 2.0
"""A person who is stuck goes elsewhere after this time, or up to twice this time, s."""
SLOW = 0.2
"""A person is stuck below this part of its speed."""
ARRIVED = 3.0
"""A person has arrived within this many radii of its place."""
ROBOT_MARGIN = 0.5
"""People keep this distance from a robot that they see, px."""
DEEPEST = 0.02
"""Deepest permitted overlap of two people, as a part of the smaller radius."""
_HOPS = 8
_MOST_SLIDES = 4
_ROBOT = -1


@subkernel
def _drawn(people: Array, m: int, count: int) -> int:
    """A number below `count`, from the next random bits of person m."""
    bits = (int(people[m, SEED]) * 1103515245 + 12345) & 0x7FFFFFFF
    people[m, SEED] = bits
    return (bits >> 8) % count


@subkernel
def _another(people: Array, m: int, goal: int, count: int) -> int:
    """Another place for person m."""
    drawn = _drawn(people, m, count - 1)
    return drawn + 1 if drawn >= goal else drawn


@subkernel
def _keep_nearest(near: Array, count: int, far2: float, who: int) -> int:
    """Inserts a neighbour in the order of distances, then numbers."""
    at = count
    if count == MOST_NEIGHBOURS:
        if far2 >= near[count - 1, 0]:
            return count
        at -= 1
    while at > 0 and far2 < near[at - 1, 0]:
        near[at, 0], near[at, 1] = near[at - 1, 0], near[at - 1, 1]
        at -= 1
    near[at, 0], near[at, 1] = far2, who
    return min(count + 1, MOST_NEIGHBOURS)


@subkernel
def _nearest_node(
    fields: FloatGrid, spacing: float, goal: int, x: float, y: float
) -> tuple[float, int, int]:
    """The node near a point with the shortest way to a place, and its length, px.

    The column of the node is -1 if no node within 2 spacings has a way.
    """
    rows, columns = fields.shape[1], fields.shape[2]
    column, row = int(x / spacing), int(y / spacing)
    best, i, j = math.inf, -1, -1
    for ring in range(3):
        for b in range(max(row - ring, 0), min(row + ring + 2, rows)):
            for a in range(max(column - ring, 0), min(column + ring + 2, columns)):
                length = fields[goal, b, a]
                length += math.hypot(a * spacing - x, b * spacing - y)
                if length < best:
                    best, i, j = length, a, b
        if i >= 0:
            break
    return best, i, j


@subkernel
def next_node(fields: FloatGrid, goal: int, i: int, j: int) -> tuple[int, int]:
    """The neighbour of a node that is nearest to a place, or itself at the place."""
    least, next_i, next_j = fields[goal, j, i], i, j
    for b in range(max(j - 1, 0), min(j + 2, fields.shape[1])):
        for a in range(max(i - 1, 0), min(i + 2, fields.shape[2])):
            if fields[goal, b, a] < least:
                least, next_i, next_j = fields[goal, b, a], a, b
    return next_i, next_j


@subkernel
def _choose(
    m: int, traits: Array, now: Array, pieces: Array, people: Array, planes: Array,
    walls: int, x: float, y: float, vx: float, vy: float, radius: float, dt: float,
    want_x: float, want_y: float,
) -> None:  # fmt: skip
    """Chooses the next velocity of person m, whose walls are in `planes`."""
    at_x, at_y, speed = now[m, X], now[m, Y], traits[m, SPEED]
    near, number = planes[2 * MOST_PLANES :], 0
    if people[m, SEES] == 1.0:
        far = radius + traits[m, RADIUS] + 2.0 * HORIZON * speed
        far2 = (x - at_x) ** 2 + (y - at_y) ** 2
        if far2 < far * far:
            number = _keep_nearest(near, number, far2, _ROBOT)
    for other in range(traits.shape[0]):
        if other == m:
            continue
        far = traits[m, RADIUS] + traits[other, RADIUS]
        far += HORIZON * (speed + traits[other, SPEED])
        far2 = (now[other, X] - at_x) ** 2 + (now[other, Y] - at_y) ** 2
        if far2 < far * far:
            number = _keep_nearest(near, number, far2, other)
    count = walls
    for k in range(number):
        other, share = int(near[k, 1]), 1.0
        if other == _ROBOT:
            off_x, off_y, rate_x, rate_y = x, y, vx, vy
            reach = radius + ROBOT_MARGIN
        else:
            off_x, off_y = now[other, X], now[other, Y]
            reach = traits[other, RADIUS]
            if traits[other, KIND] == CROWD:
                share = 0.5
                rate_x, rate_y = now[other, VX], now[other, VY]
            else:
                rate_x = pieces[other, 0, RATE_X] / dt
                rate_y = pieces[other, 0, RATE_Y] / dt
        count = add_neighbour(
            planes, count, off_x - at_x, off_y - at_y, now[m, VX], now[m, VY],
            rate_x, rate_y, reach + traits[m, RADIUS], share, HORIZON, dt,
        )  # fmt: skip
    people[m, NEXT_VX], people[m, NEXT_VY] = chosen_velocity(
        planes, walls, count, speed, want_x, want_y
    )


@subkernel
def _halt(traits: Array, now: Array, people: Array, dt: float) -> None:
    """Stops people for the step who would overlap another person.

    That happens where a dense crowd leaves no permitted velocity.
    """
    for m in range(traits.shape[0]):
        if traits[m, KIND] != CROWD:
            continue
        for other in range(traits.shape[0]):
            if other == m or traits[other, KIND] != CROWD:
                continue
            off_x, off_y = now[other, X] - now[m, X], now[other, Y] - now[m, Y]
            far2 = off_x * off_x + off_y * off_y
            least = traits[m, RADIUS] + traits[other, RADIUS]
            most = least + (traits[m, SPEED] + traits[other, SPEED]) * dt
            if far2 > most * most:
                continue
            off_x += dt * (people[other, NEXT_VX] - people[m, NEXT_VX])
            off_y += dt * (people[other, NEXT_VY] - people[m, NEXT_VY])
            then2 = off_x * off_x + off_y * off_y
            least -= DEEPEST * min(traits[m, RADIUS], traits[other, RADIUS])
            if then2 < least * least and then2 < far2:
                people[m, NEXT_VX] = people[m, NEXT_VY] = 0.0
                break


def _walking(advance_straight: Any, find_normal: Any) -> Any:
    """The subkernel `walk`; arguments as for `crowding`."""

    @subkernel
    def walk(
        obstacles: Any, traits: Array, pieces: Array, m: int, x: float, y: float,
        vx: float, vy: float, own: float, dt: float,
    ) -> None:  # fmt: skip
        """Plans the step of person m, along the walls that it touches."""
        # Who slides along a wall may sink in a little less than `GAP`.
        radius, time, row = traits[m, RADIUS] + GAP, 0.0, 0
        rate_x, rate_y = vx * dt, vy * dt
        for _ in range(_MOST_SLIDES):
            speed, heading = math.hypot(rate_x, rate_y), math.atan2(rate_y, rate_x)
            if (1.0 - time) * speed <= GAP:
                break
            row, time, x, y = advance_straight(
                obstacles, pieces, m, row, time, x, y, heading, speed, radius, own
            )  # fmt: skip
            if time >= 1.0:
                break
            away_x, away_y = find_normal(
                obstacles, x, y, radius + 2.0 * GAP, rate_x, rate_y
            )
            into = rate_x * away_x + rate_y * away_y
            if into >= 0.0:
                break
            rate_x, rate_y = rate_x - into * away_x, rate_y - into * away_y
        if time < 1.0:
            row = begin_piece(pieces, m, row, time, x, y, 0.0, 0.0, own)
        end_pieces(pieces, m, row, x, y)

    return walk


def crowding(advance_straight: Any, find_normal: Any, sees: Any) -> Any:
    """Returns the subkernel `plan_crowd` for one kind of obstacle.

    Args:
        advance_straight: From `motion.moving`.
        find_normal: As for `motion.moving`.
        sees: Subkernel `(sight, x, y, to_x, to_y)`: whether there is no obstacle in
            between.
    """

    @subkernel
    def way(
        sight: Any, fields: FloatGrid, spacing: float, goal: int, x: float, y: float
    ) -> tuple[float, float, float]:
        """Length of the way to a place, px, and the unit vector of its beginning.

        The vector points to the farthest of the next nodes that is in sight.
        """
        best, i, j = _nearest_node(fields, spacing, goal, x, y)
        if i < 0:
            return 0.0, 0.0, 0.0
        to_x, to_y = i * spacing, j * spacing
        for hop in range(_HOPS):
            next_i, next_j = next_node(fields, goal, i, j)
            if next_i == i and next_j == j:
                break
            i, j = next_i, next_j
            if hop % 2 == 1 and not sees(sight, x, y, i * spacing, j * spacing):
                break
            to_x, to_y = i * spacing, j * spacing
        off_x, off_y = to_x - x, to_y - y
        off = math.hypot(off_x, off_y)
        return (best, off_x / off, off_y / off) if off > 0.0 else (best, 0.0, 0.0)

    walk = _walking(advance_straight, find_normal)

    @subkernel
    def plan_crowd(
        obstacles: Any, sight: Any, traits: Array, now: Array, pieces: Array,
        people: Array, planes: Array, walls: Array, first: Cells, listed: Cells,
        fields: FloatGrid, spacing: Array, x: float, y: float, vx: float, vy: float,
        radius: float, dt: float,
    ) -> None:  # fmt: skip
        """Plans the motion of the people in a step; the others have been planned.

        Args:
            obstacles: First argument of `advance_straight` and `find_normal`.
            sight: First argument of `sees`.
            traits: `Movers.traits`; `now` to `planes` are those of `Movers`, too.
            now: Only read.
            pieces: Overwritten for people.
            people: Overwritten.
            planes: Overwritten.
            walls: `Places.walls`; the arrays after it are those of `Places`, too.
            first: Only read.
            listed: Only read.
            fields: Only read.
            spacing: Only read.
            x: Place of the robot at the start of the step, px.
            y: px.
            vx: Its velocity in the last step, px/s.
            vy: px/s.
            radius: Its radius, px.
            dt: Duration of the step, s.
        """
        places = fields.shape[0]
        for m in range(traits.shape[0]):
            if traits[m, KIND] != CROWD:
                continue
            speed, goal = traits[m, SPEED], int(now[m, OWN])
            at_x, at_y = now[m, X], now[m, Y]
            slow = math.hypot(now[m, VX], now[m, VY]) < SLOW * speed
            people[m, STUCK] = people[m, STUCK] + dt if slow else 0.0
            patience = PATIENCE * (1.0 + (int(people[m, SEED]) & 0xFF) / 256.0)
            length, to_x, to_y = way(sight, fields, spacing[0], goal, at_x, at_y)
            if length < ARRIVED * traits[m, RADIUS] or people[m, STUCK] > patience:
                goal = _another(people, m, goal, places)
                people[m, STUCK] = 0.0
                length, to_x, to_y = way(sight, fields, spacing[0], goal, at_x, at_y)
            # y points down.
            want_x = speed * (_COS * to_x - _SIN * to_y)
            want_y = speed * (_SIN * to_x + _COS * to_y)
            number = wall_planes(
                walls, first, listed, at_x, at_y, traits[m, RADIUS], speed,
                WALL_HORIZON, planes,
            )  # fmt: skip
            _choose(
                m, traits, now, pieces, people, planes, number, x, y, vx, vy, radius,
                dt, want_x, want_y,
            )  # fmt: skip
            people[m, NEXT_GOAL] = goal
        # The second time for those who stand in the way of the first ones.
        for _ in range(2):
            _halt(traits, now, people, dt)
        for m in range(traits.shape[0]):
            if traits[m, KIND] == CROWD:
                walk(
                    obstacles, traits, pieces, m, now[m, X], now[m, Y],
                    people[m, NEXT_VX], people[m, NEXT_VY], people[m, NEXT_GOAL], dt,
                )  # fmt: skip

    return plan_crowd
