"""The plan and the analysis of the trial of counterexamples as feedback."""

import itertools
import json
import math
import tarfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from benchmarks.counterexample_trial import (
    ARMS,
    NORM,
    OUTCOME,
    SHARE,
    options_of,
    planned,
    tables,
)

PLAN = Path("results/counterexample/plan.csv")
KEPT = PLAN.parent


def made_up():
    """Scores of all cells, drawn at random; the arm `with` carries further."""
    random = np.random.default_rng(4)
    rows = []
    for number, cell in enumerate(sorted(planned(), key=lambda each: each.name)):
        scores = {OUTCOME: random.uniform(), SHARE: random.uniform()}
        norm = math.inf if number == 0 else random.uniform() + 2 * (cell.arm == ARMS[0])
        about = {"group": cell.group, "level": cell.level, "arm": cell.arm}
        rows.append({**about, **scores, NORM: norm, "cost": 1000 + number})
    return pd.DataFrame(rows)


def test_the_plan_is_the_committed_one():
    lines = PLAN.read_text().splitlines()[1:]
    assert [line.split(",")[0] for line in lines] == [each.name for each in planned()]
    assert [int(line.split(",")[-1]) for line in lines] == [c.seed for c in planned()]


def test_arms_of_a_pair_differ_in_the_envelope_alone():
    for _, pair in itertools.groupby(planned(), key=lambda each: each.group):
        one, other = (options_of(cell) for cell in sorted(pair, key=lambda c: c.arm))
        assert {name for name in one if one[name] != other[name]} == {"envelope"}
        assert (one["envelope"], other["envelope"]) == (64, 0)


def test_the_analysis_agrees_with_permutations():
    scores = made_up()
    found = tables(scores)
    wide = scores.pivot(index="group", columns="arm", values=[OUTCOME, SHARE, NORM])
    for name in (OUTCOME, SHARE):
        one, other = (wide[name][arm] for arm in ARMS)
        test = stats.permutation_test(
            (one, other),
            lambda a, b, axis: np.mean(a - b, axis=axis),
            permutation_type="samples",
            vectorized=True,
        )
        assert found[name]["p"] == pytest.approx(test.pvalue)
        assert found[name]["mean"] == pytest.approx((one - other).mean())
    assert found[NORM]["larger"] == found[NORM]["of"] == 8
    assert found[NORM]["p"] == pytest.approx(2 / 2**8)
    least, most = sorted([found[SHARE]["p"], found[NORM]["p"]])
    adjusted = sorted([found[SHARE]["holm"], found[NORM]["holm"]])
    assert adjusted == pytest.approx([min(1, 2 * least), max(2 * least, most)])


def test_the_kept_drives_give_the_published_figures():
    """Scores, p-value and interval, from the rows of all hidden episodes."""
    scores = pd.read_csv(KEPT / "scores.csv").set_index(["group", "arm"])
    driven: dict[tuple[str, str], list[tuple[float, bool]]] = {}
    with tarfile.open(KEPT / "answers.tar.xz") as archive:
        for cell in planned():
            raw = archive.extractfile(f"./hidden/{cell.name}.jsonl").read()
            rows = [json.loads(line) for line in raw.splitlines()]
            assert len(rows) == 100
            driven[cell.group, cell.arm] = [
                (row["time_score"], row["outcome"] == "reached") for row in rows
            ]
    for key, episodes in driven.items():
        score, share = np.mean(episodes, axis=0)
        assert scores.loc[key, OUTCOME] == pytest.approx(score)
        assert scores.loc[key, SHARE] == pytest.approx(share)
    groups = sorted({group for group, _ in driven})
    change = np.array(
        [
            np.mean(driven[group, "with"], axis=0)[0]
            - np.mean(driven[group, "without"], axis=0)[0]
            for group in groups
        ]
    )
    signs = np.array(list(itertools.product((1, -1), repeat=len(change))))
    p = np.mean(np.abs(signs @ change) >= abs(change.sum()) - 1e-12)
    half = stats.t.ppf(0.975, len(change) - 1) * stats.sem(change)
    page = (KEPT / "README.md").read_text(encoding="utf-8").replace("−", "-")
    mean = change.mean()
    assert f"{mean:+.3f} ({mean - half:.3f} to {mean + half:.3f})" in page
    assert f"p = {p:.2f}" in page
    found = tables(scores.reset_index())[OUTCOME]
    assert (found["mean"], found["p"]) == pytest.approx((mean, p))
