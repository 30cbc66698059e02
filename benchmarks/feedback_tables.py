"""Judges the runs of benchmarks.feedback_trial on hidden worlds, and makes the tables.

    python -m benchmarks.feedback_tables judge EXPERIMENT RUNS OUT --salts DIR [-n 40]
    python -m benchmarks.feedback_tables tables EXPERIMENT OUT

EXPERIMENT is `dose`, `race` or `transfer`. `judge` drives each candidate of each of its
runs once, on the first N hidden worlds of its level, whose salt is DIR/LEVEL
(OUT/scores.csv and OUT/worlds.csv), and the best one of each race on 200; it then has
the best one of each arm verified (OUT/verdicts.csv). Equal files of a level drive once.
`tables` needs these files alone.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
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
    DOSE_POOL,
    FIRST,
    OUT_WEIGHT,
    RACE_POOL,
    ROUNDS,
    Cell,
    characters,
    planned,
)
from benchmarks.recorded_answers import driven_on, episodes_in
from tdac_agent.prompting.extract import extract_source
from tdac_agent.runs.run_record import Attempt, load_run
from tdac_agent.runs.selection_record import CandidateFigures, read_selection
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.ladder.task_sets import load_set

PRIMARY = ("I", "A+")
OTHERS = (("E", "A+"), ("M", "A+"), ("S", "A+"), ("I", "M"), ("I", "E"), ("S", "I"))
"""Contrasts of the dose experiment. The primary one stands alone; Holm over the others.
A+ are fresh answers, as many as cost what the other arm cost."""
EXPERIMENTS = {"dose": "dose-", "race": "race-", "transfer": "rules-"}
"""How the groups of each experiment begin: each has its own salts and its own look."""
OUTCOMES = "time_score", "success"
OF_INTEREST = 0.03
"""Smallest difference of interest of the race over best of N, in time score."""
RACE_WORLDS = 200
COPIED = 0.5
"""Share of common lines from which an answer is called a copy."""


def cells_of(experiment: str) -> list[Cell]:
    """The cells of an experiment, in their order."""
    begins = EXPERIMENTS[experiment]
    return [cell for cell in planned() if cell.group.startswith(begins)]


def judge(experiment: str, runs: Path, out: Path, salts: Path, worlds: int) -> None:
    """Drives all candidates on hidden worlds, and verifies the best of each cell."""
    out.mkdir(parents=True, exist_ok=True)
    known = {level: known_controllers(level) for level in ("unknown", "lost", "floor")}
    rows: list[dict[str, Any]] = []
    verdicts: list[dict[str, Any]] = []
    driven: list[pd.DataFrame] = []
    with WarmJudge() as warm:
        for cell in cells_of(experiment):
            folder, salt = runs / cell.name, salts / cell.level
            about = facts_of(cell, folder)
            own = []
            for attempt, figures in _candidates(folder):
                file = (
                    folder / f"iterations/k{attempt.k:02d}/j{attempt.j}/controller.py"
                )
                row = {**about, **_of_answer(attempt, figures, file, cell)}
                row |= similarities(file, known[cell.level])
                table = _drive(file, cell.level, worlds, salt, out, warm)
                scores = {"time_score": 0.0, "success": 0.0}
                if table is not None:
                    scores = {name: float(table[name].mean()) for name in scores}
                    driven.append(table.assign(cell=cell.name, k=attempt.k))
                own.append({**row, **scores, "file": file})
            best = max(own, key=lambda row: (row["complete"], row["pool"], -row["k"]))
            if cell.arm in {"race", "best", "best+"}:
                # A difference of interest needs more worlds.
                table = _drive(best["file"], cell.level, RACE_WORLDS, salt, out, warm)
                score = 0.0 if table is None else float(table["time_score"].mean())
                best["race_score"] = score
            verdicts.append(
                {**about, "k": best["k"], **_verdict(best, cell, salt, warm)}
            )
            rows += own
    scores_table = pd.DataFrame(rows).drop(columns="file")
    scores_table.to_csv(out / "scores.csv", index=False)
    pd.DataFrame(verdicts).to_csv(out / "verdicts.csv", index=False)
    pd.concat(driven).to_csv(out / "worlds.csv", index=False)


def facts_of(cell: Cell, folder: Path) -> dict[str, Any]:
    """What is the same for all candidates of a cell."""
    asked, answered = characters(folder)
    return {
        "cell": cell.name,
        "group": cell.group,
        "level": cell.level,
        "arm": cell.arm,
        "omitted": len(cell.omit.split(",")) if cell.omit else 0,
        "answers": len(load_run(folder).attempts),
        "asked": asked,
        "answered": answered,
        "cost": asked + OUT_WEIGHT * answered,
    }


def _candidates(folder: Path) -> list[tuple[Attempt, CandidateFigures | None]]:
    """The answers of a run, each with its figures in the pool."""
    selection = read_selection(folder)
    figures = {
        (each.k, each.j): each for each in (selection.candidates if selection else ())
    }
    return [(each, figures.get((each.k, each.j))) for each in load_run(folder).attempts]


def _of_answer(
    attempt: Attempt, figures: CandidateFigures | None, file: Path, cell: Cell
) -> dict[str, Any]:
    """What is known of an answer before it drives on hidden worlds.

    Only a candidate that drove in the whole pool is complete: means of fewer worlds are
    of other worlds.
    """
    whole = RACE_POOL if cell.group.startswith("race") else DOSE_POOL
    worlds = 0 if figures is None else figures.pool_worlds
    assert worlds <= whole, (cell.name, attempt.k)
    reply = sorted(file.parent.glob("*.reply*.md"))
    source = file.read_text("utf-8") if file.is_file() else ""
    return {
        "k": attempt.k,
        "kind": attempt.asked,
        "valid": attempt.valid,
        "answered_on": _date(reply[-1]) if reply else "",
        "pool_worlds": worlds,
        "complete": worlds == whole,
        "pool": (figures and figures.improve_time) or 0.0,
        "reads_params": "params.json" in source,
    }


def _drive(
    file: Path, level: str, worlds: int, salt: Path, out: Path, warm: WarmJudge
) -> pd.DataFrame | None:
    """The episodes of a candidate; None if it has no file, or the tests refuse it."""
    if not file.is_file():
        return None
    source = file.read_text(encoding="utf-8")
    kept = out / "hidden" / level / f"{sha256_of(file.read_bytes())[:16]}-{worlds}"
    report = driven_on(source, level, worlds, salt, kept, warm)
    return None if report.refused else episodes_in(kept)


def _verdict(
    best: dict[str, Any], cell: Cell, salt: Path, warm: WarmJudge
) -> dict[str, Any]:
    """Whether the best candidate of a cell is verified: yes, no, or undecided."""
    if not best["file"].is_file():
        return {"verdict": "rejected"}
    tasks = load_set(cell.level)
    report = verify_episodes(
        best["file"], tasks, split="hidden", salt_file=salt, judge=warm
    )
    if report.refused or report.sequential is None:
        return {"verdict": "rejected"}
    return {"verdict": report.sequential.decision}


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
    """When a file was written (UTC)."""
    when = datetime.fromtimestamp(file.stat().st_mtime, UTC)
    return when.isoformat(timespec="minutes")


def best_of(seen: pd.DataFrame) -> pd.Series[Any]:
    """The candidate that is best in the pool; of equals, the earlier one."""
    order = ["complete", "pool", "k"]
    return seen.sort_values(order, ascending=[False, False, True]).iloc[0]


def after_rounds(scores: pd.DataFrame) -> pd.DataFrame:
    """The best candidate after each round of each arm, with its hidden scores.

    Round 0 is after the first answers. Of A+ and C there is one round, the last: all of
    their answers.
    """
    rows = []
    dose = scores[scores["arm"].isin([*ARMS, "A+", "C"])]
    for _, own in dose.groupby("cell", sort=False):
        whole = own["arm"].iloc[0] not in ARMS
        for number in [ROUNDS] if whole else range(ROUNDS + 1):
            seen = own if whole else own[own["k"] <= FIRST + number]
            rows.append({**best_of(seen).to_dict(), "round": number})
    return pd.DataFrame(rows)


def at_equal_cost(scores: pd.DataFrame, group: str, cost: float) -> pd.Series[Any]:
    """The best of as many fresh answers of a run as cost what another arm did.

    Args:
        scores: `scores.csv`.
        group: The group of both.
        cost: What the other arm cost; the number is rounded up.
    """
    fresh = scores[(scores["group"] == group) & (scores["arm"] == "A+")]
    one = fresh["cost"].iloc[0] / fresh["answers"].iloc[0]
    return best_of(fresh[fresh["k"] <= max(FIRST, math.ceil(cost / one - 1e-9))])


def differences(scores: pd.DataFrame, contrast: tuple[str, str], outcome: str) -> Any:
    """The difference between two arms after the last round, for each run."""
    final = after_rounds(scores)
    final = final[final["round"] == ROUNDS].set_index(["group", "arm"])
    one, other = contrast
    found = {}
    for group in sorted({group for group, arm in final.index if arm == one}):
        row = final.loc[(group, one)]
        if other == "A+":
            against = at_equal_cost(scores, group, row["cost"])
        else:
            against = final.loc[(group, other)]
        found[group] = float(row[outcome] - against[outcome])
    return pd.Series(found)


def sign_flip_p(values: Sequence[float]) -> float:
    """Exact two-sided p-value of no mean difference, by all flips of the signs."""
    own = np.asarray(values, np.float64)
    assert np.isfinite(own).all()
    signs = np.array(list(itertools.product((1.0, -1.0), repeat=len(own))))
    means = np.abs((signs * own).mean(axis=1))
    return float((means >= abs(own.mean()) - 1e-12).mean())


def t_interval(
    values: Sequence[float], confidence: float = 0.95
) -> tuple[float, float]:
    """The interval of a mean, by Student's t."""
    own = np.asarray(values, np.float64)
    half = stats.t.ppf(0.5 + confidence / 2, len(own) - 1) * stats.sem(own)
    return float(own.mean() - half), float(own.mean() + half)


