"""The agreement table, computed again from its rows by other code."""

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

pytest.importorskip("pandas")
from benchmarks.agreement_tables import auc, load, share, tables

RESULTS = Path(__file__).parents[1] / "results" / "physics"
PAIRS = "pair,controller,family,kind,problem,is_level,sha256,radius,speed,metres\n{}\n"
HEADER = (
    "pair,arm,number,outcome,collisions,cause,steps,horizon,gap,too_close,d_min,d0,"
    "cpu_seconds,error"
)


def rows_of(file):
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def verdicts(folder):
    """By pair and arm, whether it passes; and the margin of each pair, in radii."""
    facts = {row["pair"]: row for row in rows_of(folder / "pairs.csv")}
    passes, gaps = defaultdict(lambda: defaultdict(lambda: True)), {}
    for row in rows_of(folder / "episodes.csv"):
        arrives = row["outcome"] == "reached" and row["collisions"] == "0"
        passes[row["pair"]][row["arm"]] &= arrives
        if row["arm"] == "here" and row["gap"]:
            gap = float(row["gap"]) / float(facts[row["pair"]]["radius"])
            gaps[row["pair"]] = min(gap, gaps.get(row["pair"], np.inf))
    whole = {pair: own for pair, own in passes.items() if len(own) == 3}
    return facts, whole, gaps


def expected(folder):
    """Lines that the tables must have."""
    facts, passes, gaps = verdicts(folder)
    cells = defaultdict(int)
    for own in passes.values():
        cells[own["here"], own["there"]] += 1
    yield f"| passes here | {cells[True, True]} | {cells[True, False]} |"
    yield f"| fails here | {cells[False, True]} | {cells[False, False]} |"
    for by, words in (("controller", "controllers"), ("family", "families")):
        texts = []
        for arm in ("there", "nudged"):
            fails = defaultdict(bool)
            for pair, own in passes.items():
                if own["here"]:
                    fails[facts[pair][by]] |= not own[arm]
            texts.append(clopper_pearson(sum(fails.values()), len(fails)))
        yield f"| {words} | {texts[0]} | {texts[1]} |"
    good = [pair for pair, own in passes.items() if own["here"]]
    failed = [gaps[p] for p in good if not passes[p]["there"]]
    others = [gaps[p] for p in good if passes[p]["there"]]
    if min(len(failed), len(others)) < 5:
        yield f"too few to say ({len(failed)} events, {len(others)} others)"
    else:
        u = stats.mannwhitneyu(others, failed).statistic
        yield f"(primary) | {u / len(failed) / len(others):.2f} ("


def clopper_pearson(k, n):
    """By quantiles of beta distributions."""
    low = stats.beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = stats.beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return f"{k} of {n}: {k / n:.1%} ({low:.1%} to {high:.1%})"


@pytest.fixture
def made_up(tmp_path):
    """Rows of 60 controllers, drawn: some fail early, in one arm or in several."""
    random, pairs, rows = np.random.default_rng(1), [], []
    for k in range(60):
        name, quality = f"c{k} on p", random.uniform(0.5, 1.0)
        pairs.append(f"{name},c{k // 2},f{k // 3},answer,p,True,0,8.0,30.0,0.0125")
        for arm in ("here", "nudged", "there"):
            for number in range(4):
                good = random.random() < quality
                outcome = "reached" if good else "collision"
                cause = "" if good else "collision"
                gap = random.random() if good else 0.0
                rows.append(
                    f"{name},{arm},{number},{outcome},0,{cause},9,99,{gap},0,0,9,1,"
                )
                if number == 0 and not good:
                    break
    (tmp_path / "pairs.csv").write_text(PAIRS.format("\n".join(pairs)))
    (tmp_path / "episodes.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    return tmp_path


@pytest.mark.slow
def test_tables_of_made_up_rows_are_those_of_other_code(made_up):
    text = tables(made_up)
    for line in expected(made_up):
        assert line in text
    assert "events" in text


def test_the_published_tables_are_those_of_the_published_rows():
    """As soon as they are published: all pairs have driven in all arms."""
    _, passes, _ = verdicts(RESULTS)
    whole = len(passes) == len(rows_of(RESULTS / "pairs.csv"))
    published = RESULTS / "tables.md"
    assert published.is_file() == whole
    if whole:
        text = published.read_text(encoding="utf-8")
        assert text == tables(RESULTS)
        for line in expected(RESULTS):
            assert line in text


def test_no_episode_is_there_twice_and_none_follows_a_failed_first_one():
    seen = defaultdict(list)
    for row in rows_of(RESULTS / "episodes.csv"):
        seen[row["pair"], row["arm"]].append(row)
    assert seen
    for own in seen.values():
        first = own[0]["outcome"] == "reached" and own[0]["collisions"] == "0"
        assert [row["number"] for row in own] == list("0123" if first else "0")


def test_a_share_has_its_exact_interval():
    assert share(0, 60) == clopper_pearson(0, 60) == "0 of 60: 0.0% (0.0% to 6.0%)"
    assert share(3, 20) == clopper_pearson(3, 20)
    assert share(0, 0) == "0 of 0"


def test_a_margin_predicts_if_small_gaps_fail():
    assert auc([1.0, 2.0, 3.0, 4.0], [True, True, False, False]) == 1.0
    assert auc([1.0, 1.0, 1.0], [True, False, False]) == 0.5
    assert auc([4.0, 1.0], [True, False]) == 0.0


def test_only_pairs_with_all_arms_count(made_up):
    text = (made_up / "episodes.csv").read_text().splitlines()
    kept = [line for line in text if not line.startswith("c3 on p,there")]
    (made_up / "episodes.csv").write_text("\n".join(kept) + "\n")
    pairs, _ = load(made_up)
    assert len(pairs) == 59
