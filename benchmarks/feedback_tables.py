"""Judges the runs of benchmarks.feedback_trial on hidden worlds, and makes the tables.

    python -m benchmarks.feedback_tables judge RUNS OUT --salt-file FILE [-n 40]
    python -m benchmarks.feedback_tables tables OUT

`judge` drives each candidate of each run once, on the first N hidden worlds of its
level (OUT/scores.csv), and the candidate that each run selected until a sequential test
says whether it is verified (OUT/verdicts.csv). `tables` needs these two files alone.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from benchmarks.feedback_trial import (
    ARMS,
    FIRST,
    OUT_WEIGHT,
    ROUNDS,
    characters,
    planned,
)
from tdac_agent.prompting.extract import extract_source
from tdac_agent.runs.run_record import load_run
from tdac_agent.runs.selection_record import read_selection
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.ladder.task_sets import load_set

CONTRASTS = (("I", "A+"), ("E", "A+"), ("S", "I"), ("I", "E"))
"""In this order; Holm over all of them, in each outcome. A+ are fresh answers at equal
cost."""
OUTCOMES = "time_score", "success"
OF_INTEREST = 0.03
"""Smallest difference of interest of the race over best of N, in time score."""


def judge(runs: Path, out: Path, salt: Path, worlds: int) -> None:
    """Drives all candidates on hidden worlds; writes a row for each."""
    out.mkdir(parents=True, exist_ok=True)
    rows, verdicts = [], []
    known = {level: known_controllers(level) for level in ("unknown", "lost", "floor")}
    with WarmJudge() as warm:
        for cell in planned():
            folder = runs / cell.name
            run, selection = load_run(folder), read_selection(folder)
            asked, answered = characters(folder)
            about = {
                "cell": cell.name,
                "group": cell.group,
                "level": cell.level,
                "arm": cell.arm,
                "omitted": len(cell.omit.split(",")) if cell.omit else 0,
                "asked": asked,
                "answered": answered,
            }
            pools = {
                (each.k, each.j): each.improve_time
                for each in (selection.candidates if selection else ())
            }
            for attempt in run.attempts:
                file = (
                    folder / f"iterations/k{attempt.k:02d}/j{attempt.j}/controller.py"
                )
                score = success = 0.0
                if attempt.valid and file.is_file():
                    found = _driven(file, cell.level, worlds, salt, warm)
                    score, success = found
                rows.append(
                    {
                        **about,
                        "k": attempt.k,
                        "kind": attempt.asked,
                        "session": "fresh",
                        "answered_on": _date(file),
                        **similarities(file, known[cell.level]),
                        "pool": pools.get((attempt.k, attempt.j)) or 0.0,
                        "time_score": score,
                        "success": success,
                    }
                )
            verified = None
            if run.controller.is_file():
                report = verify_episodes(
                    run.controller,
                    load_set(cell.level),
                    split="hidden",
                    salt_file=salt,
                    judge=warm,
                )
                verified = report.passed
            verdicts.append({**about, "verified": bool(verified)})
            pd.DataFrame(rows).to_csv(out / "scores.csv", index=False)
            pd.DataFrame(verdicts).to_csv(out / "verdicts.csv", index=False)


def known_controllers(level: str) -> dict[str, list[str]]:
    """The built-in controller and the recorded first answers of a level."""
    builtin = Path("tdac_agent/builtin/levels") / f"{level}.py"
    recorded = Path("results/ladder/genuine", level).glob("*/reply.md")
    answers = (extract_source(file.read_text("utf-8")) for file in recorded)
    return {
        "like_builtin": [builtin.read_text("utf-8")],
        "like_recorded": [answer for answer in answers if answer is not None],
    }


def similarities(file: Path, known: dict[str, list[str]]) -> dict[str, float | None]:
    """The largest share of lines that a controller has in common with known ones."""
    if not file.is_file():
        return dict.fromkeys(known)
    own = _lines(file.read_text("utf-8"))
    return {
        name: max((_shared(own, _lines(each)) for each in sources), default=None)
        for name, sources in known.items()
    }


def _lines(source: str) -> set[str]:
    """The different lines of code of a file, without spaces and comments."""
    lines = ("".join(line.partition("#")[0].split()) for line in source.splitlines())
    return {line for line in lines if len(line) > 8}


def _shared(own: set[str], other: set[str]) -> float:
    return round(len(own & other) / max(1, len(own | other)), 4)


def _date(file: Path) -> str:
    """When the file with an answer was written (UTC)."""
    if not file.is_file():
        return ""
    when = datetime.fromtimestamp(file.stat().st_mtime, UTC)
    return when.isoformat(timespec="minutes")


def _driven(
    file: Path, level: str, worlds: int, salt: Path, warm: WarmJudge
) -> tuple[float, float]:
    report = verify_episodes(
        file, load_set(level), worlds, split="hidden", salt_file=salt, judge=warm
    )
    if report.scores is None:
        return 0.0, 0.0
    return report.scores.time, report.scores.success


def after_rounds(scores: pd.DataFrame) -> pd.DataFrame:
    """The candidate that is best in the pool after each round, with its hidden scores.

    Args:
        scores: `scores.csv`.

    Returns:
        A row for each cell of the dose experiment and each round, from 0 (the first
        answers) to 4.
    """
    rows = []
    dose = scores[scores["arm"].isin([*ARMS, "A+"])]
    for cell, own in dose.groupby("cell", sort=False):
        for number in range(ROUNDS + 1):
            # After the last round, A+ has had all of its answers.
            most = FIRST + number if number < ROUNDS else own["k"].max()
            seen = own[own["k"] <= most]
            best = seen.sort_values(["pool", "k"], ascending=[False, True]).iloc[0]
            rows.append({**best.to_dict(), "cell": cell, "round": number})
    return pd.DataFrame(rows)


def sign_flip_p(differences: Sequence[float]) -> float:
    """Exact two-sided p-value of no mean difference, by all flips of the signs."""
    values = np.asarray(differences, np.float64)
    observed = abs(values.mean())
    signs = np.array(list(itertools.product((1.0, -1.0), repeat=len(values))))
    means = np.abs((signs * values).mean(axis=1))
    return float((means >= observed - 1e-12).mean())


def t_interval(differences: Sequence[float]) -> tuple[float, float]:
    """The 95 % interval of a mean, by Student's t."""
    values = np.asarray(differences, np.float64)
    half = stats.t.ppf(0.975, len(values) - 1) * stats.sem(values)
    return float(values.mean() - half), float(values.mean() + half)


