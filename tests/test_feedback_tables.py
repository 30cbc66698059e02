"""The analysis of the feedback trial, beside figures computed in another way."""

import itertools
import math
import statistics
from functools import cache

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from benchmarks.feedback_tables import (
    EXPERIMENTS,
    at_equal_cost,
    by_dose,
    cells_of,
    contrasts,
    costs,
    differences,
    dose_slope,
    holm,
    race_pairs,
    sign_flip_p,
    stratified_interval,
    stratified_p,
    t_interval,
    tables,
    transfers,
)
from benchmarks.feedback_trial import (
    ARMS,
    DOSE_POOL,
    OMITTED,
    RACE_POOL,
    episodes_for,
    planned,
)
from tdac_agent.synthesis.workload import shares

ANSWERS = {"A+": 9, "C": 2, "best": 8, "race": 8, "best+": 10, "rules": 1, "placebo": 1}


def made_up():
    """Scores of all cells of the plan, drawn at random."""
    return _made_up().copy()


@cache
def _made_up():
    random = np.random.default_rng(3)
    rows = []
    for cell in planned():
        answers = ANSWERS.get(cell.arm, 6)
        cost = round(float(random.uniform(1e5, 2e5)))
        rows += [
            {
                "cell": cell.name,
                "group": cell.group,
                "level": cell.level,
                "arm": cell.arm,
                "omitted": len(cell.omit.split(",")) if cell.omit else 0,
                "answers": answers,
                "asked": cost,
                "answered": 0,
                "cost": cost,
                "k": k,
                "valid": True,
                "reads_params": False,
                "like_builtin": 0.1,
                "like_recorded": 0.1,
                "complete": bool(random.random() < 0.8),
                "pool": round(float(random.random()), 1),
                "time_score": float(random.random()),
                "success": float(random.random()),
                "race_score": float(random.random()),
            }
            for k in range(1, answers + 1)
        ]
    return pd.DataFrame(rows)


def best_row(rows):
    return max(rows, key=lambda row: (row.complete, row.pool, -row.k))


def by_hand(scores, one, other, outcome="time_score"):
    """Differences between two arms, without pandas."""
    rows = list(scores.itertuples())
    found = []
    for group in sorted({row.group for row in rows if row.arm == one}):
        first = [row for row in rows if (row.group, row.arm) == (group, one)]
        second = [row for row in rows if (row.group, row.arm) == (group, other)]
        if other == "A+":
            most = math.ceil(first[0].cost * len(second) / second[0].cost)
            second = [row for row in second if row.k <= max(2, most)]
        found.append(
            getattr(best_row(first), outcome) - getattr(best_row(second), outcome)
        )
    return found


def test_the_plan():
    """12 runs with all arms and shared seeds, 16 pairs, 8 transfers, drawn for ever."""
    cells = planned()
    assert len({cell.name for cell in cells}) == len(cells)
    dose = [cell for cell in cells if cell.name.startswith("dose-")]
    for arm in (*ARMS, "A+", "C"):
        assert sum(cell.arm == arm for cell in dose) == 12
    for group, found in itertools.groupby(dose, key=lambda cell: cell.group):
        own = list(found)
        if not group.endswith("C"):
            assert len({(c.seed, c.prompt, c.omit) for c in own}) == 1
            assert own[-1].arm == "A+"  # once it is known what the others cost
            assert set(own[0].omit.split(",")) <= set(OMITTED)
            assert own[0].omit in own[0].prompt
    assert sum(cell.arm == "race" for cell in cells) == 16
    assert sum(cell.arm == "placebo" for cell in cells) == 8


@pytest.mark.parametrize("answers", range(1, 30))
def test_the_pool_does_not_depend_on_the_number_of_answers(answers):
    """All arms choose by the same worlds."""
    for pool in (DOSE_POOL, RACE_POOL):
        assert shares(episodes_for(pool, answers), 0, answers).block == pool


@pytest.mark.slow
@pytest.mark.parametrize("contrast", [("I", "A+"), ("E", "A+"), ("I", "M"), ("S", "I")])
def test_differences(contrast):
    """Each is that of the best candidates in the pool, against A+ at equal cost."""
    scores = made_up()
    found = differences(scores, contrast, "time_score")
    assert found.tolist() == pytest.approx(by_hand(scores, *contrast))


