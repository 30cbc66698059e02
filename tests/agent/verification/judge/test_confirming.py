"""The test of a blind confirmation: its numbers, decisions and error rates."""

import itertools
import math

import pytest

from tdac_agent.verification.judge.confirming import ConfirmingTest, confirming_test
from tdac_envs.core.errors import TaskError


def accepted(limit, most, rate):
    """Probability of at most so many failures, as a sum over their numbers."""
    fails = 1.0 - rate
    return sum(
        math.comb(limit, n) * fails**n * rate ** (limit - n) for n in range(most + 1)
    )


@pytest.mark.parametrize(("number", "limit"), [(0, 93), (1, 110), (2, 125), (3, 141)])
def test_the_number_of_drives(number, limit):
    """It is the least with which a controller of 95 % seldom passes."""
    test = confirming_test(number)
    error = 0.05 / 2**number
    assert (test.limit, test.error) == (limit, error)
    assert accepted(limit, 1, 0.95) <= error < accepted(limit - 1, 1, 0.95)


def test_all_confirmations_of_a_run_together_seldom_err():
    """A run that never ends accepts one below 95 % with a probability below 5 %."""
    errors = [confirming_test(number).error for number in range(1, 12)]
    assert sum(errors) < 0.05


def test_it_ends_with_the_second_failure():
    """And accepts only after all drives."""
    test = confirming_test()
    assert test.decide(40, 1) == test.decide(92, 0) == "undecided"
    assert test.decide(40, 2) == test.decide(91, 2) == "rejected"
    assert test.decide(92, 1) == test.decide(93, 0) == "accepted"


@pytest.mark.parametrize("rate", [0.3, 0.9, 1.0])
def test_characteristics_are_exact(rate):
    """They are the sums over all sequences of outcomes there are."""
    test = ConfirmingTest(0.5, 0.2, 1, 9)
    share = mean = 0.0
    for outcomes in itertools.product((True, False), repeat=test.limit):
        weight = math.prod(rate if o else 1.0 - rate for o in outcomes)
        counts, used = [0, 0], 0
        while test.decide(*counts) == "undecided":
            counts[not outcomes[used]] += 1
            used += 1
        share += weight * (test.decide(*counts) == "accepted")
        mean += weight * used
    found = test.characteristics(rate)
    assert found.accepted == pytest.approx(share, abs=1e-12)
    assert found.rejected == pytest.approx(1.0 - share, abs=1e-12)
    assert found.mean_episodes == pytest.approx(mean, abs=1e-12)


def test_a_plan_without_drives_is_refused():
    """There must be more drives than accepted failures."""
    with pytest.raises(TaskError, match="episodes"):
        ConfirmingTest(0.95, 0.05, 1, 1)
