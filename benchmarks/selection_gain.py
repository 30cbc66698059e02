"""What selection alone adds: the best of several independent answers, and no repair.

    python -m benchmarks.selection_gain results/ladder/loops/selection.csv

For each run of `results/ladder/loops/gain.csv` with more than one candidate, as many
first answers of the level are drawn as the run had candidates, at most all of them. The
one with the best mean on some worlds is selected, and its gain is its mean on the 50
worlds of `gain.csv` minus the mean of all answers there. Nothing is driven: the scores
are those of `results/ladder/genuine/figures/LEVEL/worlds.csv`, and worlds that select
are not among the 50.

A row for each run: the gain if the drawn answers share 64 worlds, as in the selection
of these runs, 128, as all episodes of a run, and with all other worlds for each.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from tdac_agent.storage.files import write_atomic

RESULTS = Path("results/ladder")
WORLDS = 50
SHARED = 64, 128
DRAWS = 20_000


def gain(scores: pd.DataFrame, count: int, worlds: int, seed: int) -> float:
    """Mean gain of the selected one of `count` answers over a random answer.

    Args:
        scores: Time scores, a row per world and a column per answer.
        count: Number of answers that are drawn, without replacement.
        worlds: Worlds that each of them drives on, drawn from those after the first 50.
        seed: Of the draws.
    """
    random = np.random.default_rng(seed)
    values = scores.to_numpy()
    judged, others = values[:WORLDS].mean(axis=0), values[WORLDS:]
    chosen = np.empty(DRAWS)
    for n in range(DRAWS):
        answers = random.permutation(values.shape[1])[:count]
        rows = random.permutation(len(others))[:worlds]
        means = others[np.ix_(rows, answers)].mean(axis=0)
        chosen[n] = judged[answers[means.argmax()]]
    return float(chosen.mean() - judged.mean())


def rows() -> list[dict[str, object]]:
    """A row for each run of the loop with more than one candidate."""
    runs = pd.read_csv(RESULTS / "loops" / "gain.csv")
    found: list[dict[str, object]] = []
    for run in runs[runs["candidates"] > 1].to_dict("records"):
        table = pd.read_csv(RESULTS / "genuine/figures" / run["level"] / "worlds.csv")
        answers = table[table["entrant"].astype(str).str.isdecimal()]
        scores = answers.pivot(index="index", columns="entrant", values="time_score")
        count = min(int(run["candidates"]), scores.shape[1])
        row = {name: run[name] for name in ("level", "run", "over_first")}
        row |= {"drawn": count, "answers": scores.shape[1]}
        for shared in SHARED:
            row[f"gain_{shared}"] = gain(scores, count, shared // count, run["run"])
        row["gain_all"] = gain(scores, count, len(scores) - WORLDS, run["run"])
        found.append(row)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.selection_gain")
    parser.add_argument("out", type=Path)
    frame = pd.DataFrame(rows())
    write_atomic(parser.parse_args().out, frame.round(4).to_csv(index=False))
    means = frame.drop(columns=["level", "run"]).mean().round(3)
    print(means.to_string())


if __name__ == "__main__":
    main()
