"""Paired statistics over worlds: against closed forms, scipy and other libraries."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tdac_agent.metrics.paired import (
    bootstrap,
    holm,
    interquartile_mean,
    over_sets,
    probability_of_improvement,
)

RLIABLE = Path(__file__).with_name("rliable.json")
"""Scores of runs on tasks, and what `rliable.metrics` says of them."""


@pytest.fixture
def scores():
    """Two entrants that do alike on each world, the second slightly better."""
    rng = np.random.default_rng(3)
    worlds = rng.uniform(0, 1, 200)
    noise = rng.normal(0, 0.05, (2, 200))
    return {"one": (worlds + noise[0])[None], "two": (worlds + 0.03 + noise[1])[None]}


def test_a_paired_interval_is_that_of_the_differences(scores):
    found = bootstrap(scores)
    ahead = found["two"].minus(found["one"])
    expected = stats.bootstrap(
        ((scores["two"] - scores["one"])[0],), np.mean, method="percentile", rng=0
    ).confidence_interval
    estimate = ahead.estimate()
    assert estimate.value == pytest.approx((scores["two"] - scores["one"]).mean())
    assert (estimate.low, estimate.high) == pytest.approx(tuple(expected), abs=1e-3)
    assert estimate.low > 0.0
    assert ahead.p_value() < 0.01
    assert found["one"].minus(found["one"]).p_value() == 1.0


def test_unpaired_means_overlap(scores):
    """The pairing is what tells these entrants apart."""
    one, two = (each.estimate() for each in bootstrap(scores).values())
    assert two.low < one.high


def test_seeds_widen_the_interval():
    """An entrant whose seeds differ is known less well than the worlds alone say."""
    worlds = np.random.default_rng(0).uniform(0, 0.1, (1, 300))
    apart = np.array([[0.0], [0.4], [0.8]]) + worlds
    found = bootstrap({"alike": np.repeat(worlds, 3, 0), "apart": apart})
    widths = {
        name: each.estimate().high - each.estimate().low for name, each in found.items()
    }
    # With three seeds, the variance of the mean is a third of that of the seeds.
    expected = apart.mean(axis=1).std() / np.sqrt(3)
    assert found["apart"].resampled.std() == pytest.approx(expected, rel=0.05)
    assert widths["apart"] > 20 * widths["alike"]


@pytest.mark.slow
def test_intervals_cover_the_mean():
    """In about 95 of 100 draws."""
    rng, inside = np.random.default_rng(5), 0
    for seed in range(200):
        found = bootstrap({"a": rng.exponential(1.0, (1, 60))}, seed)["a"].estimate()
        inside += found.low <= 1.0 <= found.high
    assert 180 <= inside <= 198


def test_a_few_worlds_cannot_tell_much():
    """p is at least that of an exact test by signs."""
    rng = np.random.default_rng(1)
    for worlds in (1, 5, 8):
        one = rng.uniform(0.5, 1.0, (1, worlds))
        found = bootstrap({"one": one, "none": np.zeros((1, worlds))})
        p = found["one"].minus(found["none"]).p_value()
        assert p == stats.binomtest(worlds, worlds).pvalue


def test_sets_weigh_the_same():
    small, large = np.zeros((1, 10)), np.ones((1, 90))
    parts = [bootstrap({"a": each})["a"] for each in (small, large)]
    assert over_sets(parts).mean == 0.5
    assert over_sets(parts).estimate().low == pytest.approx(0.5)


def test_worlds_must_be_the_same():
    with pytest.raises(ValueError, match=r"the same worlds, got \[3, 4\]"):
        bootstrap({"a": np.zeros((1, 3)), "b": np.zeros((1, 4))})


def test_interquartile_mean():
    """That of scipy for sets of equal size; sets of other sizes count alike."""
    values = np.random.default_rng(1).normal(size=(3, 40))
    trimmed = stats.trim_mean(values.ravel(), 0.25)
    assert interquartile_mean(values) == pytest.approx(trimmed)
    repeated = [values[0], np.repeat(values[1], 5), values[2]]
    assert interquartile_mean(repeated) == pytest.approx(trimmed)


def test_probability_of_improvement():
    """The Mann-Whitney statistic of each world, on average."""
    one = np.array([[1.0, 0.0], [3.0, 0.0]])
    other = np.array([[2.0, 0.0]])
    assert probability_of_improvement(one, other) == 0.5
    assert probability_of_improvement(one + 5, other) == 1.0
    back = probability_of_improvement(other, one)
    assert probability_of_improvement(one, other) + back == 1.0


@pytest.mark.parametrize("case", json.loads(RLIABLE.read_text()))
def test_beside_rliable(case):
    """Where runs are unpaired, figures are those of rliable 1.2.0 (Agarwal et al.)."""
    one, other = np.array(case["one"]), np.array(case["other"])
    assert bootstrap({"": one})[""].mean == pytest.approx(case["mean"])
    assert interquartile_mean([one]) == pytest.approx(case["iqm"])
    assert probability_of_improvement(one, other) == pytest.approx(case["better"])


def test_holm():
    """An example by hand; never smaller than without it, never above 1."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []
