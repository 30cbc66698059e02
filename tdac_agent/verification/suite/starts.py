"""The jittered starts of a verification: few, so they are chosen at the margins."""

from __future__ import annotations

import numpy as np

from tdac_agent.tasks.setting import Nominal
from tdac_envs.drive.task import JITTER_HEADING, Pose

JITTERS = 5
DRAWS = 64
# Signs of the offset in x, in y and of the turn. Each pair of two signs comes once, so
# that what fails at one end of two of them is met, whatever the third is.
CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))


def spread_starts(task: Nominal, seed: int, count: int) -> tuple[Pose, ...]:
    """Starts of the jitter variation, the first four of them at its margins.

    A controller that fails at a margin would often pass a few independent starts.
    Each of the four is the one of several draws that is nearest to its corner; those
    after them are plain draws.

    Args:
        task: The nominal task.
        seed: Of the draws.
        count: Number of starts.
    """
    random = np.random.default_rng(seed)
    drawn = [task.jittered(random) for _ in range(DRAWS + count)]
    offsets = np.array([_offset(task, pose) for pose in drawn[:DRAWS]])
    # The disc's rim in a diagonal direction, and the greatest turn.
    corners = np.array(CORNERS[:count]) * (np.sqrt(0.5), np.sqrt(0.5), 1.0)
    at_margins = [
        drawn[int(np.linalg.norm(offsets - corner, axis=1).argmin())]
        for corner in corners
    ]
    return tuple((at_margins + drawn[DRAWS:])[:count])


def _offset(task: Nominal, pose: Pose) -> tuple[float, float, float]:
    """Where a start lies in the variation: each entry in [-1, 1]."""
    nominal, radius = task.start, task.body_radius
    turn = np.remainder(pose.heading - nominal.heading + np.pi, 2 * np.pi) - np.pi
    return (
        (pose.x - nominal.x) / radius,
        (pose.y - nominal.y) / radius,
        float(turn) / JITTER_HEADING,
    )
