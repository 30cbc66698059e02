"""Whether a candidate is clearly worse than another one, in the same episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import fmean, stdev

from scipy.stats import t as students_t

from tdac_agent.verification.judge.episode_row import EpisodeRow

LEAST_PAIRS = 8
SURE = 0.99
"""Confidence of the one-sided interval; it is looked at after each block."""


def is_clearly_worse(rows: Sequence[EpisodeRow], others: Sequence[EpisodeRow]) -> bool:
    """Whether the interval of the mean difference of the time scores is below 0.

    Args:
        rows: Episodes of a candidate.
        others: Episodes of what it is compared with.
    """
    known = {row.number: row.time_score for row in others}
    pairs = [row.time_score - known[row.number] for row in rows if row.number in known]
    if len(pairs) < LEAST_PAIRS:
        return False
    half = students_t.ppf(SURE, len(pairs) - 1) * stdev(pairs) / math.sqrt(len(pairs))
    return fmean(pairs) + float(half) < 0.0
