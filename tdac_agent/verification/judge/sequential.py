"""Wald's sequential test of a success rate, and its exact error probabilities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError

Decision = Literal["accepted", "rejected", "undecided"]
ALPHA = BETA = 0.05
MARGIN = 0.05
CLEAN = 0.99
"""Share of drives without a contact from which a controller should be accepted."""
MOST_EPISODES = 1_000_000
"""Limit of one run; each episode takes hundreds of bytes and at least milliseconds."""


@dataclass(frozen=True, slots=True)
class Characteristics:
    """How a test decides on a controller of known success rate.

    Attributes:
        rate: Success rate of the controller.
        accepted: Probability that it is accepted.
        rejected: Probability that it is rejected.
        undecided: Probability that the episodes are used up first.
        mean_episodes: Mean number of episodes used.
    """

    rate: float
    accepted: float
    rejected: float
    undecided: float
    mean_episodes: float


@dataclass(frozen=True, slots=True)
class SequentialTest:
    """A sequential probability ratio test (Wald 1945) with a limit of episodes.

    After each episode it compares the likelihoods of the results under two success
    rates: `accept_at` and `refuse_at`. Wald's bounds keep both errors near or below
    alpha and beta in a test without a limit. The limit can only lower the probability
    of accepting; `characteristics` computes the exact probabilities.

    Attributes:
        accept_at: Success rate from which a controller should be accepted.
        limit: Maximum number of episodes.
        margin: Difference between `accept_at` and `refuse_at`, the rate that must not
            be accepted. In between, either decision is right.
        alpha: Target probability of accepting at `refuse_at`.
        beta: Target probability of rejecting at `accept_at`.
        contact: A test of the share of drives without a contact, which must accept,
            too. It can only lower the probability of accepting.
    """

    accept_at: float
    limit: int
    margin: float = MARGIN
    alpha: float = ALPHA
    beta: float = BETA
    contact: SequentialTest | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < self.accept_at < 1.0:
            raise TaskError(
                f"the rate to accept at must be below 1 and above the margin, and the "
                f"margin above 0; got {self.accept_at:g} and margin {self.margin:g}"
            )
        if not (0.0 < self.alpha < 0.5 and 0.0 < self.beta < 0.5):
            raise TaskError("alpha and beta must be between 0 and 0.5")
        whole_number("episodes", self.limit, 1, MOST_EPISODES)
        if self.limit < self.fewest_to_accept:
            raise TaskError(
                f"to accept at {self.accept_at:g} with a margin of {self.margin:g} "
                f"takes at least {self.fewest_to_accept} episodes, usually more; "
                f"got {self.limit}"
            )

    @property
    def refuse_at(self) -> float:
        """The success rate that must not be accepted."""
        return round(self.accept_at - self.margin, 12)

    @property
    def bounds(self) -> tuple[float, float]:
        """Log likelihood ratios at which to reject and to accept."""
        return (
            math.log(self.beta / (1.0 - self.alpha)),
            math.log((1.0 - self.beta) / self.alpha),
        )

    @property
    def steps(self) -> tuple[float, float]:
        """What a success and a failure add to the log likelihood ratio."""
        return (
            math.log(self.accept_at / self.refuse_at),
            math.log((1.0 - self.accept_at) / (1.0 - self.refuse_at)),
        )

    @property
    def fewest_to_accept(self) -> int:
        """Number of successes without a failure after which it accepts."""
        return math.ceil(self.bounds[1] / self.steps[0])

    def decide(self, successes: int, failures: int, contacts: int = 0) -> Decision:
        """The decision after some episodes, some of whose failures are contacts."""
        success, failure = self.steps
        ratio = successes * success + failures * failure
        low, high = self.bounds
        own: Decision = "undecided"
        if ratio >= high:
            own = "accepted"
        elif ratio <= low:
            own = "rejected"
        if self.contact is None or own == "rejected":
            return own
        other = self.contact.decide(successes + failures - contacts, contacts)
        return own if other == "accepted" else other

    def characteristics(self, rate: float) -> Characteristics:
        """How this test decides on a controller of known success rate.

        Exact, if there is no test of contacts: after each episode, sums the
        probabilities of all numbers of failures at which the test decides, and keeps
        those at which it continues.
        """
        (success, failure), (low, high) = self.steps, self.bounds
        open_, failures = np.ones(1), np.zeros(1)
        accepted = rejected = mean = 0.0
        for episodes in range(1, self.limit + 1):
            mean += float(open_.sum())
            open_ = np.convolve(open_, (rate, 1.0 - rate))
            failures = np.append(failures, failures[-1] + 1.0)
            ratio = (episodes - failures) * success + failures * failure
            accepted += float(open_[ratio >= high].sum())
            rejected += float(open_[ratio <= low].sum())
            between = (low < ratio) & (ratio < high)
            open_, failures = open_[between], failures[between]
            if not len(open_):
                break
        return Characteristics(rate, accepted, rejected, float(open_.sum()), mean)
