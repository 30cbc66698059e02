"""The test of a blind confirmation: at most one failure in a fixed number of drives."""

from __future__ import annotations

from dataclasses import dataclass

from tdac_agent.verification.judge.sequential import (
    MOST_EPISODES,
    Characteristics,
    Decision,
    SequentialTest,
)
from tdac_envs.core.arguments import whole_number

LEAST, ERROR, MOST_FAILURES = 0.95, 0.05, 1
GOOD = 0.995
"""Success rate of a controller that is to be accepted nearly always."""


@dataclass(frozen=True, slots=True)
class ConfirmingTest:
    """A single sampling plan that ends as soon as there are too many failures.

    Attributes:
        least: The success rate that is to be shown.
        error: Largest probability of accepting a lower one (exact, binomial).
        most_failures: Number of failures that are accepted.
        limit: Number of drives; see `confirming_test`.
    """

    least: float
    error: float
    most_failures: int
    limit: int

    def __post_init__(self) -> None:
        whole_number("episodes", self.limit, self.most_failures + 1, MOST_EPISODES)

    @property
    def refuse_at(self) -> float:
        """The success rate that is accepted with a probability of at most `error`."""
        return self.least

    @property
    def accept_at(self) -> float:
        """A success rate that is accepted nearly always."""
        return GOOD

    def decide(self, successes: int, failures: int, contacts: int = 0) -> Decision:
        """The decision after some drives; a contact is a failure like others."""
        del contacts
        if failures > self.most_failures:
            return "rejected"
        return "accepted" if successes + failures >= self.limit else "undecided"

    def characteristics(self, rate: float) -> Characteristics:
        """How this test decides on a controller of known success rate; exact."""
        # It goes on after n drives if not more than the accepted ones failed.
        on = [_accepted(n, self.most_failures, rate) for n in range(self.limit + 1)]
        return Characteristics(rate, on[-1], 1.0 - on[-1], 0.0, sum(on[:-1]))


EndingTest = SequentialTest | ConfirmingTest
"""A test that may end a series of episodes."""


def confirming_test(number: int = 0) -> ConfirmingTest:
    """The test of a confirmation.

    Args:
        number: Its number in a run, from 1: the k-th one has the error 0.05 / 2**k, so
            that all confirmations of a run together have at most 0.05. The number 0
            stands for a confirmation by itself, with the whole error.
    """
    error, limit = ERROR / 2**number, MOST_FAILURES + 1
    while _accepted(limit, MOST_FAILURES, LEAST) > error:
        limit += 1
    return ConfirmingTest(LEAST, error, MOST_FAILURES, limit)


def _accepted(drives: int, most_failures: int, rate: float) -> float:
    """Probability of at most so many failures."""
    from scipy.stats import binom  # slow to import

    return float(binom.cdf(most_failures, drives, 1.0 - rate))
