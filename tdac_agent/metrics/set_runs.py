"""Runs on task sets as a frame, and a table with one row per kind of run."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import ttest_1samp

from tdac_agent.metrics.exact import CONFIDENCE, exact_interval
from tdac_agent.metrics.frames import RUN_COLUMNS, Row, labels_of
from tdac_agent.metrics.table import KIND, per_success
from tdac_agent.runs.run_record import Run
from tdac_agent.runs.selection_record import Selection, read_selection

_LABELS = ("run", "learner", "optimizer", "prompt", "K", "J", "setting")
SET_RUN_COLUMNS = {
    "task": "Name of the task set.",
    **{name: RUN_COLUMNS[name] for name in _LABELS},
    "seed": "Determines the worlds of `dev`.",
    "status": "Status in `run.json`; `verified` and `not verified`: on hidden worlds.",
    "censored": "Whether budget, time or a fault ended the run.",
    "k": "Iteration of the selected candidate; missing if none was selected.",
    "candidates": "Number of different candidates.",
    "episodes": "Number of simulated episodes on `dev`; missing as for k.",
    "success": "Goals reached by the selected candidate on validation worlds, as a "
    "fraction; optimistic, because it was selected by these worlds.",
    "time_score": "Its mean time score there, likewise.",
    **{name: RUN_COLUMNS[name] for name in ("tokens", "cost", "seconds")},
}


def set_frame_of(runs: Iterable[Run]) -> pd.DataFrame:
    """A row for each run on a task set, with `SET_RUN_COLUMNS`; others are left out."""
    rows = [_row(run, read_selection(run.folder)) for run in runs if run.on_set]
    frame = pd.DataFrame(rows, columns=list(SET_RUN_COLUMNS))
    whole = dict.fromkeys(("K", "J", "k", "candidates", "episodes", "tokens"), "Int64")
    real = dict.fromkeys(("success", "time_score", "cost", "seconds"), float)
    return frame.astype(whole | real | {"censored": bool})


def summarise_sets(frame: pd.DataFrame) -> pd.DataFrame:
    """Computes the metrics of each kind of run on task sets.

    Args:
        frame: The runs, with `SET_RUN_COLUMNS`.

    Returns:
        A row per kind: learner, optimizer, task (the set), prompt, setting; R,
        verified, censored (numbers of runs); rate, the fraction of the uncensored runs
        that were verified on hidden worlds, with rate_low and rate_high (exact);
        time_score, the mean of the selected candidates on validation worlds
        (optimistic), with time_score_low and time_score_high (t interval over runs);
        episodes_mean; tokens_per_verified and cost_per_verified (total of all runs of
        the kind, divided by the number of verified ones); seconds_mean.
    """
    groups = frame.groupby(list(KIND), sort=False, dropna=False)
    rows = [
        dict(zip(KIND, names, strict=True)) | _metrics(runs) for names, runs in groups
    ]
    return pd.DataFrame(rows)


def _metrics(runs: pd.DataFrame) -> Row:
    verified = int(runs["status"].eq("verified").sum())
    whole = int((~runs["censored"]).sum())
    low, high = exact_interval(verified, whole)
    scores = runs["time_score"].dropna().to_numpy(float)
    mean = float(scores.mean()) if len(scores) else math.nan
    least, most = _t_interval(scores)
    return {
        "R": len(runs),
        "verified": verified,
        "censored": int(runs["censored"].sum()),
        "rate": verified / whole if whole else math.nan,
        "rate_low": low,
        "rate_high": high,
        "time_score": mean,
        "time_score_low": least,
        "time_score_high": most,
        "episodes_mean": float(runs["episodes"].astype(float).mean()),
        "tokens_per_verified": per_success(runs["tokens"], verified),
        "cost_per_verified": per_success(runs["cost"], verified),
        "seconds_mean": float(runs["seconds"].mean()),
    }


def _t_interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Interval of the mean of scores; NaN with fewer than two, or if all are equal."""
    if len(values) < 2 or np.ptp(values) == 0.0:
        return math.nan, math.nan
    interval = ttest_1samp(values, 0.0).confidence_interval(CONFIDENCE)
    return max(float(interval.low), 0.0), min(float(interval.high), 1.0)


def _row(run: Run, selected: Selection | None) -> Row:
    best = None if selected is None else selected.optimistic
    codes = sum(each.valid and not each.unchanged for each in run.attempts)
    return {
        **labels_of(run),
        "seed": run.seed,
        "status": run.status,
        "censored": not run.finished,
        "k": run.tau,
        "candidates": codes,
        "episodes": selected and selected.used,
        "success": best and best.success,
        "time_score": best and best.time,
        "tokens": run.tokens or None,
        "cost": run.cost,
        "seconds": run.seconds,
    }
