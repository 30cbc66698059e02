"""Exact statistics of counts, used wherever rates are reported or compared."""

from __future__ import annotations

from scipy.special import bdtr, betaincinv  # scipy.stats is slow to import

CONFIDENCE = 0.95


def exact_interval(
    successes: int, trials: int, confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Clopper-Pearson interval (1934) of a success rate; [0, 1] without trials."""
    tail = (1.0 - confidence) / 2.0
    failures = trials - successes
    low = betaincinv(successes, failures + 1, tail) if successes else 0.0
    high = betaincinv(successes + 1, failures, 1.0 - tail) if failures else 1.0
    return float(low), float(high)


def sign_test(ups: int, downs: int) -> float:
    """Two-sided p-value of the exact sign test; 1 if both counts are 0.

    For the counts of discordant pairs this is McNemar's exact test.
    """
    return min(1.0, 2.0 * float(bdtr(min(ups, downs), ups + downs, 0.5)))
