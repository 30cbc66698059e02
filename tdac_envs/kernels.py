"""Compiled step of TDAC-Map2D-v0: motion up to a contact, rays, way to the goal.

All functions work on a *padded* map; see `tdac_envs.rays`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.compiled import kernel
from tdac_envs.contact import first_contact, move, wrap_angle
from tdac_envs.grid import BoolGrid, FloatGrid
from tdac_envs.rays import cast_ray, cast_rays, pad, sees

__all__ = [
    "advance",
    "cast_ray",
    "cast_rays",
    "drive",
    "first_contact",
    "move",
    "pad",
    "path_distance",
    "sees",
    "sense",
    "wrap_angle",
]

# A body that was stopped by an obstacle goes back by this much of its way, px, so
# that the next step starts outside it.
CONTACT_GAP = 1e-6

# Entries of `constants` and `state` of `drive`.
AXLE, MAX_SPEED, DT, RADIUS, FAN, RANGE_MAX, GOAL_X, GOAL_Y, TOLERANCE, LAG = range(10)
X, Y, HEADING, REMAINING = range(4)


@kernel("b1[:,:] f4[:,:] f8[:] f8 f8 f8 f8 f8 -> b1")
def advance(
    cells: BoolGrid,
    clear: FloatGrid,
    state: NDArray[np.float64],
    left: float,
    right: float,
    axle: float,
    dt: float,
    radius: float,
) -> bool:
    """Moves the robot by one step at constant wheel speeds, up to a contact.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        state: Begins with x, y (px) and heading (rad), which are overwritten.
        left: Speed of the left wheel, px/s.
        right: Speed of the right wheel, px/s.
        axle: Distance of the wheels, px.
        dt: Duration, s.
        radius: Body radius, px.

    Returns:
        Whether the body touched an obstacle. It then stands `CONTACT_GAP` before
        the touching pose, with the heading it had there.
    """
    forward = 0.5 * (left + right) * dt
    # y points down, so a positive turn is clockwise on the screen.
    turn = (left - right) * dt / axle
    x, y, heading = state[X], state[Y], state[HEADING]
    touch = first_contact(cells, clear, x, y, heading, forward, turn, radius)
    part = 1.0
    if touch <= 1.0:
        part = max(touch - CONTACT_GAP / abs(forward), 0.0)
    x, y, heading = move(x, y, heading, part * forward, part * turn)
    state[X], state[Y], state[HEADING] = x, y, wrap_angle(heading)
    return bool(touch <= 1.0)


@kernel("b1[:,:] f4[:,:] f4[:,:] f8 f8 f8 -> f8")
def path_distance(
    cells: BoolGrid,
    clear: FloatGrid,
    field: FloatGrid,
    x: float,
    y: float,
    previous: float,
) -> float:
    """Length of the shortest path to the goal from any point, px.

    The least sum of the way to a nearby pixel in sight and that pixel's distance.
    Where no pixel within 2 px has a path (the body is squeezed into a corner),
    `previous`.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        field: Shape (height, width), float32, from `plan.distance_field`.
        x: Column, px.
        y: Row, px.
        previous: Value to fall back to.
    """
    height, width = field.shape
    column, row = math.floor(x), math.floor(y)
    for ring in range(3):
        best = math.inf
        for j in range(max(row - ring, 0), min(row + ring + 2, height)):
            for i in range(max(column - ring, 0), min(column + ring + 2, width)):
                through = field[j, i] + math.hypot(x - i, y - j)
                # The four pixels around a point are never behind a wall.
                if through < best and (ring == 0 or sees(cells, clear, x, y, i, j)):
                    best = through
        if best < math.inf:
            return best
    return previous


@kernel("b1[:,:] f4[:,:] f8[:] f8[:] f4[:] f4[:] ->")
def sense(
    cells: BoolGrid,
    clear: FloatGrid,
    constants: NDArray[np.float64],
    state: NDArray[np.float64],
    pose: NDArray[np.float32],
    ranges: NDArray[np.float32],
) -> None:
    """Fills `pose` and `ranges` with what the robot observes; see `drive`."""
    x, y, heading = state[X], state[Y], state[HEADING]
    pose[0], pose[1], pose[2] = x, y, heading
    cast_rays(cells, clear, x, y, heading, constants[FAN], constants[RANGE_MAX], ranges)


@kernel("b1[:,:] f4[:,:] f4[:,:] f8[:] f8[:] f8[:] f4[:] f4[:] f4[:] f8[:] ->")
def drive(
    cells: BoolGrid,
    clear: FloatGrid,
    field: FloatGrid,
    constants: NDArray[np.float64],
    command: NDArray[np.float64],
    state: NDArray[np.float64],
    pose: NDArray[np.float32],
    wheel_speeds: NDArray[np.float32],
    ranges: NDArray[np.float32],
    outcome: NDArray[np.float64],
) -> None:
    """One step of the environment, all of it but the random numbers.

    Args:
        cells: Padded map, True = occupied.
        clear: Padded clearance, px.
        field: Shape (height, width), float32: way to the goal, px.
        constants: Shape (10,), float64: axle length (px), wheel limit (px/s), dt (s),
            body radius (px), field of view (rad), range limit (px), goal x and y
            (px), goal tolerance (px), and the share of its speed that a wheel keeps
            from one step to the next.
        command: Shape (4,), float64: wanted speed of the left and of the right wheel,
            in [-1, 1]; for each the factor between its speed and what it does on the
            ground.
        state: Shape (4,), float64: x, y (px), heading (rad) and the way left to the
            goal (px); overwritten.
        pose: Shape (3,), float32, overwritten with what the robot observes.
        wheel_speeds: Shape (2,), float32, fractions as last applied; overwritten.
        ranges: Shape (n_rays,), float32, overwritten.
        outcome: Shape (5,), float64, overwritten: whether the body touched an obstacle
            (0 or 1); whether the goal is reached; the way left to the goal, the
            straight distance to it, and the clearance of the pixel under the robot, px.
    """
    left, right, slip_left, slip_right = command[0], command[1], command[2], command[3]
    lag, limit = constants[LAG], constants[MAX_SPEED]
    wheel_speeds[0] = left + lag * (wheel_speeds[0] - left)
    wheel_speeds[1] = right + lag * (wheel_speeds[1] - right)
    touched = advance(
        cells,
        clear,
        state,
        limit * min(max(wheel_speeds[0] * slip_left, -1.0), 1.0),
        limit * min(max(wheel_speeds[1] * slip_right, -1.0), 1.0),
        constants[AXLE],
        constants[DT],
        constants[RADIUS],
    )
    sense(cells, clear, constants, state, pose, ranges)
    x, y, goal_x, goal_y = state[X], state[Y], constants[GOAL_X], constants[GOAL_Y]
    state[REMAINING] = path_distance(cells, clear, field, x, y, state[REMAINING])
    gap = math.hypot(goal_x - x, goal_y - y)
    reached = gap <= constants[TOLERANCE] and sees(cells, clear, x, y, goal_x, goal_y)
    room = clear[math.floor(y + 1.5), math.floor(x + 1.5)]
    outcome[0], outcome[1], outcome[2] = touched, reached, state[REMAINING]
    outcome[3], outcome[4] = gap, room
