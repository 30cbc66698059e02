"""Exact statistics of counts, for all that reports rates and compares them."""

from __future__ import annotations

from scipy.stats import binomtest

CONFIDENCE = 0.95


def exact_interval(
    successes: int, trials: int, confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Interval of Clopper and Pearson (1934); [0, 1] without a trial."""
    if trials == 0:
        return 0.0, 1.0
    found = binomtest(successes, trials).proportion_ci(confidence, method="exact")
    return float(found.low), float(found.high)


def sign_test(ups: int, downs: int) -> float:
    """Two-sided p of so many ups and downs, if both are equally likely.

    Of discordant pairs this is McNemar's exact test; 1 where there are none.
    """
    total = ups + downs
    return float(binomtest(ups, total).pvalue) if total else 1.0