def holm(values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values, in the given order."""
    order = np.argsort(values)
    adjusted, worst = np.zeros(len(values)), 0.0
    for rank, index in enumerate(order.tolist()):
        worst = max(worst, min(1.0, (len(values) - rank) * values[index]))
        adjusted[index] = worst
    return [float(each) for each in adjusted]


def contrasts(scores: pd.DataFrame, outcome: str) -> pd.DataFrame:
    """The contrasts after the last round: the primary one first, then the others."""
    rows = []
    for contrast in (PRIMARY, *OTHERS):
        change = differences(scores, contrast, outcome).tolist()
        low, high = t_interval(change)
        rows.append(
            {
                "outcome": outcome,
                "contrast": " - ".join(contrast),
                "runs": len(change),
                "not_zero": int(np.count_nonzero(change)),
                "mean": float(np.mean(change)),
                "low": low,
                "high": high,
                "p": sign_flip_p(change),
            }
        )
    table = pd.DataFrame(rows)
    table["p_holm"] = [table["p"][0], *holm(table["p"][1:].tolist())]
    return table


def dose_slope(scores: pd.DataFrame) -> dict[str, float]:
    """How the primary difference grows for each omitted fact.

    The p-value is of all permutations of the doses within each level that 20,000 draws
    give.
    """
    change = differences(scores, PRIMARY, "time_score")
    about = scores.drop_duplicates("group").set_index("group")
    dose = about.loc[change.index, "omitted"].to_numpy(np.float64)
    level = about.loc[change.index, "level"].to_numpy()
    values = change.to_numpy(np.float64)

    def slope(x: NDArray[np.float64]) -> float:
        parts = [(x[level == one], values[level == one]) for one in np.unique(level)]
        centred = [(a - a.mean(), b - b.mean()) for a, b in parts]
        return float(
            sum((a * b).sum() for a, b in centred)
            / sum((a * a).sum() for a, _ in centred)
        )

    random, observed, more = np.random.default_rng(0), slope(dose), 0
    draws = 20_000
    for _ in range(draws):
        moved = dose.copy()
        for one in np.unique(level):
            moved[level == one] = random.permutation(moved[level == one])
        more += abs(slope(moved)) >= abs(observed) - 1e-12
    return {"slope": observed, "p": (more + 1) / (draws + 1)}


def by_dose(scores: pd.DataFrame) -> pd.DataFrame:
    """Scores of all arms after the last round, by level and number of omitted facts."""
    final = after_rounds(scores)
    final = final[final["round"] == ROUNDS]
    runs = final[final["arm"] != "C"].drop_duplicates("group")
    dose = runs.set_index("group")["omitted"]
    final = final.assign(omitted=final["group"].str.removesuffix("-C").map(dose))
    table = final.pivot_table(
        index=["level", "omitted"], columns="arm", values="time_score"
    )
    return table.reset_index()


def race_pairs(scores: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The race minus best of N at equal cost, for each pair, and over all pairs."""
    raced = scores[scores["arm"].isin(["best", "best+", "race"])]
    best = pd.DataFrame([best_of(own) for _, own in raced.groupby("cell")])
    wide = best.pivot(index=["level", "group"], columns="arm", values="race_score")
    pairs = wide.assign(difference=wide["race"] - wide["best+"]).reset_index()
    low, high = stratified_interval(pairs)
    inner = stratified_interval(pairs, 0.9)  # two one-sided tests at 5 %
    return pairs, {
        "pairs": len(pairs),
        "mean": float(pairs.groupby("level")["difference"].mean().mean()),
        "low": low,
        "high": high,
        "p": stratified_p(pairs),
        "no_useful_difference": inner[0] >= -OF_INTEREST and inner[1] <= OF_INTEREST,
    }


def stratified_p(pairs: pd.DataFrame) -> float:
    """Exact sign-flip p-value of the mean of the levels' means (levels are strata)."""
    groups = [
        own["difference"].to_numpy(np.float64) for _, own in pairs.groupby("level")
    ]
    assert all(np.isfinite(own).all() for own in groups)
    joint = np.zeros(1)
    for values in groups:
        signs = np.array(list(itertools.product((1.0, -1.0), repeat=len(values))))
        joint = (joint[:, None] + (signs * values).mean(axis=1)).ravel()
    observed = abs(sum(float(values.mean()) for values in groups))
    return float((np.abs(joint) >= observed - 1e-12).mean())


def stratified_interval(
    pairs: pd.DataFrame, confidence: float = 0.95
) -> tuple[float, float]:
    """The interval of the mean of the levels' means, by Student's t."""
    groups = [own["difference"] for _, own in pairs.groupby("level")]
    mean = float(np.mean([own.mean() for own in groups]))
    variance = sum(own.var(ddof=1) / len(own) for own in groups) / len(groups) ** 2
    freedom = sum(len(own) - 1 for own in groups)
    half = float(stats.t.ppf(0.5 + confidence / 2, freedom) * np.sqrt(variance))
    return mean - half, mean + half


def transfers(scores: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, Any]]:
    """An answer with the rules of another run, minus one with a placebo."""
    own = scores[scores["arm"].isin(["rules", "placebo"])]
    wide = own.pivot(index=["level", "group"], columns="arm", values="time_score")
    pairs = wide.assign(difference=wide["rules"] - wide["placebo"]).reset_index()
    change = pairs["difference"].tolist()
    low, high = t_interval(change)
    facts = {"pairs": len(change), "mean": float(np.mean(change)), "low": low}
    return pairs, {**facts, "high": high, "p": sign_flip_p(change)}


