"""The metrics against the paper's figures, closed forms and brute force."""

import itertools
import json
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import beta

from tdac_agent.errors import RunError
from tdac_agent.metrics import (
    ASSUMPTIONS,
    CANDIDATE_COLUMNS,
    RUN_COLUMNS,
    RunFrames,
    best_of_n,
    candidate_rate,
    compare_paired,
    cumulative_success,
    exact_interval,
    first_pass,
    frames_from_tau,
    iterations_of,
    join_frames,
    load_frames,
    load_reported,
    pass_at_n,
    success_rate,
    summarise,
    unbiased_success_rate,
)

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "results" / "paper" / "results.csv"
PAPER = pd.read_csv(RESULTS)
FACTS = ROOT.parent / "shared/facts/paper_results.json"
taus = st.lists(st.none() | st.integers(1, 6), min_size=2, max_size=8)


def paper_frames(row):
    """The frames of one bar of the paper."""
    return load_reported(RESULTS, environment=row.environment, learner=row.learner)


@pytest.mark.parametrize(
    "row", list(PAPER.itertuples()), ids=lambda r: r.environment + r.learner
)
def test_the_papers_bars_and_curves(row):
    """SR = R / sum of tau, within a percentage point of what is printed; CS(k)."""
    frames = paper_frames(row)
    tau = [int(word) for word in row.tau.split()]
    rate = success_rate(frames, invalid=True)
    assert rate.value == len(tau) / sum(tau)
    assert abs(rate.value - row.sr_printed) <= 0.01
    curve = cumulative_success(frames.runs)
    assert list(curve["k"]) == list(range(1, 21))
    for k, value in zip(curve["k"], curve["cs"], strict=True):
        assert value == sum(t <= k for t in tau) / len(tau)


def test_a_table_of_both_environments_is_read_as_a_whole():
    """No run of one is taken for a run of the other; `setting` is that of the loop."""
    runs = load_reported(RESULTS).runs
    assert len(runs) == 5 * len(PAPER)
    assert runs["run"].is_unique
    assert runs["setting"].isna().all()


def test_both_rules_of_counting():
    """GPT-4o in 3D, two iterations without a controller: the formula, the bar."""
    row = PAPER[(PAPER.environment == "3d") & (PAPER.learner == "GPT-4o")].iloc[0]
    frames = paper_frames(row)
    assert success_rate(frames).value == 5 / 21
    assert success_rate(frames, invalid=True).value == 5 / 23


@pytest.mark.skipif(not FACTS.exists(), reason="the facts about the paper are not here")
def test_the_papers_figures_as_they_are_known():
    """The table of this repository is the list of the facts."""
    known = json.loads(FACTS.read_text())
    listed = {
        (row.environment, row.learner): ([*map(int, row.tau.split())], row.sr_printed)
        for row in PAPER.itertuples()
    }
    assert listed == {
        (environment, learner): (facts["tau"], facts["SR_printed"])
        for environment in ("2d", "3d")
        for learner, facts in known[environment].items()
    }


def test_frames_have_the_documented_columns():
    """No more and no less, in this order."""
    frames = frames_from_tau([1, None], 3, learner="one")
    assert list(frames.runs) == list(RUN_COLUMNS)
    assert list(frames.candidates) == list(CANDIDATE_COLUMNS)
    assert list(frames.runs["done"]) == [3, 1]


def test_an_iteration_passes_by_any_of_its_candidates():
    """Edits belong to their iteration; its failures are those of the last candidate."""
    candidates = pd.DataFrame(
        [
            ("a", 1, 0, True, False, 4),
            ("a", 1, 1, True, False, 2),
            ("a", 2, 0, False, False, None),
            ("a", 3, 0, True, False, 7),
            ("a", 3, 1, True, True, 0),
        ],
        columns=list(CANDIDATE_COLUMNS),
    )
    found = iterations_of(candidates)
    assert found["passed"].tolist() == [False, False, True]
    assert found["valid"].tolist() == [True, False, True]
    assert found["failed"].tolist()[::2] == [2, 0]
    assert found["candidates"].tolist() == [2, 1, 2]
    frames = RunFrames(frames_from_tau([3], 3).runs.assign(run="a"), candidates)
    assert success_rate(frames).value == 1 / 2
    assert candidate_rate(frames).value == 1 / 4
    assert first_pass(frames).value == 0.0


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 40), st.integers(0, 40))
def test_the_exact_interval_is_that_of_the_beta_distribution(successes, more):
    """Clopper and Pearson by the quantiles of the beta distribution."""
    trials = successes + more
    low, high = exact_interval(successes, trials)
    if trials == 0:
        assert (low, high) == (0.0, 1.0)
        return
    lowest = beta.ppf(0.025, successes, more + 1) if successes else 0.0
    highest = beta.ppf(0.975, successes + 1, more) if more else 1.0
    assert (low, high) == pytest.approx((lowest, highest), abs=1e-9)


