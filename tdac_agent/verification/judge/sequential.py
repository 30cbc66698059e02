"""Wald's sequential test of a success rate, and what it gets wrong how often."""

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
MOST_EPISODES = 1_000_000
"""Of one run; each takes hundreds of bytes, and at the very least milliseconds."""


@dataclass(frozen=True, slots=True)
class Characteristics:
    """What a test does with a controller of a known rate; probabilities.

    Attributes:
        rate: The controller's.
        accepted: It is accepted.
        rejected: It is rejected.
        undecided: The episodes are used up first.
        mean_episodes: Episodes used on average.
    """

    rate: float
    accepted: float
    rejected: float
    undecided: float
    mean_episodes: float


@dataclass(frozen=True, slots=True)
class SequentialTest:
    """A sequential probability ratio test (Wald 1945), cut off at a length.

    After each episode the likelihoods of what was seen under the two rates are
    compared. The bounds are Wald's: they keep both errors near or below what is
    wanted in a test without end. Cut off, it accepts less, and so never errs more
    towards accepting; `characteristics` has what holds exactly.

    Attributes:
        accept_at: Rate from which a controller is to be accepted.
        margin: How far below it a rate is that must not be accepted. In between
            either decision is right.
        limit: Number of episodes at most.
        alpha: Wanted probability to accept at the rate that must not be accepted.
        beta: Wanted probability to reject at the rate that is to be accepted.
    """

    accept_at: float
    limit: int
    margin: float = MARGIN
    alpha: float = ALPHA
    beta: float = BETA

    def __post_init__(self) -> None:
        if not 0.0 < self.margin < self.accept_at < 1.0:
            raise TaskError(
                f"expected a rate to accept at below 1 and above the margin "
                f"{self.margin:g}, which is above 0; got {self.accept_at:g}"
            )
        if not (0.0 < self.alpha < 0.5 and 0.0 < self.beta < 0.5):
            raise TaskError("expected alpha and beta between 0 and 0.5")
        whole_number("episodes", self.limit, 1, MOST_EPISODES)
        if self.limit < self.fewest_to_accept:
            raise TaskError(
                f"to accept at {self.accept_at:g} with a margin of {self.margin:g} "
                f"takes at least {self.fewest_to_accept} episodes, and seldom so few; "
                f"got {self.limit}"
            )

    @property
    def refuse_at(self) -> float:
        """Rate that must not be accepted."""
        return round(self.accept_at - self.margin, 12)

    @property
    def bounds(self) -> tuple[float, float]:
        """Logarithms of the likelihood ratio at which to reject and to accept."""
        return (
            math.log(self.beta / (1.0 - self.alpha)),
            math.log((1.0 - self.beta) / self.alpha),
        )

    @property
    def steps(self) -> tuple[float, float]:
        """What a success and what a failure add to the logarithm of the ratio."""
        return (
            math.log(self.accept_at / self.refuse_at),
            math.log((1.0 - self.accept_at) / (1.0 - self.refuse_at)),
        )

    @property
    def fewest_to_accept(self) -> int:
        """Number of successes, and nothing else, after which it accepts."""
        return math.ceil(self.bounds[1] / self.steps[0])

    def decide(self, successes: int, failures: int) -> Decision:
        """What is decided after so many; `undecided` also means: go on."""
        success, failure = self.steps
        ratio = successes * success + failures * failure
        low, high = self.bounds
        if ratio >= high:
            return "accepted"
        return "rejected" if ratio <= low else "undecided"

    def characteristics(self, rate: float) -> Characteristics:
        """What this test does with a controller of a known rate.

        Exact, by the probabilities of each number of failures while undecided.
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
