"""CS(k): the fraction of runs that have succeeded by iteration k."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import CensoredData, ecdf

from tdac_agent.metrics.exact import CONFIDENCE, exact_interval
from tdac_agent.metrics.rates import solved


def cumulative_success(runs: pd.DataFrame, most: int | None = None) -> pd.DataFrame:
    """CS(k) of the paper: the distribution function of tau, with pointwise intervals.

    Without censored runs, CS(k) is the fraction of runs with tau <= k, with exact
    intervals. A run that budget, time or a fault ended is at risk up to its last
    complete iteration; CS(k) is then the Kaplan-Meier estimate (1958), with log-log
    intervals from Greenwood's formula.

    Args:
        runs: Frame with the columns tau, done, censored and K.
        most: Largest k; the largest K by default.

    Returns:
        A row per k from 1: k, cs, low, high, solved (runs that succeeded by iteration
        k), at_risk (runs that reached iteration k without an earlier success), method.
    """
    if runs.empty:
        columns = ["k", "cs", "low", "high", "solved", "at_risk", "method"]
        return pd.DataFrame(columns=columns)
    last = int(runs["K"].max()) if most is None else most
    reach = runs["tau"].fillna(runs["done"] + 1)
    frame = pd.DataFrame({"k": np.arange(1, last + 1)})
    frame["solved"] = [int(solved(runs, k).sum()) for k in frame["k"]]
    frame["at_risk"] = [int((reach >= k).sum()) for k in frame["k"]]
    # A run with a smaller K is censored after its own K.
    ended_early = runs["tau"].isna() & (runs["done"] < last)
    if ended_early.any():
        return _kaplan_meier(runs, frame)
    total = len(runs)
    frame["cs"] = frame["solved"] / total
    ends = [exact_interval(count, total) for count in frame["solved"]]
    frame[["low", "high"]] = np.array(ends).reshape(-1, 2)
    frame["method"] = "Clopper-Pearson"
    return frame[["k", "cs", "low", "high", "solved", "at_risk", "method"]]


def _kaplan_meier(runs: pd.DataFrame, frame: pd.DataFrame) -> pd.DataFrame:
    has = runs["tau"].notna()
    first = runs.loc[has, "tau"].astype(float).to_numpy()
    # A run that ended after iteration d is at risk in d, but not in d + 1.
    ended = runs.loc[~has, "done"].astype(float).to_numpy()
    if not len(first):
        frame["cs"], frame["low"], frame["high"] = 0.0, 0.0, 1.0
    else:
        cdf = ecdf(CensoredData(uncensored=first, right=ended)).cdf
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # undefined where all or none succeeded
            ends: Any = cdf.confidence_interval(CONFIDENCE, method="log-log")
        k = frame["k"].to_numpy(float)
        frame["cs"] = cdf.evaluate(k)
        low = np.nan_to_num(ends.low.evaluate(k), nan=0.0)
        # CS(k) never decreases, so a lower bound at k holds at k + 1 as well.
        frame["low"] = np.maximum.accumulate(low)
        frame["high"] = np.nan_to_num(ends.high.evaluate(k), nan=1.0)
        unsolved = frame["cs"] == 0
        frame.loc[unsolved, ["low", "high"]] = (0.0, 1.0)
    frame["method"] = "Kaplan-Meier"
    return frame[["k", "cs", "low", "high", "solved", "at_risk", "method"]]