@settings(deadline=None, max_examples=50)
@given(taus)
def test_without_censoring_kaplan_meier_is_the_fraction(tau):
    """The estimator of Kaplan and Meier is CS(k) where each run went on to K."""
    frames = frames_from_tau(tau, 6)
    curve = cumulative_success(frames.runs)
    shares = [
        sum(t is not None and t <= k for t in tau) / len(tau) for k in range(1, 7)
    ]
    assert curve["cs"].tolist() == shares
    assert set(curve["method"]) == {"Clopper-Pearson"}
    assert kaplan_meier(frames.runs, 6) == pytest.approx(shares)


@settings(deadline=None, max_examples=50)
@given(st.lists(st.tuples(st.integers(1, 6), st.booleans()), min_size=1, max_size=9))
def test_censored_runs_count_as_long_as_they_were_at_risk(ends):
    """Against the product of (1 - solved / at risk), by hand; bounds hold it."""
    frames = frames_from_tau([k if seen else None for k, seen in ends], 6)
    order = sorted(ends, key=lambda end: -(end[0] if end[1] else 7))
    runs = frames.runs.copy()
    runs["done"] = pd.array([k for k, _ in order], "Int64")
    runs["censored"] = [not seen for _, seen in order]
    curve = cumulative_success(runs)
    assert curve["cs"].tolist() == pytest.approx(kaplan_meier(runs, 6))
    assert (curve["low"] <= curve["cs"] + 1e-12).all()
    assert (curve["cs"] <= curve["high"] + 1e-12).all()
    assert (np.diff(curve["cs"]) >= -1e-12).all()


def kaplan_meier(runs, most):
    """The estimator by its definition."""
    left, values = 1.0, []
    for k in range(1, most + 1):
        reached = runs["tau"].fillna(runs["done"])
        at_risk = int((reached >= k).sum())
        events = int((runs["tau"].fillna(-1) == k).sum())
        left *= 1 - events / at_risk if at_risk else 1.0
        values.append(1 - left)
    return values


def test_runs_that_are_alike_are_no_certainty():
    """Resampling them has no width: exact where each is one trial, else no interval."""
    once = success_rate(frames_from_tau([1] * 10, 20))
    assert (once.value, once.method) == (1.0, "Clopper-Pearson")
    assert (once.low, once.high) == exact_interval(10, 10)
    twice = success_rate(frames_from_tau([2] * 10, 20))
    assert (str(twice), twice.method) == ("0.50", "none")
    assert success_rate(frames_from_tau([1, 2], 20)).method == "runs resampled"


def test_the_unbiased_rate():
    """(R-1)/(N-1), where each run ended with a success; else there is none."""
    assert unbiased_success_rate(frames_from_tau([1, 1, 2, 2, 5], 20)) == 4 / 10
    assert math.isnan(unbiased_success_rate(frames_from_tau([1, None], 20)))
    assert math.isnan(unbiased_success_rate(frames_from_tau([3], 20)))


@pytest.mark.parametrize(("tried", "passed"), [(5, 2), (6, 0), (4, 4), (7, 1)])
def test_pass_at_n_is_the_mean_over_all_draws(tried, passed):
    """Of every choice of n from the candidates: how often one of them passed."""
    outcomes = [True] * passed + [False] * (tried - passed)
    for n in range(1, tried + 1):
        draws = list(itertools.combinations(outcomes, n))
        share = sum(any(draw) for draw in draws) / len(draws)
        assert pass_at_n(tried, passed, n) == pytest.approx(share)
    assert math.isnan(pass_at_n(tried, passed, tried + 1))


