"""Which kind of question comes next: it is random, repeatable, and learns."""

from collections import Counter

import numpy as np
import pytest

from tdac_agent.synthesis.bandit import Bandit
from tdac_agent.synthesis.question_kinds import ASKED, INFORMED, KINDS, REPAIR


def bandit(seed=1, kinds=ASKED):
    return Bandit(kinds, np.random.default_rng(seed))


def choices(seed, count=30, possible=ASKED):
    drawn = bandit(seed)
    return [drawn.choose(possible) for _ in range(count)]


def test_the_same_seed_makes_the_same_choices():
    """And another one makes others; all kinds come up."""
    assert choices(1) == choices(1) != choices(2)
    assert set(choices(1, 200)) == set(ASKED)


@pytest.mark.parametrize("paying", ASKED)
def test_a_kind_that_pays_is_chosen_more_often(paying):
    """After twenty answers of each kind, of which those of one kind paid."""
    learner, before = bandit(3), Counter(choices(3, 300))
    for kind in ASKED:
        for _ in range(20):
            learner.learn(kind, paid=kind == paying)
    after = Counter(learner.choose(ASKED) for _ in range(300))
    assert after[paying] > max(280, before[paying])
    assert learner.odds[paying] == max(learner.odds.values())


@pytest.mark.parametrize("kind", ASKED)
def test_what_is_possible_does_not_change_later_draws(kind):
    """So that a resumed run goes on alike, whatever was possible in between."""
    one, other = bandit(5), bandit(5)
    assert one.choose({kind}) == kind
    other.choose(ASKED)
    assert [one.choose(ASKED) for _ in range(20)] == [
        other.choose(ASKED) for _ in range(20)
    ]


def test_it_begins_with_informed_answers_ahead():
    """All other kinds are alike; what may not be asked is never chosen."""
    odds = bandit(kinds=KINDS).odds
    assert odds.pop(INFORMED) > max(odds.values())
    assert len(set(odds.values())) == 1
    few = bandit(kinds=(REPAIR,))
    assert {few.choose(KINDS) for _ in range(20)} == {REPAIR}
