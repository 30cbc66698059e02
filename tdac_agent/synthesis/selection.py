"""Selects a candidate by successive halving on validation worlds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tdac_agent.synthesis.candidates import Candidate


def select(
    candidates: Sequence[Candidate],
    episodes: int,
    drive: Callable[[Candidate, int], None],
) -> Candidate:
    """The best candidate; of equals, the earlier one.

    In each round, all candidates drive on the same further worlds, and the better half
    stays. Each round has about the same number of episodes, the last one also those
    that are left. A single candidate drives all of them.

    Args:
        candidates: The candidates, oldest first; at least one.
        episodes: Number of episodes.
        drive: Drives a candidate on its next worlds, of this number.
    """
    left = list(candidates[:1] if episodes < 2 else _affordable(candidates, episodes))
    rounds = max(1, math.ceil(math.log2(len(left))))
    for number in range(rounds):
        # Those of earlier rounds that could not be divided are for the last one.
        share = episodes if number == rounds - 1 else episodes // (rounds - number)
        count = share // len(left)
        for candidate in left if count else ():
            drive(candidate, count)
        episodes -= count * len(left)
        left = _best(left, math.ceil(len(left) / 2), lambda each: each.score)
    return left[0]


def _affordable(candidates: Sequence[Candidate], episodes: int) -> list[Candidate]:
    """As many candidates as can drive in each round, the best on feedback worlds."""
    number = len(candidates)
    while number * max(1, math.ceil(math.log2(number))) > episodes:
        number -= 1
    return _best(candidates, number, lambda each: each.feedback_score)


def _best(
    candidates: Sequence[Candidate], number: int, score: Callable[[Candidate], float]
) -> list[Candidate]:
    """The best ones, in their order; of equals, the earlier ones."""
    ranked = sorted(candidates, key=score, reverse=True)[:number]
    return [each for each in candidates if any(each is one for one in ranked)]
