"""The tables of `benchmarks.agreement`, from its rows alone.

`results/physics/PLAN.md` says what they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

SAMPLES, SEED = 10_000, 20261129
FEWEST = 5
"""Events, and others, without which an AUC says nothing."""
STRATA = ((0.0, 0.02), (0.02, 0.05), (0.05, 0.10), (0.10, np.inf))
SLIP = 20.0
"""A start at v m/s loses about v²/20 m."""


def load(out: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The pairs with their verdicts, and the rows of the episodes."""
    pairs = pd.read_csv(out / "pairs.csv")
    rows = read_episodes(out / "episodes.csv")
    rows["late"] = rows["cause"] == "time-out"
    return verdicts(pairs, rows), rows


def read_episodes(file: Path) -> pd.DataFrame:
    """The rows of a file, and whether each arrives without contact (`success`)."""
    rows = pd.read_csv(file)
    rows["success"] = (rows["outcome"] == "reached") & (rows["collisions"] == 0)
    return rows


def verdicts(pairs: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Adds to each pair whether it passes in each arm, and its margin."""
    passes = rows.groupby(["pair", "arm"])["success"].all().unstack()
    here = rows[rows["arm"] == "here"].groupby("pair")
    facts = pd.DataFrame(
        {
            "gap": here["gap"].min(),
            "too_close": here["too_close"].max() > 0,
            "late": rows.groupby("pair")["late"].any(),
        }
    )
    found = pairs.set_index("pair").join(passes, how="inner").join(facts)
    found = found.dropna(subset=["here", "there", "nudged"])
    for arm in passes.columns:
        found[arm] = found[arm].astype(object).where(found[arm].notna(), None)
    found["margin"] = found["gap"] / found["radius"]
    metres = found["metres"]
    found["in_slips"] = found["gap"] * metres / ((found["speed"] * metres) ** 2 / SLIP)
    robots = np.where(found["metres"] == 1.0, "tasks of the e-puck", "tasks on maps")
    found["place"] = np.where(found["is_level"], found["problem"], robots)
    return found.reset_index()


def share(events: int, count: int) -> str:
    """A share with its Clopper-Pearson interval, 95 %."""
    if count == 0:
        return "0 of 0"
    found = stats.binomtest(events, count).proportion_ci(0.95, "exact")
    interval = f"{found.low:.1%} to {found.high:.1%}"
    return f"{events} of {count}: {events / count:.1%} ({interval})"


def grouped(pairs: pd.DataFrame, by: str, arm: str) -> pd.Series:
    """Whether each controller, or family, that passes here fails in an arm."""
    passing = pairs[pairs["here"].astype(bool)]
    return (~passing[arm].astype(bool)).groupby(passing[by]).any()


def auc(scores: Sequence[float], events: Sequence[bool]) -> float:
    """Probability that an event has a smaller score than another one; ties half."""
    values, flags = np.asarray(scores, float), np.asarray(events, bool)
    small, large = values[flags], values[~flags]
    if not small.size or not large.size:
        return float("nan")
    below = (small[:, None] < large).mean() + 0.5 * (small[:, None] == large).mean()
    return float(below)


def auc_text(pairs: pd.DataFrame, score: str, arm: str = "there") -> str:
    """The AUC of a score among pairs that pass here, with its interval."""
    passing = pairs[pairs["here"].astype(bool)].dropna(subset=[score])
    events = ~passing[arm].astype(bool).to_numpy()
    count = int(events.sum())
    head = f"{count} events, {len(events) - count} others"
    if min(count, len(events) - count) < FEWEST:
        return f"too few to say ({head})"
    scores = passing[score].to_numpy(float)
    low, high = _bootstrap(passing["family"].to_numpy(), scores, events)
    value = auc(scores, events)
    said = "predicts" if low > 0.5 else "not shown to predict"
    return f"{value:.2f} ({low:.2f} to {high:.2f}; {head}): {said}"


def _bootstrap(
    families: np.ndarray, scores: np.ndarray, events: np.ndarray
) -> tuple[float, float]:
    """The 95 % interval of an AUC, of samples of families."""
    random = np.random.default_rng(SEED)
    members = [np.flatnonzero(families == name) for name in pd.unique(families)]
    found: list[float] = []
    while len(found) < SAMPLES:
        drawn = random.integers(len(members), size=len(members))
        own = np.concatenate([members[k] for k in drawn])
        value = auc(scores[own], events[own])
        if not np.isnan(value):
            found.append(value)
    low, high = np.percentile(found, (2.5, 97.5))
    return float(low), float(high)


def sign_test(pairs: pd.DataFrame) -> str:
    """Controllers that fail there alone against those that fail nudged alone."""
    there, nudged = (grouped(pairs, "controller", arm) for arm in ("there", "nudged"))
    alone, other = int((there & ~nudged).sum()), int((nudged & ~there).sum())
    both = int((there & nudged).sum())
    count = alone + other
    p = stats.binomtest(alone, count).pvalue if count else 1.0
    return (
        f"{alone} fail there alone, {other} nudged alone, {both} in both; exact sign "
        f"test p = {p:.2g}"
    )


def strata(pairs: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The strata of PLAN.md, of pairs that pass here."""
    passing = pairs[pairs["here"].astype(bool)]
    found = []
    for low, high in STRATA:
        words = (
            f"gap {low:.0%} to {high:.0%}" if high < np.inf else f"gap from {low:.0%}"
        )
        own = passing[(passing["margin"] >= low) & (passing["margin"] < high)]
        found.append((words, own))
    for column in ("place", "kind"):
        found += [(str(name), own) for name, own in passing.groupby(column)]
    close = passing["too_close"].astype(bool)
    found += [("some episode too close", passing[close])]
    found += [("none too close", passing[~close])]
    nudged = passing["nudged"].astype(bool)
    found += [("passes nudged", passing[nudged]), ("fails nudged", passing[~nudged])]
    found += [("without CPU time-outs", passing[~passing["late"].astype(bool)])]
    return found


def tables(out: Path) -> str:
    """All tables as Markdown."""
    pairs, rows = load(out)
    here, there = (pairs[arm].astype(bool) for arm in ("here", "there"))
    lines = [
        f"{len(pairs)} pairs of {pairs['controller'].nunique()} controllers and "
        f"{pairs['family'].nunique()} families, {len(rows)} episodes.",
        "",
        *_two_by_two(here, there, "there"),
        "",
        "| given that it passes here | fails there | fails nudged |",
        "|---|---|---|",
    ]
    for words, by in (("controllers", "controller"), ("families", "family")):
        cells = []
        for arm in ("there", "nudged"):
            fails = grouped(pairs, by, arm)
            cells.append(share(int(fails.sum()), len(fails)))
        lines.append(f"| {words} | {cells[0]} | {cells[1]} |")
    lines += _of_episodes(pairs, rows)
    lines += [
        "",
        f"There against nudged: {sign_test(pairs)}.",
        "",
        f"P(passes there | fails here), pairs: "
        f"{share(int((~here & there).sum()), int((~here).sum()))}.",
        "",
        "| AUC | value, 95 % interval |",
        "|---|---|",
        f"| margin in radii, fails there (primary) | {auc_text(pairs, 'margin')} |",
        f"| gap in slips, fails there | {auc_text(pairs, 'in_slips')} |",
        f"| margin in radii, fails nudged | {auc_text(pairs, 'margin', 'nudged')} |",
        *_within(pairs),
        "",
        "| pairs that pass here | fail there | fail nudged |",
        "|---|---|---|",
    ]
    for words, own in strata(pairs):
        cells = [
            share(int((~own[arm].astype(bool)).sum()), len(own))
            for arm in ("there", "nudged")
        ]
        lines.append(f"| {words} | {cells[0]} | {cells[1]} |")
    lines += _of_irsim(out, pairs, rows)
    return "\n".join(lines) + "\n"


def _two_by_two(here: pd.Series, there: pd.Series, where: str) -> list[str]:
    lines = [f"| pairs | passes {where} | fails {where} |", "|---|---:|---:|"]
    for words, rows in (("passes here", here), ("fails here", ~here)):
        lines.append(f"| {words} | {(rows & there).sum()} | {(rows & ~there).sum()} |")
    return lines


def _of_episodes(pairs: pd.DataFrame, rows: pd.DataFrame) -> list[str]:
    passing = pairs[pairs["here"].astype(bool)]["pair"]
    cells = []
    for arm in ("there", "nudged"):
        own = rows[rows["pair"].isin(passing) & (rows["arm"] == arm)]
        cells.append(f"{int((~own['success']).sum())} of {len(own)}")
    return [f"| single episodes (of pairs) | {cells[0]} | {cells[1]} |"]


def _within(pairs: pd.DataFrame) -> list[str]:
    """The AUC within each level, and the tasks, with three events and three others."""
    lines = []
    for name, own in pairs[pairs["here"].astype(bool)].groupby("place"):
        events = ~own["there"].astype(bool)
        if min(events.sum(), (~events).sum()) >= 3:
            value = auc(own["margin"].tolist(), events.tolist())
            counts = f"{events.sum()} events, {(~events).sum()} others"
            lines.append(f"| margin in radii, within {name} | {value:.2f} ({counts}) |")
    return lines


def _of_irsim(out: Path, pairs: pd.DataFrame, episodes: pd.DataFrame) -> list[str]:
    """The 2 × 2 table of ir-sim, whose episodes are the first three."""
    file = out / "irsim.csv"
    if not file.is_file():
        return []
    rows = pd.read_csv(file)
    count = int(rows["number"].max()) + 1
    own = episodes[(episodes["arm"] == "here") & (episodes["number"] < count)]
    rows["success"] = rows["outcome"] == "reached"
    passed = pd.DataFrame(
        {
            "here": own.groupby("pair")["success"].all(),
            "ir-sim": rows.groupby("pair")["success"].all(),
        }
    ).dropna()
    found = pairs.set_index("pair")[["controller", "family"]].join(passed, how="inner")
    here, there = found["here"].astype(bool), found["ir-sim"].astype(bool)
    fails = (~there[here]).groupby(found["controller"][here]).any()
    families = (~there[here]).groupby(found["family"][here]).any()
    return [
        "",
        f"ir-sim: {len(found)} pairs of {found['controller'].nunique()} controllers, "
        f"{count} episodes each at most.",
        "",
        *_two_by_two(here, there, "in ir-sim"),
        "",
        "| given that it passes here | fails in ir-sim |",
        "|---|---|",
        f"| controllers | {share(int(fails.sum()), len(fails))} |",
        f"| families | {share(int(families.sum()), len(families))} |",
    ]


def written(out: Path, show: Callable[[str], None] = print) -> None:
    """Writes OUT/tables.md."""
    text = tables(out)
    (out / "tables.md").write_text(text, encoding="utf-8")
    show(text)
