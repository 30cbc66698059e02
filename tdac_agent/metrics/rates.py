"""Success rates and their confidence intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tdac_agent.metrics.exact import CONFIDENCE, exact_interval

if TYPE_CHECKING:
    # Slow to import, and no report on episodes needs it.
    import pandas as pd

    from tdac_agent.metrics.frames import RunFrames

RESAMPLES = 9_999
ASSUMPTIONS = {
    "Clopper-Pearson": (
        "independent trials with the same probability of success; exact: covers the "
        "true value at least as often as stated"
    ),
    "runs resampled": (
        "independent runs of one kind, with any dependence within a run (percentile "
        "bootstrap; too narrow with few runs)"
    ),
    "Kaplan-Meier": (
        "independent runs; whether budget, time or a fault ended a run does not depend "
        "on how close it was to success (Greenwood, log-log)"
    ),
    "none": "no interval: fewer than two runs, or all runs have the same counts",
}


@dataclass(frozen=True, slots=True)
class Rate:
    """A success rate with its interval.

    Attributes:
        value: Fraction of successes; NaN without trials.
        successes: Number of successes.
        trials: Number of trials.
        low: Lower end of the interval; NaN if there is no interval.
        high: Upper end of the interval; NaN if there is no interval.
        method: How the interval was computed, a key of `ASSUMPTIONS`.
    """

    value: float
    successes: int
    trials: int
    low: float
    high: float
    method: str

    def __str__(self) -> str:
        if math.isnan(self.value):
            return "–"
        if math.isnan(self.low):
            return f"{self.value:.2f}"
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def success_rate(frames: RunFrames, *, invalid: bool = False, seed: int = 0) -> Rate:
    """SR of the paper: the fraction of valid iterations that passed.

    A run stops at its first success, so that without censored runs and invalid
    iterations SR is R / (tau_1 + ... + tau_R). The iterations of a run are not
    independent (they share rules, and only the last one can pass), so the interval is
    computed by resampling runs. If each run had one iteration, the interval is exact.

    Args:
        frames: The runs.
        invalid: Whether iterations without a controller also count, as failed. This is
            not the paper's formula, but some of its figures count this way.
        seed: Seed of the resampling.
    """
    from tdac_agent.metrics.frames import iterations_of

    iterations = iterations_of(frames.candidates)
    return _over_runs(iterations[iterations["valid"] | invalid], seed)


def unbiased_success_rate(frames: RunFrames) -> float:
    """Unbiased estimate of the probability that an iteration passes: (R-1)/(N-1).

    Assumes the same probability in all iterations. For N valid iterations up to the
    R-th success, SR = R/N is too high on average (Haldane 1945). NaN with fewer than
    two successes, or if a run ended without success: N is not negative binomial then.
    """
    rate = success_rate(frames)
    if rate.successes < max(2, len(frames.runs)):
        return math.nan
    return (rate.successes - 1) / (rate.trials - 1)


def first_pass(frames: RunFrames) -> Rate:
    """Fraction of runs whose first candidate (k = 1, j = 0) passed: one-shot success.

    A run whose first answer had no controller counts as failed.
    """
    tried = frames.candidates
    first = tried[(tried["k"] == 1) & (tried["j"] == 0)]
    return _exact(int(first["passed"].sum()), len(first))


def candidate_rate(frames: RunFrames, *, seed: int = 0) -> Rate:
    """Fraction of candidates (k, j) that passed, among those with a controller."""
    return _over_runs(frames.candidates[frames.candidates["valid"]], seed)


def solved(runs: pd.DataFrame, k: int) -> pd.Series:
    """Whether each run succeeded by iteration k."""
    return runs["tau"].le(k).fillna(value=False).astype(bool)


def _exact(successes: int, trials: int) -> Rate:
    if trials == 0:
        return Rate(math.nan, 0, 0, math.nan, math.nan, "none")
    low, high = exact_interval(successes, trials)
    return Rate(successes / trials, successes, trials, low, high, "Clopper-Pearson")


def _over_runs(tries: pd.DataFrame, seed: int) -> Rate:
    """Pass rate of rows with the columns `run` and `passed`, resampled by run."""
    per_run = tries.groupby("run")["passed"].agg(["sum", "size"])
    return rate_of_runs(
        per_run["sum"].to_numpy(int), per_run["size"].to_numpy(int), seed
    )


def rate_of_runs(passed: np.ndarray, tried: np.ndarray, seed: int = 0) -> Rate:
    """Pass rate over all tries of some runs.

    Args:
        passed: Number of tries that passed, by run, shape (R,).
        tried: Number of tries, by run, shape (R,).
        seed: Seed of the resampling.
    """
    successes, trials = int(passed.sum()), int(tried.sum())
    if trials and (tried == 1).all():
        return _exact(successes, trials)
    value = successes / trials if trials else math.nan
    low, high, method = _resampled(passed, tried, seed)
    return Rate(value, successes, trials, low, high, method)


def _resampled(
    passed: np.ndarray, tried: np.ndarray, seed: int
) -> tuple[float, float, str]:
    """Percentile interval of a ratio of sums over runs, and its method."""
    # Resamples of identical runs are identical: the interval would have no width.
    if len(passed) < 2 or len({*zip(passed.tolist(), tried.tolist(), strict=True)}) < 2:
        return math.nan, math.nan, "none"

    def ratio(passed: np.ndarray, tried: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.asarray(passed.sum(axis=axis) / tried.sum(axis=axis))

    from scipy.stats import bootstrap  # slow to import

    interval = bootstrap(
        (passed, tried),
        ratio,
        paired=True,
        vectorized=True,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return float(interval.low), float(interval.high), "runs resampled"
