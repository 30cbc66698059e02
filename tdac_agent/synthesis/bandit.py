"""Which kind of question a race asks next: it learns what paid in this run."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from tdac_agent.synthesis.question_kinds import INFORMED

PRIOR = {INFORMED: (2.0, 1.0)}
"""Successes and failures, plus 1 each, that a kind begins with: in a first trial,
informed answers were ahead of repairs. The others begin with (1, 1)."""


class Bandit:
    """Thompson sampling with a Beta distribution for each kind.

    A question has paid if its answer is better, on the worlds that both drove on, than
    what it was to improve.

    Args:
        kinds: The kinds that may be asked.
        random: Draws.
    """

    def __init__(self, kinds: Collection[str], random: np.random.Generator) -> None:
        self._random = random
        self._counts = {kind: PRIOR.get(kind, (1.0, 1.0)) for kind in kinds}

    def choose(self, possible: Collection[str]) -> str:
        """The kind to ask now.

        Args:
            possible: Kinds for which there is something to ask about; at least one.
        """
        # All draws, so that what is possible does not change later ones.
        draws = {
            kind: float(self._random.beta(a, b))
            for kind, (a, b) in self._counts.items()
        }
        return max((kind for kind in draws if kind in possible), key=draws.__getitem__)

    def learn(self, kind: str, *, paid: bool) -> None:
        """Notes whether a question of a kind has paid."""
        a, b = self._counts[kind]
        self._counts[kind] = (a + paid, b + (not paid))

    @property
    def odds(self) -> dict[str, float]:
        """The mean of the distribution of each kind."""
        return {kind: a / (a + b) for kind, (a, b) in self._counts.items()}
