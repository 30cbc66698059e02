"""Jittered starts of a verification: there are few, so most lie at the limits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tdac_agent.tasks.setting import Nominal
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import JITTER_HEADING, MAX_DRAWS, Pose

JITTERS = 5
DRAWS = 64
# Signs of the offsets in x, y and heading. For any two of them, each combination of
# signs occurs once, so that a failure which depends on two of them is found.
CORNERS = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))


def spread_starts(
    task: Nominal,
    seed: int,
    count: int,
    allows: Callable[[Pose], bool] = lambda _: True,
) -> tuple[Pose, ...]:
    """Returns starts of the jitter variation, the first four at its limits.

    A controller that fails at the limits would often pass a few independent starts.
    Each of the four is the draw nearest to its corner; the others are plain draws.

    Args:
        task: The nominal task.
        seed: Seed of the draws.
        count: Number of starts.
        allows: Whether an episode may begin at a start; others are drawn again.

    Raises:
        TaskError: No episode may begin at any start that is drawn.
    """
    random = np.random.default_rng(seed)
    drawn = [_draw(task, random, allows) for _ in range(DRAWS + count)]
    offsets = np.array([_offset(task, pose) for pose in drawn[:DRAWS]])
    # The rim of the disc of offsets in a diagonal direction, and the largest turn.
    corners = np.array(CORNERS[:count]) * (np.sqrt(0.5), np.sqrt(0.5), 1.0)
    at_margins = [
        drawn[int(np.linalg.norm(offsets - corner, axis=1).argmin())]
        for corner in corners
    ]
    return tuple((at_margins + drawn[DRAWS:])[:count])


def episode_seed(seed: int, number: int) -> int:
    """Returns the seed of all that the environment draws in an episode.

    Args:
        seed: Seed of the verification.
        number: Number of the start.
    """
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])


def _draw(
    task: Nominal, random: np.random.Generator, allows: Callable[[Pose], bool]
) -> Pose:
    for _ in range(MAX_DRAWS):
        start = task.jittered(random)
        if allows(start):
            return start
    raise TaskError(
        "a mover reaches the robot at each jittered start within 2 s; move one of them"
    )


def _offset(task: Nominal, pose: Pose) -> tuple[float, float, float]:
    """Returns the offset of a start, with each entry scaled to [-1, 1]."""
    nominal, radius = task.start, task.body_radius
    turn = np.remainder(pose.heading - nominal.heading + np.pi, 2 * np.pi) - np.pi
    return (
        (pose.x - nominal.x) / radius,
        (pose.y - nominal.y) / radius,
        float(turn) / JITTER_HEADING,
    )
