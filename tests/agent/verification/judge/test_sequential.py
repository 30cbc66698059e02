"""The sequential test: its decisions, and its error rates against two oracles."""

import itertools
import math

import numpy as np
import pytest

from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_envs.core.errors import TaskError

RATES = (0.05, 0.4, 0.6, 0.75, 0.9, 1.0)


def run_through(test, outcomes):
    """Decision on a sequence of outcomes, and how many of them it took."""
    successes = failures = 0
    for outcome in outcomes:
        successes, failures = successes + outcome, failures + (not outcome)
        decision = test.decide(successes, failures)
        if decision != "undecided":
            return decision, successes + failures
    return "undecided", successes + failures


def enumerated(test, rate):
    """Probability of each decision and mean length, summed over every sequence."""
    shares = dict.fromkeys(("accepted", "rejected", "undecided"), 0.0)
    mean = 0.0
    for outcomes in itertools.product((True, False), repeat=test.limit):
        weight = math.prod(rate if o else 1.0 - rate for o in outcomes)
        decision, used = run_through(test, outcomes)
        shares[decision] += weight
        mean += weight * used
    return shares, mean


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("limit", [8, 13])
def test_characteristics_are_exact(limit, rate):
    """They are the sums over all sequences of outcomes there are."""
    test = SequentialTest(0.9, limit, margin=0.3)
    found = test.characteristics(rate)
    shares, mean = enumerated(test, rate)
    for decision, share in shares.items():
        assert getattr(found, decision) == pytest.approx(share, abs=1e-12)
    assert found.mean_episodes == pytest.approx(mean, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("accept_at", "margin"), [(0.95, 0.05), (0.9, 0.2), (0.5, 0.2)]
)
def test_simulated_controllers_fare_as_said(accept_at, margin):
    """Of 4000 drawn sequences the shares are within four standard errors."""
    test = SequentialTest(accept_at, 150, margin)
    random = np.random.default_rng(1)
    for rate in (test.refuse_at, accept_at):
        found = test.characteristics(rate)
        drawn = random.random((4000, test.limit)) < rate
        decisions = [run_through(test, row.tolist()) for row in drawn]
        for name in ("accepted", "rejected", "undecided"):
            share = getattr(found, name)
            error = math.sqrt(share * (1.0 - share) / len(drawn))
            seen = sum(decision == name for decision, _ in decisions) / len(drawn)
            assert abs(seen - share) <= 4.0 * error + 1e-9
        used = np.array([count for _, count in decisions])
        error = used.std() / math.sqrt(len(used))
        assert abs(used.mean() - found.mean_episodes) <= 4.0 * error + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("accept_at", [0.5, 0.9, 0.95, 0.99])
def test_errors_keep_to_walds_bounds(accept_at, margin):
    """Whatever the limit, it rarely accepts what it must not; without, nor the other.

    Wald's inequalities: alpha' <= alpha / (1 - beta), beta' <= beta / (1 - alpha).
    """
    fewest = SequentialTest(accept_at, 3000, margin).fewest_to_accept
    for limit in (fewest, 2 * fewest, 3000):
        test = SequentialTest(accept_at, limit, margin)
        bad = test.characteristics(test.refuse_at)
        good = test.characteristics(accept_at)
        assert bad.accepted <= test.alpha / (1.0 - test.beta)
        assert good.rejected <= test.beta / (1.0 - test.alpha)
        for found in (bad, good):
            total = found.accepted + found.rejected + found.undecided
            assert total == pytest.approx(1.0)
            assert fewest * found.accepted <= found.mean_episodes <= limit


def test_a_better_controller_is_accepted_more_often():
    """The probability to be accepted rises with the rate, from 0 to 1."""
    test = SequentialTest(0.95, 400)
    accepted = [test.characteristics(rate).accepted for rate in np.linspace(0, 1, 41)]
    assert accepted[0] == 0.0
    assert accepted[-1] == 1.0
    assert np.all(np.diff(accepted) >= -1e-12)


def test_fewest_to_accept_is_what_it_takes():
    """So many successes without a failure accept, and one less does not."""
    for accept_at in (0.5, 0.9, 0.95, 0.99):
        test = SequentialTest(accept_at, 1000)
        fewest = test.fewest_to_accept
        assert test.decide(fewest, 0) == "accepted"
        assert test.decide(fewest - 1, 0) == "undecided"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"accept_at": 1.0}, "below 1"),
        ({"accept_at": 0.05}, "above the margin"),
        ({"accept_at": float("nan")}, "below 1"),
        ({"margin": 0.0}, "above 0"),
        ({"limit": 54}, "at least 55 episodes.* got 54"),
        ({"limit": 0}, "whole number from 1"),
        ({"alpha": 0.5}, "alpha"),
    ],
)
def test_what_cannot_be_tested_is_refused(arguments, reason):
    """Rates without an answer, and limits at which it could never accept."""
    with pytest.raises(TaskError, match=reason):
        SequentialTest(**{"accept_at": 0.95, "limit": 200, **arguments})
