"""Scores of an episode."""

import pytest

from tdac_envs.drive.scores import barn_score, path_score, time_score


@pytest.mark.parametrize("score", [time_score, path_score, barn_score])
def test_without_success_there_is_no_score(score):
    assert score(False, 60, 60.0) == 0.0


def test_time():
    assert time_score(True, 120, 60.0) == 0.5
    # No drive takes less than OT, but rounding may make it seem so.
    assert time_score(True, 60, 60.5) == 1.0


def test_path():
    assert path_score(True, 250.0, 200.0) == 0.8
    assert path_score(True, 199.0, 200.0) == 1.0


@pytest.mark.parametrize(
    ("steps", "score"), [(60, 0.5), (120, 0.5), (240, 0.25), (480, 0.125), (900, 0.125)]
)
def test_barn(steps, score):
    """At most 0.5, and at least 1/8 for whoever arrives."""
    assert barn_score(True, steps, 60.0) == score