def stratified_interval(pairs: pd.DataFrame) -> tuple[float, float]:
    """The 95 % interval of the mean of the levels' means, by Student's t."""
    groups = [own["difference"] for _, own in pairs.groupby("level")]
    mean = float(np.mean([own.mean() for own in groups]))
    variance = sum(own.var(ddof=1) / len(own) for own in groups) / len(groups) ** 2
    freedom = sum(len(own) - 1 for own in groups)
    half = float(stats.t.ppf(0.975, freedom) * np.sqrt(variance))
    return mean - half, mean + half


def holm(values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values, in the given order."""
    order = np.argsort(values)
    adjusted, worst = np.zeros(len(values)), 0.0
    for rank, index in enumerate(order.tolist()):
        worst = max(worst, min(1.0, (len(values) - rank) * values[index]))
        adjusted[index] = worst
    return [float(each) for each in adjusted]


def contrasts(final: pd.DataFrame, outcome: str) -> pd.DataFrame:
    """The contrasts between the arms after the last round, paired by run."""
    wide = final.pivot(index="group", columns="arm", values=outcome)
    rows = []
    for one, other in CONTRASTS:
        change = (wide[one] - wide[other]).tolist()
        low, high = t_interval(change)
        rows.append(
            {
                "outcome": outcome,
                "contrast": f"{one} - {other}",
                "runs": len(change),
                "mean": float(np.mean(change)),
                "low": low,
                "high": high,
                "p": sign_flip_p(change),
            }
        )
    table = pd.DataFrame(rows)
    table["p_holm"] = holm(table["p"].tolist())
    return table


def by_dose(final: pd.DataFrame) -> pd.DataFrame:
    """Mean gain of each arm over fresh answers, by level and omitted facts."""
    wide = final.pivot(index=["level", "omitted", "group"], columns="arm")
    fresh = wide["time_score"]["A+"]
    gains = {arm: wide["time_score"][arm] - fresh for arm in "EIS"}
    table = pd.DataFrame({"A+": fresh, **gains})
    return table.groupby(["level", "omitted"]).mean().reset_index()


def race_pairs(scores: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The race minus best of N, for each pair, and over all pairs.

    The score of a cell is that of its best candidate in the pool.
    """
    raced = scores[scores["arm"].isin(["best+", "race"])]
    best = raced.sort_values(["pool", "k"], ascending=[False, True]).groupby("cell")
    wide = (
        best.first()
        .reset_index()
        .pivot(index=["level", "group"], columns="arm", values="time_score")
    )
    pairs = wide.assign(difference=wide["race"] - wide["best+"]).reset_index()
    change = pairs["difference"].tolist()
    low, high = stratified_interval(pairs)
    within = low >= -OF_INTEREST and high <= OF_INTEREST
    return pairs, {
        "pairs": len(change),
        "mean": float(np.mean(change)),
        "low": low,
        "high": high,
        "p": stratified_p(pairs),
        "no_useful_difference": within,
    }


def stratified_p(pairs: pd.DataFrame) -> float:
    """Exact sign-flip p-value of the mean of the levels' means (levels are strata)."""
    groups: list[NDArray[np.float64]] = [
        own["difference"].to_numpy(np.float64) for _, own in pairs.groupby("level")
    ]
    means = []
    for values in groups:
        signs = np.array(list(itertools.product((1.0, -1.0), repeat=len(values))))
        means.append((signs * values).mean(axis=1))
    joint = means[0]
    for other in means[1:]:
        joint = (joint[:, None] + other[None, :]).ravel()
    observed = abs(sum(float(values.mean()) for values in groups))
    return float((np.abs(joint) >= observed - 1e-12).mean())


def costs(scores: pd.DataFrame) -> pd.DataFrame:
    """What each arm cost: characters asked plus five times those answered."""
    cells = scores.drop_duplicates("cell")
    cost = cells.assign(cost=cells["asked"] + OUT_WEIGHT * cells["answered"])
    return cost.groupby("arm")[["asked", "answered", "cost"]].mean().reset_index()


def tables(out: Path) -> None:
    """Writes all tables, as CSV and as text."""
    scores = pd.read_csv(out / "scores.csv")
    verdicts = pd.read_csv(out / "verdicts.csv")
    rounds = after_rounds(scores)
    final = rounds[rounds["round"] == ROUNDS]
    shown: dict[str, pd.DataFrame] = {
        "rounds": rounds.pivot_table(
            index=["level", "arm"], columns="round", values="time_score"
        ).reset_index(),
        "contrasts": pd.concat([contrasts(final, each) for each in OUTCOMES]),
        "by_dose": by_dose(final),
        "verified": verdicts.groupby(["level", "arm"])["verified"]
        .agg(["sum", "count"])
        .reset_index(),
        "costs": costs(scores),
    }
    pairs, summary = race_pairs(scores)
    shown["pairs"] = pairs
    for name, table in shown.items():
        table.to_csv(out / f"{name}.csv", index=False)
        print(f"\n{name}\n{table.to_string(index=False, float_format='%.3f')}")
    (out / "race.json").write_text(json.dumps(summary, indent=1) + "\n")
    print(json.dumps(summary))


def main() -> None:
    """Judges, or makes the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    judging = commands.add_parser("judge")
    judging.add_argument("runs", type=Path)
    judging.add_argument("out", type=Path)
    judging.add_argument("--salt-file", type=Path, required=True)
    judging.add_argument("-n", type=int, default=40)
    making = commands.add_parser("tables")
    making.add_argument("out", type=Path)
    options = parser.parse_args()
    if options.command == "judge":
        judge(options.runs, options.out, options.salt_file, options.n)
    else:
        tables(options.out)


if __name__ == "__main__":
    main()
