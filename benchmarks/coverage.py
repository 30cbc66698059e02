"""Measures the coverage of each interval of `tdac_agent.metrics`.

Run `python -m benchmarks.coverage`; it takes minutes. Runs are simulated: each
iteration passes with the same probability, and the first success ends a run. If no
interval can be computed from the runs, it is taken to be [0, 1].
"""

from __future__ import annotations

import argparse
from functools import cache

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table
from scipy.stats import binom

from tdac_agent.metrics import (
    cumulative_success,
    exact_interval,
    rate_of_runs,
)

MOST = 20
PROBABILITIES = (0.2, 0.5, 0.8, 0.95)


def exact_coverage(probability: float, runs: int) -> float:
    """Coverage of the exact interval, summed over all numbers of successes."""
    held = 0.0
    for successes in range(runs + 1):
        low, high = exact_interval(successes, runs)
        if low <= probability <= high:
            held += float(binom.pmf(successes, runs, probability))
    return held


def rate_coverage(
    probability: float, runs: int, *, trials: int = 1000, seed: int = 0
) -> float:
    """Simulated coverage of SR's interval by resampling runs."""
    random = np.random.default_rng(seed)
    held = 0
    for _ in range(trials):
        first = np.sort(random.geometric(probability, runs))
        low, high = _rate_interval(tuple(first.clip(max=MOST + 1).tolist()))
        held += low <= probability <= high
    return held / trials


@cache
def _rate_interval(first: tuple[int, ...]) -> tuple[float, float]:
    """SR's interval for first successes; cached, because few runs are often alike."""
    tau = np.array(first)
    rate = rate_of_runs((tau <= MOST).astype(int), tau.clip(max=MOST))
    return (rate.low, rate.high) if rate.method != "none" else (0.0, 1.0)


def kaplan_meier_coverage(
    probability: float,
    runs: int,
    stopped: float,
    *,
    at: int = 3,
    trials: int = 1000,
    seed: int = 0,
) -> float:
    """Simulated coverage of CS(at)'s interval; `stopped`: P(censored) per iteration."""
    random = np.random.default_rng(seed)
    true = 1 - (1 - probability) ** at
    held = 0
    for _ in range(trials):
        first = random.geometric(probability, runs)
        last = np.minimum(random.geometric(stopped, runs), MOST)
        ends = sorted(zip(first.tolist(), last.tolist(), strict=True))
        low, high = _curve_interval(tuple(ends), at)
        held += low <= true <= high
    return held / trials


@cache
def _curve_interval(ends: tuple[tuple[int, int], ...], at: int) -> tuple[float, float]:
    """Interval of CS(at) for (first success, last affordable iteration) of each run."""
    first, last = np.array(ends).T
    seen = first <= last
    frame = pd.DataFrame(
        {
            "tau": pd.array(np.where(seen, first, 0), "Int64"),
            "done": np.minimum(first, last),
            "censored": ~seen,
            "K": MOST,
        }
    )
    frame.loc[~seen, "tau"] = pd.NA
    row = cumulative_success(frame, at).iloc[-1]
    return float(row["low"]), float(row["high"])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    trials = parser.parse_args().trials
    table = Table(title="Coverage of the 95 % intervals", title_justify="left")
    table.add_column("interval")
    table.add_column("runs", justify="right")
    for probability in PROBABILITIES:
        table.add_column(f"p = {probability:g}", justify="right")
    for runs in (5, 10, 20, 50):
        exact = [exact_coverage(p, runs) for p in PROBABILITIES]
        table.add_row("CS, Clopper-Pearson", str(runs), *(f"{c:.3f}" for c in exact))
    for runs in (5, 10, 20, 50):
        rates = [rate_coverage(p, runs, trials=trials) for p in PROBABILITIES]
        table.add_row("SR, runs resampled", str(runs), *(f"{c:.3f}" for c in rates))
    for runs in (5, 10, 20, 50):
        curves = [
            kaplan_meier_coverage(p, runs, 0.25, trials=trials) for p in PROBABILITIES
        ]
        name = "CS(3), Kaplan-Meier, 1 in 4 stopped"
        table.add_row(name, str(runs), *(f"{c:.3f}" for c in curves))
    Console().print(table)


if __name__ == "__main__":
    main()
