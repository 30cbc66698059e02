"""The mover that a robot touched: where it came from, and for how long it was seen.

Lengths and headings are in units of the screen; see `tdac_agent.tasks.units`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.parts import Surroundings
from tdac_agent.tasks.units import Point
from tdac_agent.verification.diagnosis.motion import forward, wheels_turn
from tdac_envs.drive.task import Pose
from tdac_envs.movers.state import STANDING_SECONDS

APPROACH = 0.5
"""A mover came from the direction of its motion in this time before the contact, s."""
_SIDES = "ahead", "the right", "behind", "the left"
# A mover whose motion is within this cosine of straight away was driven into.
_AWAY = 0.5
# Below this part of full speed, a robot turns in place.
_CREEPING = 0.02
_FULL = 0.995


@dataclass(frozen=True, slots=True)
class MoverTouch:
    """The mover that is nearest to the body at the end of an episode.

    Attributes:
        number: Its number, from 0.
        place: Its nearest point (x, y).
        bearing: Angle from the heading to that point, rad, right positive.
        gap: Gap between body and mover.
    """

    number: int
    place: Point
    bearing: float
    gap: float


def nearest_mover(trajectory: Trajectory, body: float) -> MoverTouch | None:
    """Returns the mover nearest to the body at the end; None without movers.

    Args:
        trajectory: Trajectory of the episode.
        body: Radius of the body.
    """
    if trajectory.movers is None or not trajectory.movers.shape[1]:
        return None
    x, y, heading = trajectory.poses[-1].tolist()
    discs = trajectory.movers[-1].astype(np.float64)
    gaps = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2] - body
    number = int(gaps.argmin())
    to_x, to_y, radius = discs[number].tolist()
    angle = math.atan2(to_y - y, to_x - x)
    return MoverTouch(
        number,
        (to_x - radius * math.cos(angle), to_y - radius * math.sin(angle)),
        math.remainder(angle - heading, math.tau),
        float(gaps[number]),
    )


def where_from(trajectory: Trajectory, number: int) -> str:
    """Side of the robot from which a mover came: `ahead`, `the left` ….

    One that stood, or moved away, came from where it was at last.
    """
    assert trajectory.movers is not None
    since = max(trajectory.steps - max(round(APPROACH / trajectory.dt), 1), 0)
    places = trajectory.movers[:, number, :2].astype(np.float64)
    moved = places[-1] - places[since]
    off = places[-1] - trajectory.poses[-1, :2]
    away = float(moved @ off) / max(float(np.hypot(*off)), 1e-9)
    length = float(np.hypot(*moved))
    origin = off if length < 1e-3 or away > _AWAY * length else -moved
    bearing = math.atan2(origin[1], origin[0]) - float(trajectory.poses[-1, 2])
    return _SIDES[round(bearing / (math.pi / 2.0)) % 4]


def time_in_sight(around: Surroundings, trajectory: Trajectory, number: int) -> str:
    """Says for how long a mover had been in sight: `had been in sight for 0.8 s`."""
    assert trajectory.movers is not None
    seen = (
        around.in_sight(Pose(*pose), (x, y), radius)
        for pose, (x, y, radius) in zip(
            trajectory.poses[::-1].tolist(),
            trajectory.movers[::-1, number].tolist(),
            strict=True,
        )
    )
    dt, unseen = trajectory.dt, 0
    for visible, stretch in groupby(seen):
        steps = len(list(stretch))
        if not visible:
            unseen = steps
        elif unseen:
            return f"had been in sight until {unseen * dt:.1f} s before"
        else:
            return f"had been in sight for {(steps - 1) * dt:.1f} s"
    return "was never in sight"


def how_it_drove(trajectory: Trajectory, *, stood: bool) -> str:
    """Says what the robot did in its last step: `drove at 0.6 of its speed`."""
    if not wheels_turn(trajectory)[-1]:
        return "stood"
    if stood:
        return f"had hardly moved for {STANDING_SECONDS:g} s"
    speed = float(forward(trajectory)[-1])
    if abs(speed) < _CREEPING:
        return "turned in place"
    way = "drove backwards" if speed < 0.0 else "drove"
    part = f"{abs(speed):.2g} of its speed" if abs(speed) < _FULL else "full speed"
    return f"{way} at {part}"
