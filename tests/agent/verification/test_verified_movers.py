"""Verifications on tasks with movers: repeatable, and recorded."""

import numpy as np
import pytest
from script import STILL
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.verification.verify import load_trajectories, verify


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """The small task with three movers."""
    folder = tmp_path_factory.mktemp("moving")
    return load_task(write_small_task(folder, movers="bounce:3", horizon=100))


@pytest.mark.slow
def test_a_verification_draws_movers_from_its_seed(moving, warm, tmp_path):
    """The same seed gives the same movers, which the trajectory records."""
    kept = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        out = tmp_path / name
        verify(STILL, moving, profile="policy", seed=seed, judge=warm, out=out)
        kept.append(load_trajectories(out / "trajectories")["nominal"])
    first, same, other = (each.movers for each in kept)
    assert first.dtype == np.float32
    assert first.shape == (kept[0].steps + 1, 3, 3)
    assert (first[0, :, :2] != first[-1, :, :2]).any()
    assert np.array_equal(first, same)
    assert (first[0] != other[0]).any()
