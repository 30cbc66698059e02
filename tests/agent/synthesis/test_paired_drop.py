"""A candidate stops early only if it is clearly worse in the same episodes."""

import numpy as np
import pytest
from pool_drives import FIRST, candidate_of, row_of

from tdac_agent.synthesis.paired_drop import LEAST_PAIRS, SURE, is_clearly_worse


def rows(*scores, first=0):
    return [row_of(first + number, score) for number, score in enumerate(scores)]


def test_clearly_worse():
    """Some scatter does not hide what is worse in nearly all episodes."""
    good = np.linspace(0.5, 0.9, 8)
    assert is_clearly_worse(rows(*(good - [0.1, 0.2] * 4)), rows(*good))
    assert not is_clearly_worse(rows(*good), rows(*(good - [0.1, 0.2] * 4)))


def test_too_few_pairs():
    """Seven episodes never suffice, nor does the comparison with nothing."""
    bad, good = rows(*[0.1] * 7), rows(*[0.9] * 7)
    assert LEAST_PAIRS == 8
    assert not is_clearly_worse(bad, good)
    assert not is_clearly_worse([], [])
    assert is_clearly_worse(rows(*[0.1] * 8), rows(*[0.9] * 8))


def test_equal_and_tied():
    """Ties count as no difference; one bad episode among ties is not enough."""
    good = rows(*[0.7] * 12)
    assert not is_clearly_worse(good, good)
    assert not is_clearly_worse(rows(0.0, *[0.7] * 11), good)


def test_only_common_episodes_count():
    """However bad it is in others; they are matched by number, not by place."""
    good = rows(*[0.9] * 8)
    elsewhere = rows(*[0.1] * 8, first=8)
    assert not is_clearly_worse([*good, *elsewhere], good)
    shuffled = [*reversed(rows(*np.linspace(0.1, 0.9, 8)))]
    assert not is_clearly_worse(shuffled, rows(*np.linspace(0.1, 0.9, 8)))
    worse = candidate_of(1, *[0.1] * 4, *[0.9] * 8).pool
    seven = [row for row in good if row.number < FIRST + 7]
    assert not is_clearly_worse(worse, seven)


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 16, 32])
def test_an_equal_one_is_seldom_dropped(count):
    """One look at equal candidates drops about one of a hundred."""
    random, dropped = np.random.default_rng(count), 0
    other = rows(*[0.5] * count)
    for _ in range(400):
        scores = 0.5 + random.normal(0.0, 0.1, count)
        dropped += is_clearly_worse(rows(*scores), other)
    assert dropped / 400 < 3 * (1 - SURE)
