"""Exact statistics of counts, used wherever rates are reported or compared."""

from __future__ import annotations

from scipy.stats import binomtest

CONFIDENCE = 0.95


def exact_interval(
    successes: int, trials: int, confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Clopper-Pearson interval (1934) of a success rate; [0, 1] without trials."""
    if trials == 0:
        return 0.0, 1.0
    found = binomtest(successes, trials).proportion_ci(confidence, method="exact")
    return float(found.low), float(found.high)


def sign_test(ups: int, downs: int) -> float:
    """Two-sided p-value of the exact sign test; 1 if both counts are 0.

    For the counts of discordant pairs this is McNemar's exact test.
    """
    total = ups + downs
    return float(binomtest(ups, total).pvalue) if total else 1.0