def costs(scores: pd.DataFrame) -> pd.DataFrame:
    """What each arm cost, and how its answers were."""
    grouped = scores.groupby("arm")
    cells = scores.drop_duplicates("cell").groupby("arm")
    table = cells[["answers", "asked", "answered", "cost"]].mean()
    table["valid"] = grouped["valid"].mean()
    table["reads_params"] = grouped["reads_params"].mean()
    for name in ("like_builtin", "like_recorded"):
        table[f"most_{name}"] = grouped[name].max()
    return table.reset_index()


def checked(experiment: str, out: Path) -> pd.DataFrame:
    """`scores.csv`, if it has all cells of an experiment.

    Raises:
        SystemExit: It has not, or a score is missing.
    """
    scores = pd.read_csv(out / "scores.csv")
    missing = {cell.name for cell in cells_of(experiment)} - set(scores["cell"])
    if missing:
        raise SystemExit(f"{len(missing)} cells have not been judged: {min(missing)} …")
    if not np.isfinite(scores[["time_score", "success", "pool", "cost"]]).all().all():
        raise SystemExit("a score is missing")
    return scores


def tables(experiment: str, out: Path) -> None:
    """Writes the tables of an experiment, as CSV and as text, and its tests."""
    scores = checked(experiment, out)
    verdicts = pd.read_csv(out / "verdicts.csv")
    shown, found = MAKERS[experiment](scores)
    shown["verified"] = (
        verdicts.groupby(["level", "arm", "verdict"]).size().reset_index(name="runs")
    )
    shown["costs"] = costs(scores)
    for name, table in shown.items():
        table.to_csv(out / f"{name}.csv", index=False)
        print(f"\n{name}\n{table.to_string(index=False, float_format='%.3f')}")
    (out / "tests.json").write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))


