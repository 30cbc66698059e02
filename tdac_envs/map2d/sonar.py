"""A model of ultrasonic sensors: wide beams, and echoes that do not come back.

Rays spread over the beam, and the nearest that comes back is the reading. A ray that
meets a surface at more than 22.5 degrees from its normal is reflected away and lost, as
in Webots' `DistanceSensor` of the type `sonar` (reference manual, "Sonar Sensors"). A
beam of 30 degrees is usual for ultrasonic sensors of robots (R. R. Murphy, Introduction
to AI Robotics, section 6.5).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import kernel, read_only, subkernel
from tdac_envs.grid.grid import FloatGrid
from tdac_envs.map2d.rays import LeapGrid, cast_ray
from tdac_envs.map2d.terrain import Terrain

Array = NDArray[np.float64]

BEAM = math.radians(30.0)
"""Whole angle of a beam."""
SPREAD = 9
"""Rays of a beam."""
INCIDENCE = math.pi / 8
"""Largest angle from the normal of a surface at which a ray comes back."""
NOISE = 0.05
"""Default relative standard deviation of a reading."""
REACH = 3
"""The normal of a wall follows from the pixels up to here from the hit, px."""


class Sonar:
    """The sonars of a robot.

    Args:
        angles: Angles of their axes from the heading, rad.
        range_max: Reading without an echo, px.
    """

    def __init__(self, angles: Array, range_max: float) -> None:
        self._axes = read_only(angles)
        self._range_max = float(range_max)

    def read(
        self, terrain: Terrain, state: Array, discs: Array, out: NDArray[np.float32]
    ) -> None:
        """Fills `out` with the readings at a pose.

        Args:
            terrain: The map.
            state: Begins with x, y (px) and heading (rad).
            discs: Movers, shape (n, 3): x, y, radius, px.
            out: Shape (count,), px.
        """
        x, y, heading = state[:3].tolist()
        _read(
            terrain.leaps, terrain.padded_clear, self._axes, discs,
            x, y, heading, self._range_max, out,
        )  # fmt: skip


@kernel
def _read(
    leaps: LeapGrid,
    clear: FloatGrid,
    axes: Array,
    discs: Array,
    x: float,
    y: float,
    heading: float,
    range_max: float,
    out: NDArray[np.float32],
) -> None:
    least = math.cos(INCIDENCE)
    for i in range(out.shape[0]):
        nearest = range_max
        for k in range(SPREAD):
            angle = heading + axes[i] + BEAM * (k / (SPREAD - 1) - 0.5)
            dx, dy = math.cos(angle), math.sin(angle)
            wall = cast_ray(leaps, x, y, angle, range_max)
            mover, at_mover = _to_disc(discs, x, y, dx, dy)
            if mover < wall:
                if mover < nearest and at_mover >= least:
                    nearest = mover
            elif wall < nearest:
                # A little before the hit, the ray is in the free pixel next to it.
                before = max(wall - 0.01, 0.0)
                if _facing(clear, x + before * dx, y + before * dy, dx, dy) >= least:
                    nearest = wall
        out[i] = nearest


@subkernel
def _to_disc(
    discs: Array, x: float, y: float, dx: float, dy: float
) -> tuple[float, float]:
    """Distance along a ray to the nearest disc, and the cosine of the incidence."""
    nearest, facing = math.inf, 0.0
    for k in range(discs.shape[0]):
        to_x, to_y, radius = discs[k, 0] - x, discs[k, 1] - y, discs[k, 2]
        along, aside = to_x * dx + to_y * dy, to_y * dx - to_x * dy
        rest = radius * radius - aside * aside
        if along <= 0.0 or rest <= 0.0:
            continue
        hit = max(along - math.sqrt(rest), 0.0)
        if hit < nearest:
            nearest, facing = hit, math.sqrt(rest) / radius
    return nearest, facing


@subkernel
def _facing(clear: FloatGrid, x: float, y: float, dx: float, dy: float) -> float:
    """Cosine of the angle between a ray and the normal of the wall that it meets.

    The normal is that along which the clearance grows in the pixels around, so that
    the steps of a slanted wall count as one surface; 0 without a direction.
    """
    row, column = math.floor(y + 1.5), math.floor(x + 1.5)
    out_x = out_y = 0.0
    for j in range(max(row - REACH, 0), min(row + REACH + 1, clear.shape[0])):
        for i in range(max(column - REACH, 0), min(column + REACH + 1, clear.shape[1])):
            out_x += (i - column) * clear[j, i]
            out_y += (j - row) * clear[j, i]
    length = math.hypot(out_x, out_y)
    return -(out_x * dx + out_y * dy) / length if length > 0.0 else 0.0


def noise_of(sensor: str, given: float | None) -> float:
    """The relative noise of ranges that a user asks for.

    Args:
        sensor: `"rays"` or `"sonar"`.
        given: As given; None for the default of the sensor.
    """
    if given is not None:
        return given
    return NOISE if sensor == "sonar" else 0.0
