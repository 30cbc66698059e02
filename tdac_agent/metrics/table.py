"""Table of metrics with one row per kind of run."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from tdac_agent.metrics.exact import exact_interval
from tdac_agent.metrics.frames import RunFrames
from tdac_agent.metrics.rates import (
    Rate,
    candidate_rate,
    first_pass,
    solved,
    success_rate,
    unbiased_success_rate,
)

KIND = ("learner", "optimizer", "task", "prompt", "setting")


def summarise(frames: RunFrames, by: Sequence[str] = KIND) -> pd.DataFrame:
    """Computes the metrics of each kind of run.

    Args:
        frames: The runs.
        by: Columns of `runs` that define a kind.

    Returns:
        A row per kind: the columns of `by`; R, passed (all tests), verified (by a blind
        confirmation), censored (numbers of runs);
        sr, sr_low, sr_high (runs resampled); sr_unbiased; first_pass with _low and
        _high (exact); cs_K, the fraction of the uncensored runs that were solved, with
        _low and _high (exact); candidate_rate; tau_mean (of runs that passed);
        tokens_per_passed and cost_per_passed (total of all runs of the kind, divided by
        the number of those that passed); seconds_mean.
    """
    columns = list(by)
    rows = []
    for names, _ in frames.runs.groupby(columns, sort=False, dropna=False):
        label = dict(zip(columns, names, strict=True))
        rows.append(label | _metrics(frames.only(**label)))
    return pd.DataFrame(rows)


def _metrics(frames: RunFrames) -> dict[str, object]:
    runs = frames.runs
    passed = int(runs["tau"].notna().sum())
    whole = runs[~runs["censored"]]
    done = int(solved(whole, int(runs["K"].max())).sum())
    low, high = exact_interval(done, len(whole))
    return {
        "R": len(runs),
        "passed": passed,
        "verified": int(runs["status"].eq("verified").sum()),
        "censored": int(runs["censored"].sum()),
        **_with_interval("sr", success_rate(frames)),
        "sr_unbiased": unbiased_success_rate(frames),
        **_with_interval("first_pass", first_pass(frames)),
        "cs_K": done / len(whole) if len(whole) else float("nan"),
        "cs_K_low": low,
        "cs_K_high": high,
        "candidate_rate": candidate_rate(frames).value,
        "tau_mean": float(runs["tau"].mean()) if passed else float("nan"),
        "tokens_per_passed": per_success(runs["tokens"], passed),
        "cost_per_passed": per_success(runs["cost"], passed),
        "seconds_mean": float(runs["seconds"].mean()),
    }


def _with_interval(name: str, rate: Rate) -> dict[str, float]:
    return {name: rate.value, f"{name}_low": rate.low, f"{name}_high": rate.high}


def per_success(spent: pd.Series, successes: int) -> float:
    """Total spent per success; NaN if there is none, or some expense is unknown."""
    if not successes or spent.isna().any():
        return float("nan")
    return float(spent.sum()) / successes