def _dose(scores: pd.DataFrame) -> tuple[dict[str, pd.DataFrame], dict[str, float]]:
    """The tables of dose and response, and the test of its slope."""
    rounds = after_rounds(scores).pivot_table(
        index=["level", "arm"], columns="round", values="time_score"
    )
    shown = {
        "rounds": rounds.reset_index(),
        "contrasts": pd.concat([contrasts(scores, each) for each in OUTCOMES]),
        "by_dose": by_dose(scores),
    }
    return shown, dose_slope(scores)


def _race(scores: pd.DataFrame) -> tuple[dict[str, pd.DataFrame], dict[str, Any]]:
    pairs, found = race_pairs(scores)
    return {"pairs": pairs}, found


def _transfer(scores: pd.DataFrame) -> tuple[dict[str, pd.DataFrame], dict[str, Any]]:
    pairs, found = transfers(scores)
    return {"transfers": pairs}, found


MAKERS = {"dose": _dose, "race": _race, "transfer": _transfer}
"""What makes the tables of each experiment."""


def main() -> None:
    """Judges, or makes the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    judging = commands.add_parser("judge")
    judging.add_argument("experiment", choices=EXPERIMENTS)
    judging.add_argument("runs", type=Path)
    judging.add_argument("out", type=Path)
    judging.add_argument("--salts", type=Path, required=True)
    judging.add_argument("-n", type=int, default=40)
    making = commands.add_parser("tables")
    making.add_argument("experiment", choices=EXPERIMENTS)
    making.add_argument("out", type=Path)
    options = parser.parse_args()
    if options.command == "judge":
        judge(options.experiment, options.runs, options.out, options.salts, options.n)
    else:
        tables(options.experiment, options.out)


if __name__ == "__main__":
    main()