def test_pairs_are_compared_on_the_same_seeds():
    """Exact tests of the pairs in which the two differ."""
    one, two = (frames_from_tau([1] * 6 + [None], 9), frames_from_tau([None] * 7, 9))
    sides = [
        RunFrames(f.runs.assign(task="t", seed=range(len(f.runs))), f.candidates)
        for f in (one, two)
    ]
    found = compare_paired(*sides)
    assert (found.pairs, found.first_only, found.second_only) == (7, 6, 0)
    assert found.p_solved == pytest.approx(2 * 0.5**6)
    assert (found.sooner, found.later, found.p_tau) == (6, 0, found.p_solved)
    assert compare_paired(sides[0], sides[0]).p_solved == 1.0
    twice = RunFrames(sides[0].runs.assign(seed=0), sides[0].candidates)
    with pytest.raises(RunError, match="several runs"):
        compare_paired(twice, sides[1])
    other = RunFrames(sides[1].runs.assign(seed=99 + np.arange(7)), sides[1].candidates)
    with pytest.raises(RunError, match="no two runs share"):
        compare_paired(sides[0], other)


def test_best_of_n_for_the_same_money():
    """As many single shots as a run of the loop costs."""
    loop = frames_from_tau([1, 1, 3, 3], 5)
    loop.runs["tokens"] = pd.array([300, 300, 100, 100], "Int64")
    found = best_of_n(loop, loop).iloc[0]
    assert (found["measure"], found["one_shot"], found["run"]) == ("tokens", 100, 200)
    assert found["n"] == 2
    assert found["best_of_n"] == pytest.approx(1 - 1 / 6)
    assert found["cs"] == 1.0


def test_one_row_per_kind():
    """Each kind has its own figures; what intervals assume is written down."""
    one, two = paper_frames(PAPER.iloc[0]), paper_frames(PAPER.iloc[4])
    table = summarise(join_frames(one, two))
    assert table["learner"].tolist() == ["GPT-5.2", "GPT-4o"]
    assert table["sr"].tolist() == [5 / 11, 5 / 35]
    assert table["cs_K"].tolist() == [1.0, 1.0]
    assert table["tau_mean"].tolist() == [2.2, 7.0]
    assert {success_rate(one).method, first_pass(one).method} <= ASSUMPTIONS.keys()
    assert set(cumulative_success(one.runs)["method"]) <= ASSUMPTIONS.keys()


def test_a_folder_without_runs(tmp_path):
    """One line says so."""
    with pytest.raises(RunError, match="there is no run at or below"):
        load_frames(tmp_path)


def test_a_table_of_first_successes(tmp_path):
    """Ended runs with a plus sign, columns of runs taken over, rows chosen."""
    table = tmp_path / "table.csv"
    table.write_text("kind,learner,tau\nx,one,1 3 2+\ny,one,9\n")
    frames = load_reported(table, most=5, kind="x")
    assert frames.runs["learner"].tolist() == ["one"] * 3
    assert frames.runs["tau"].tolist() == [3, 1, pd.NA]
    assert frames.runs["done"].tolist() == [3, 1, 2]
    assert frames.runs["censored"].tolist() == [False, False, True]
    assert success_rate(frames).trials == 3 + 1 + 2
    assert cumulative_success(frames.runs)["at_risk"].tolist() == [3, 2, 2, 0, 0]


@pytest.mark.parametrize(
    ("text", "only", "told"),
    [
        ("learner\none\n", {}, "has no column 'tau'"),
        ("tau\n1\n", {"task": "maze"}, "has no column 'task'"),
        ("tau,task\n1,cave\n", {"task": "maze"}, "has no row"),
        ("tau\n1 two\n", {}, "expected iterations such as 1 2 5+"),
        ("", {}, "cannot read"),
    ],
)
def test_a_broken_table(tmp_path, text, only, told):
    """One line says what is wrong with it."""
    table = tmp_path / "table.csv"
    table.write_text(text)
    with pytest.raises(RunError, match=re.escape(told)):
        load_reported(table, **only)


def test_a_run_counts_once():
    """Frames that share a run are not joined, and there must be some."""
    frames = frames_from_tau([1], 2, learner="one")
    with pytest.raises(RunError, match="twice"):
        join_frames(frames, frames)
    with pytest.raises(RunError, match="no runs"):
        join_frames()
