"""Rates and their intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from tdac_agent.metrics.exact import CONFIDENCE, exact_interval
from tdac_agent.metrics.frames import Frames, iterations_of

RESAMPLES = 9_999
ASSUMPTIONS = {
    "Clopper-Pearson": (
        "independent trials with one probability; exact: holds it at least as often "
        "as it says"
    ),
    "runs resampled": (
        "independent runs of one kind, whatever goes on within each (percentile "
        "bootstrap; too narrow with few runs)"
    ),
    "Kaplan-Meier": (
        "independent runs; that money or time ended some of them has nothing to do "
        "with how near they were (Greenwood, log-log)"
    ),
    "none": "one run, none, or runs that are all alike: no interval",
}


@dataclass(frozen=True, slots=True)
class Rate:
    """A fraction with its interval.

    Attributes:
        value: The fraction; NaN where there was no trial.
        successes: Its numerator.
        trials: Its denominator.
        low: The interval's lower end; NaN where there is none.
        high: Its upper end.
        method: How the interval was made; `ASSUMPTIONS` says what that takes for
            granted.
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


def success_rate(frames: Frames, *, invalid: bool = False, seed: int = 0) -> Rate:
    """SR of the paper: valid iterations that passed, over all valid iterations.

    A run stops at its first success, so that without censoring and invalid iterations
    this is R / (tau_1 + ... + tau_R). Iterations of a run are not independent (they
    share its rules, and the last one is the one that passed), so its interval comes
    from resampling runs; where each run had just one iteration, they are independent,
    and the interval is exact.

    Args:
        frames: The runs.
        invalid: Whether iterations without a controller count, too, as failed: not
            the paper's formula, but what some of its figures show.
        seed: Of the resampling.
    """
    iterations = iterations_of(frames.candidates)
    return _over_runs(iterations[iterations["valid"] | invalid], seed)


def unbiased_success_rate(frames: Frames) -> float:
    """Probability that an iteration passes, if that is the same in all: (R-1)/(N-1).

    With N valid iterations until the R-th success SR = R/N is too high on average
    (Haldane 1945). NaN with fewer than two runs that passed, or where a run ended
    without success: N is not random in that way then.
    """
    rate = success_rate(frames)
    if rate.successes < max(2, len(frames.runs)):
        return math.nan
    return (rate.successes - 1) / (rate.trials - 1)


def first_pass(frames: Frames) -> Rate:
    """Runs whose very first candidate (k = 1, j = 0) passed: true one-shot success.

    A run whose first answer held no controller counts as one that did not.
    """
    tried = frames.candidates
    first = tried[(tried["k"] == 1) & (tried["j"] == 0)]
    return _exact(int(first["passed"].sum()), len(first))


def candidate_rate(frames: Frames, *, seed: int = 0) -> Rate:
    """Candidates (k, j) that passed, over all with a controller; runs resampled."""
    return _over_runs(frames.candidates[frames.candidates["valid"]], seed)


def solved(runs: pd.DataFrame, k: int) -> pd.Series:
    """Whether each run had a success by iteration k."""
    return runs["tau"].le(k).fillna(value=False).astype(bool)


def _exact(successes: int, trials: int) -> Rate:
    if trials == 0:
        return Rate(math.nan, 0, 0, math.nan, math.nan, "none")
    low, high = exact_interval(successes, trials)
    return Rate(successes / trials, successes, trials, low, high, "Clopper-Pearson")


def _over_runs(tries: pd.DataFrame, seed: int) -> Rate:
    """Of rows with run and passed: how many passed, each run being a unit."""
    per_run = tries.groupby("run")["passed"].agg(["sum", "size"])
    return rate_of_runs(
        per_run["sum"].to_numpy(int), per_run["size"].to_numpy(int), seed
    )


def rate_of_runs(passed: np.ndarray, tried: np.ndarray, seed: int = 0) -> Rate:
    """A rate over all tries of some runs.

    Args:
        passed: Tries of each run that passed, shape (R,).
        tried: Tries of each run, shape (R,).
        seed: Of the resampling.
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
    """Percentile interval of a ratio of sums over runs."""
    # Of runs that are alike every resample is the same: that is no certainty.
    if len(passed) < 2 or len({*zip(passed.tolist(), tried.tolist(), strict=True)}) < 2:
        return math.nan, math.nan, "none"

    def ratio(passed: np.ndarray, tried: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.asarray(passed.sum(axis=axis) / tried.sum(axis=axis))

    found = bootstrap(
        (passed, tried),
        ratio,
        paired=True,
        vectorized=True,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return float(found.low), float(found.high), "runs resampled"
