"""Comparisons of two kinds of runs: paired by task and seed, or at equal cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from tdac_agent.errors import RunError
from tdac_agent.metrics.exact import sign_test
from tdac_agent.metrics.frames import RunFrames
from tdac_agent.metrics.rates import solved


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two kinds of runs, compared on the same (task, seed) pairs.

    Attributes:
        pairs: Number of pairs.
        first_only: Pairs that only the first kind solved within K iterations.
        second_only: Pairs that only the second kind solved within K iterations.
        p_solved: Two-sided p-value of McNemar's exact test of `first_only` against
            `second_only`; 1 if both are 0.
        sooner: Pairs in which the first kind needed fewer iterations. A run without
            success counts as slower than any success.
        later: Pairs in which the first kind needed more iterations.
        p_tau: Two-sided p-value of the exact sign test of `sooner` against `later`; 1
            if both are 0.
    """

    pairs: int
    first_only: int
    second_only: int
    p_solved: float
    sooner: int
    later: int
    p_tau: float


def compare_paired(
    first: RunFrames, second: RunFrames, on: Sequence[str] = ("task", "seed")
) -> Comparison:
    """Compares runs that share a task and a seed.

    Assumes that pairs are independent. Pairs with a censored run are left out.

    Args:
        first: Runs of one kind, one per pair.
        second: Runs of the other kind, one per pair.
        on: Columns that identify a pair.

    Raises:
        RunError: The two kinds share no pair, or one has several runs for a pair.
    """
    keys = list(on)
    sides = [frames.runs[~frames.runs["censored"]] for frames in (first, second)]
    for side in sides:
        if side.duplicated(keys).any():
            duplicate = side.loc[side.duplicated(keys), keys].iloc[0].to_dict()
            raise RunError(
                f"expected one run per pair, got several runs with {duplicate}"
            )
    both = sides[0].merge(sides[1], on=keys, suffixes=("_1", "_2"))
    if both.empty:
        raise RunError(f"no two runs share {' and '.join(keys)}")
    most = max(int(both["K_1"].max()), int(both["K_2"].max()))
    one, two = (both[f"tau_{n}"].fillna(most + 1).to_numpy(float) for n in (1, 2))
    first_only = int(((one <= most) & (two > most)).sum())
    second_only = int(((two <= most) & (one > most)).sum())
    sooner, later = int((one < two).sum()), int((one > two).sum())
    return Comparison(
        len(both),
        first_only,
        second_only,
        sign_test(first_only, second_only),
        sooner,
        later,
        sign_test(sooner, later),
    )


def pass_at_n(tried: int, passed: int, n: int) -> float:
    """Unbiased estimate of the probability that at least one of n candidates passes.

    Computed from `tried` independent one-shot candidates, `passed` of which passed
    (Chen et al. 2021, eq. 1). NaN if n > `tried`: no unbiased estimate exists.
    """
    if n > tried:
        return math.nan
    if tried - passed < n:
        return 1.0
    terms = 1.0 - n / np.arange(tried - passed + 1, tried + 1)
    return float(1.0 - np.prod(terms))


def best_of_n(
    frames: RunFrames, loop: RunFrames, within: int | None = None
) -> pd.DataFrame:
    """Compares one-shot candidates with the repair loop at equal cost.

    Args:
        frames: Runs whose first candidates are the one-shot candidates.
        loop: Runs of the loop.
        within: Iterations of the loop to count; all by default.

    Returns:
        A row per `measure` of cost that is known for both (`cost` in USD, `tokens`):
        `one_shot` and `run`, the mean costs of a candidate and of a loop run; `n`, the
        number of candidates at the cost of a run; `best_of_n`, their pass@n (NaN with
        fewer candidates); `cs`, CS of the loop.
    """
    tried = frames.candidates
    first = tried[(tried["k"] == 1) & (tried["j"] == 0)]
    single = frames.runs[frames.runs["done"] == 1]
    most = within if within is not None else int(loop.runs["K"].max())
    rows = []
    for measure in ("cost", "tokens"):
        one, run = single[measure].mean(), loop.runs[measure].mean()
        if pd.isna(one) or pd.isna(run) or not one > 0:
            continue
        n = max(1, int(run // one))
        rows.append(
            {
                "measure": measure,
                "one_shot": float(one),
                "run": float(run),
                "n": n,
                "best_of_n": pass_at_n(len(first), int(first["passed"].sum()), n),
                "cs": float(solved(loop.runs, most).mean()),
            }
        )
    columns = ["measure", "one_shot", "run", "n", "best_of_n", "cs"]
    return pd.DataFrame(rows, columns=columns)
