"""What a picture of the failure changes: repairs by a model, with and without it.

    python -m benchmarks.vision_trial judge TRIAL OUT [-n 40]
    python -m benchmarks.vision_trial show OUT

TRIAL has a folder LEVEL-NAME for each failing controller, which is that of the answer
`results/ladder/genuine/LEVEL/NAME`. In it are the answers `with.md` and `without.md` to
the question to repair it, with `tdac synth --vision` and without. `judge` drives all
three on the first N hidden worlds of a salt that it draws and keeps in OUT/sealed;
after an interruption, the same command continues. At the end the salt is revealed: OUT
has `salt.hex`, and `worlds.csv` with a row for each episode. An answer without a usable
file counts as the controller before it.

`show` prints a row for each controller and the means over all of them, with 95 %
intervals. The unit of the means is the controller; that of a row is the world.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.recorded_answers import (
    SALT,
    WORLDS,
    driven_on,
    episodes_in,
    interval,
)
from tdac_agent.prompting.extract import extract_source
from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.salt import SEALED, drawn_salt

GENUINE = Path(__file__).parents[1] / "results" / "ladder" / "genuine"
BEFORE, WITH, WITHOUT = "before", "with", "without"
ARMS = BEFORE, WITH, WITHOUT
FIGURES = "success", "time_score"


def sources(folder: Path) -> dict[str, str]:
    """The controllers of one folder of a trial, by arm."""
    level, name = folder.name.split("-")
    before = _source(GENUINE / level / name / "reply.md")
    assert before is not None
    answers = {arm: _source(folder / f"{arm}.md") for arm in (WITH, WITHOUT)}
    return {BEFORE: before} | {arm: found or before for arm, found in answers.items()}


def _source(reply: Path) -> str | None:
    return extract_source(reply.read_text(encoding="utf-8"))


def judge(trial: Path, out: Path, worlds: int) -> None:
    """Drives all controllers, and writes what came out."""
    out.mkdir(parents=True, exist_ok=True)
    salt = drawn_salt(out / SEALED, reuse=True)
    episodes = []
    with WarmJudge() as warm:
        for folder in sorted(path.parent for path in trial.glob(f"*/{WITH}.md")):
            level = folder.name.split("-")[0]
            for arm, source in sources(folder).items():
                kept = out / SEALED / folder.name / arm
                report = driven_on(source, level, worlds, salt, kept, warm)
                if report.refused:
                    # Without an episode: the tests of the contract fail.
                    print(f"{folder.name} {arm}: refused: {'; '.join(report.told)}")
                    driven = refused(worlds)
                else:
                    driven = episodes_in(kept)
                driven.insert(0, "arm", arm)
                driven.insert(0, "controller", folder.name)
                episodes.append(driven)
                mean = driven["time_score"].mean()
                print(f"{folder.name} {arm}: time score {mean:.3f}", flush=True)
    table = pd.concat(episodes)
    table.insert(5, "success", table["outcome"] == "reached")
    write_atomic(out / WORLDS, table.to_csv(index=False))
    write_atomic(out / SALT, salt.read_bytes().hex() + "\n")


def refused(worlds: int) -> pd.DataFrame:
    """The rows of a controller that may not drive."""
    rows = {"index": range(worlds), "outcome": "refused", "time_score": 0.0}
    return pd.DataFrame(rows)


def show(out: Path) -> None:
    """Prints the table of a trial."""
    table = pd.read_csv(out / WORLDS)
    print("| controller | before | with a picture | without | with minus without |")
    print("|---|---|---|---|---|")
    differences: dict[str, list[float]] = {name: [] for name in PAIRS}
    for name, rows in table.groupby("controller"):
        means = rows.groupby("arm")[list(FIGURES)].mean()
        cells = [
            f"{means.loc[a, 'success']:.0%}, {means.loc[a, 'time_score']:.3f}"
            for a in ARMS
        ]
        scores = rows.pivot_table(index="index", columns="arm", values="time_score")
        paired = (scores[WITH] - scores[WITHOUT]).to_numpy()
        cells.append(_estimate(paired))
        print(f"| {name} | {' | '.join(cells)} |")
        for pair, (figure, one, other) in PAIRS.items():
            change = means.loc[one, figure] - means.loc[other, figure]
            differences[pair].append(float(change))
    print()
    for pair, changes in differences.items():
        print(f"{pair}: {_estimate(np.array(changes))}, {len(changes)} controllers")


PAIRS = {
    f"{figure}, {one} minus {other}": (figure, one, other)
    for figure in FIGURES
    for one, other in ((WITH, BEFORE), (WITHOUT, BEFORE), (WITH, WITHOUT))
}


def _estimate(differences: np.ndarray) -> str:
    low, high = interval(differences)
    return f"{differences.mean():+.3f} ({low:+.3f} to {high:+.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.vision_trial")
    parts = parser.add_subparsers(dest="what", required=True)
    judged = parts.add_parser("judge")
    judged.add_argument("trial", type=Path)
    judged.add_argument("out", type=Path)
    judged.add_argument("-n", "--worlds", type=int, default=40)
    shown = parts.add_parser("show")
    shown.add_argument("out", type=Path)
    options = parser.parse_args()
    if options.what == "judge":
        judge(options.trial, options.out, options.worlds)
    else:
        show(options.out)


if __name__ == "__main__":
    main()
