"""Successive halving: the best of the candidates, within the episodes."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.selection import select
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_agent.synthesis.world_trials import BLOCKS, first_world


def chosen(scores, episodes):
    """The selected number among candidates of constant scores, and their episodes."""
    candidates = [Candidate(k, 0, "", Path()) for k in range(len(scores))]

    def drive(candidate, count):
        row = SimpleNamespace(time_score=scores[candidate.k])
        candidate.validation.extend([row] * count)

    best = select(candidates, episodes, drive)
    return best.k, [len(each.validation) for each in candidates]


def test_the_best_one_drives_most():
    best, driven = chosen([0.1, 0.5, 0.2, 0.9, 0.3, 0.4, 0.6, 0.7], 64)
    assert best == 3
    assert driven == [2, 2, 2, 18, 2, 7, 7, 18] or max(driven) == driven[3]
    assert sum(driven) <= 64


def test_ties_go_to_the_earlier_one():
    assert chosen([0.5, 0.8, 0.8], 64)[0] == 1
    assert chosen([0.0, 0.0, 0.0, 0.0], 64)[0] == 0


@pytest.mark.parametrize("number", range(1, 40))
@pytest.mark.parametrize("episodes", [1, 2, 7, 64, 200])
def test_the_episodes_are_never_exceeded(number, episodes):
    """And nearly all of them are used; everybody of a round has as many."""
    scores = [((7 * i) % number) / number for i in range(number)]
    _, driven = chosen(scores, episodes)
    assert 0 < sum(driven) <= episodes
    assert episodes - sum(driven) < number


def test_a_single_candidate_drives_all_episodes():
    assert chosen([0.2], 64) == (0, [64])


def test_feedback_and_validation_worlds_are_apart():
    """Also the blocks of two runs, with overwhelming probability."""
    firsts = [first_world(seed, 0) for seed in range(100)]
    assert all(0 <= first < BLOCKS - MOST_EPISODES for first in firsts)
    assert first_world(1, 0) == first_world(1, 0)
    assert len(set(firsts)) == 100
