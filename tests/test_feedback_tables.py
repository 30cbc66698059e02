"""The analysis of the feedback trial, beside figures computed in another way."""

import itertools
import statistics

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from benchmarks.feedback_tables import (
    after_rounds,
    by_dose,
    contrasts,
    holm,
    race_pairs,
    sign_flip_p,
    stratified_p,
    t_interval,
)
from benchmarks.feedback_trial import ARMS, FACTS, planned


def made_up(seed=3):
    """Scores of all cells of the plan, drawn at random."""
    random = np.random.default_rng(seed)
    rows = [
        {
            "cell": cell.name,
            "group": cell.group,
            "level": cell.level,
            "arm": cell.arm,
            "omitted": len(cell.omit.split(",")) if cell.omit else 0,
            "k": k,
            "pool": round(float(random.random()), 3),
            "time_score": float(random.random()),
            "success": float(random.random()),
        }
        for cell in planned()
        for k in range(1, {"A+": 9, "C": 3, "best+": 10}.get(cell.arm, 7))
    ]
    return pd.DataFrame(rows)


def test_the_plan():
    """12 runs with all arms and shared seeds, 16 pairs, 8 transfers, drawn for ever."""
    cells = planned()
    assert cells == planned()
    assert len({cell.name for cell in cells}) == len(cells)
    dose = [cell for cell in cells if cell.name.startswith("dose-")]
    for arm in (*ARMS, "A+", "C"):
        assert sum(cell.arm == arm for cell in dose) == 12
    for group, found in itertools.groupby(dose, key=lambda cell: cell.group):
        own = list(found)
        if not group.endswith("C"):
            assert len({(c.seed, c.prompt, c.omit) for c in own}) == 1
            assert own[-1].arm == "A+"  # once it is known what the others cost
            assert set(own[0].omit.split(",")) <= set(FACTS)
    assert sum(cell.arm == "race" for cell in cells) == 16
    assert sum(cell.arm == "placebo" for cell in cells) == 8


def test_the_best_of_each_round():
    """The candidate that is best in the pool among those that there were."""
    scores = made_up()
    for row in after_rounds(scores).itertuples():
        most = 2 + row.round
        own = [
            each
            for each in scores.itertuples()
            if each.cell == row.cell
            and (each.k <= most or (row.round == 4 and row.arm == "A+"))
        ]
        best = max(own, key=lambda each: (each.pool, -each.k))
        assert row.time_score == best.time_score


def test_contrasts():
    """Means, p-values and intervals are those of plain Python and of SciPy."""
    scores = made_up()
    rounds = after_rounds(scores)
    final = rounds[rounds["round"] == 4]
    table = contrasts(final, "time_score").set_index("contrast")
    by_cell = {(r.group, r.arm): r.time_score for r in final.itertuples()}
    groups = sorted({group for group, _ in by_cell})
    change = [by_cell[g, "I"] - by_cell[g, "A+"] for g in groups]
    row = table.loc["I - A+"]
    assert row["mean"] == pytest.approx(statistics.fmean(change))
    found = stats.permutation_test(
        (change,),
        lambda x, axis: np.mean(x, axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=np.inf,
    )
    assert row["p"] == pytest.approx(found.pvalue)
    low, high = stats.t.interval(
        0.95, len(change) - 1, statistics.fmean(change), stats.sem(change)
    )
    assert (row["low"], row["high"]) == pytest.approx((low, high))


def test_holm():
    """Adjusted p-values of a textbook example, in the order of the tests."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_sign_flips():
    """Five equal differences have the least p-value that five can have."""
    assert sign_flip_p([0.1] * 5) == pytest.approx(2 / 32)
    assert sign_flip_p([0.1, -0.1]) == 1.0


def test_the_race():
    """Differences of the best candidates, and the p-value by brute force."""
    scores = made_up()
    pairs, summary = race_pairs(scores)
    assert len(pairs) == 16
    small = pairs.groupby("level").head(3)
    groups = [own["difference"].tolist() for _, own in small.groupby("level")]

    def statistic(signs):
        flips = iter(signs)
        return sum(
            statistics.fmean(next(flips) * each for each in own) for own in groups
        )

    observed = abs(statistic((1,) * 6))
    flips = list(itertools.product((1, -1), repeat=6))
    p = sum(abs(statistic(each)) >= observed - 1e-12 for each in flips) / len(flips)
    assert stratified_p(small) == pytest.approx(p)
    assert summary["mean"] == pytest.approx(pairs["difference"].mean())
    low, high = t_interval(pairs["difference"].tolist())
    assert summary["low"] == pytest.approx(low, abs=0.05)
    assert summary["high"] == pytest.approx(high, abs=0.05)


def test_gains_by_dose():
    """Each gain is that over fresh answers at equal cost in the same run."""
    scores = made_up()
    rounds = after_rounds(scores)
    table = by_dose(rounds[rounds["round"] == 4])
    assert set(table["omitted"]) == {3, 6, 9, 12}
    assert {"A+", "E", "I", "S"} <= set(table.columns)
