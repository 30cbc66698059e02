"""Where a score was lost: shares by cause, which add up to what is missing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.verification.diagnosis.losses import Losses, losses_of
from tdac_envs.drive.scores import time_score

STEP, TURN = 2.0, 0.4


def driven(moves):
    """The trajectory of a robot that drives arcs of given lengths and turns."""
    x = y = heading = 0.0
    poses = [(x, y, heading)]
    for length, turn in moves:
        chord = length * np.sinc(turn / (2.0 * np.pi))
        x += chord * np.cos(heading + turn / 2.0)
        y += chord * np.sin(heading + turn / 2.0)
        heading += turn
        poses.append((x, y, heading))
    count = len(moves)
    return Trajectory(
        np.array(poses),
        np.zeros((count, 2), np.float32),
        np.zeros(count + 1),
        np.zeros((count + 1, 1), np.float32),
        collisions=0,
        dt=0.1,
    )


def lost(moves, least, *, success=True):
    return losses_of(driven(moves), STEP, TURN, least, success=success)


FULL, HALF, BACK = (STEP, 0.0), (STEP / 2, 0.0), (-STEP, 0.0)
STOP, SPIN = (0.0, 0.0), (0.0, TURN)


@pytest.mark.parametrize(
    ("moves", "cause"),
    [
        ([FULL] * 10 + [STOP] * 10, "standing"),
        ([FULL] * 10 + [SPIN] * 10, "turning"),
        ([HALF] * 20, "slower"),
        ([FULL] * 20, "detour"),
        ([BACK] * 20, "detour"),
        ([FULL] * 10 + [BACK] * 10, "reversing"),
    ],
)
def test_causes(moves, cause):
    """Of 20 steps where 10 suffice, half the score is lost by what was done wrong."""
    assert lost(moves, 10).by_cause == pytest.approx({**dict(Losses()), cause: 0.5})


def test_failure():
    """A failure loses all, whatever the robot did."""
    assert lost([FULL] * 3, 10, success=False) == Losses(failure=1.0)


def test_nothing_lost():
    """A drive in the least time loses nothing."""
    assert lost([FULL] * 10, 10) == Losses()


@given(
    st.lists(
        st.tuples(st.floats(-STEP, STEP), st.floats(-TURN, TURN)),
        min_size=1,
        max_size=60,
    ),
    st.floats(0.5, 70.0),
    st.booleans(),
)
def test_sum(moves, least, success):
    """The shares are never negative, and add up to what the score lacks."""
    found = lost(moves, least, success=success)
    missing = 1.0 - time_score(success, len(moves), least)
    assert found.total == pytest.approx(missing, abs=1e-7)
    assert min(found.by_cause.values()) >= 0.0