def test_fresh_answers_at_equal_cost():
    """As many as cost as much as the other arm, rounded up; at least the first ones."""
    scores = made_up()
    scores.loc[scores["arm"] == "A+", ["cost", "complete"]] = [90_000, True]
    scores.loc[scores["arm"] == "A+", "pool"] = scores["k"] / 100  # the last is best
    group = "dose-floor-1"
    for cost, last in ((1_000, 2), (30_000, 3), (30_001, 4), (90_000, 9), (10**6, 9)):
        assert at_equal_cost(scores, group, cost)["k"] == last


@pytest.mark.slow
def test_contrasts():
    """Means, p-values and intervals are those of plain Python and of SciPy."""
    scores = made_up()
    table = contrasts(scores, "time_score").set_index("contrast")
    change = by_hand(scores, "I", "A+")
    row = table.loc["I - A+"]
    assert row["mean"] == pytest.approx(statistics.fmean(change))
    found = stats.permutation_test(
        (change,),
        lambda x, axis: np.mean(x, axis=axis),
        permutation_type="samples",
        vectorized=True,
        n_resamples=np.inf,
    )
    assert row["p"] == row["p_holm"] == pytest.approx(found.pvalue)
    low, high = stats.t.interval(
        0.95, len(change) - 1, statistics.fmean(change), stats.sem(change)
    )
    assert (row["low"], row["high"]) == pytest.approx((low, high))
    assert table["p_holm"][1:].tolist() == holm(table["p"][1:].tolist())
    assert t_interval(change) == pytest.approx((low, high))


def test_holm():
    """Adjusted p-values of a textbook example, in the order of the tests."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])


def test_sign_flips():
    """Five equal differences have the least p-value that five can have."""
    assert sign_flip_p([0.1] * 5) == pytest.approx(2 / 32)
    assert sign_flip_p([0.1, -0.1]) == 1.0
    with pytest.raises(AssertionError):
        sign_flip_p([0.1, math.nan])


def test_the_race():
    """Differences of the best candidates, and the p-value by brute force."""
    scores = made_up()
    pairs, summary = race_pairs(scores)
    assert len(pairs) == 16
    change = by_hand(scores, "race", "best+", "race_score")
    assert sorted(pairs["difference"]) == pytest.approx(sorted(change))
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


def test_the_interval_of_the_race():
    """With equal levels it is that of a pooled variance within levels."""
    pairs = race_pairs(made_up())[0]
    groups = [own["difference"].to_numpy() for _, own in pairs.groupby("level")]
    pooled = sum(((own - own.mean()) ** 2).sum() for own in groups) / 14
    half = stats.t.ppf(0.975, 14) * math.sqrt(pooled / 16)
    mean = pairs["difference"].mean()
    assert stratified_interval(pairs) == pytest.approx((mean - half, mean + half))


@pytest.mark.slow
def test_the_slope():
    """A gain that grows with the dose is found."""
    scores = made_up()
    final = scores["arm"] == "I"
    scores["complete"] = True
    scores.loc[scores["arm"] == "A+", "time_score"] = 0.1
    scores.loc[final, "time_score"] = 0.1 + 0.05 * scores.loc[final, "omitted"]
    found = dose_slope(scores)
    assert found["slope"] == pytest.approx(0.05)
    assert found["p"] < 0.02


@pytest.mark.slow
def test_no_slope_is_found_where_there_is_none():
    assert dose_slope(made_up())["p"] > 0.001


@pytest.mark.parametrize(
    "experiment",
    ["race", "transfer", pytest.param("dose", marks=pytest.mark.slow)],
)
def test_an_experiment_has_its_own_tables(experiment, tmp_path, capsys):
    scores = made_up()
    named = scores["cell"].isin([cell.name for cell in cells_of(experiment)])
    scores[named].to_csv(tmp_path / "scores.csv", index=False)
    cells = scores[named].drop_duplicates("cell")
    cells.assign(verdict="rejected").to_csv(tmp_path / "verdicts.csv", index=False)
    tables(experiment, tmp_path)
    assert "costs" in capsys.readouterr().out
    written = {file.name for file in tmp_path.iterdir()}
    assert {"verified.csv", "costs.csv", "tests.json"} < written
    other = next(each for each in EXPERIMENTS if each != experiment)
    with pytest.raises(SystemExit, match="have not been judged"):
        tables(other, tmp_path)


def test_other_tables():
    """They have a row or a column for each arm."""
    scores = made_up()
    table = by_dose(scores)
    assert set(table["omitted"]) == {3, 6, 9, 12}
    assert {*ARMS, "A+", "C"} <= set(table.columns)
    pairs, summary = transfers(scores)
    assert len(pairs) == summary["pairs"] == 8
    assert set(costs(scores)["arm"]) == set(scores["arm"])
