"""Compares programs on the geometry of BARN with the log of the challenge's DWA.

    python -m benchmarks.barn RESULTS...

RESULTS are folders of `tdac bench ... --set barn,barn-slow -n 500`, with ten runs on
each of the 50 worlds of the log. For each entrant: the mean of the challenge's metric,
`success * OT / clip(AT, 2 OT, 8 OT)`, with an interval by resampling worlds, and
Spearman's correlation of its means of the worlds with those of the log. The correlation
of two halves of the log, five runs a world each, is about the most that can be reached.

It is about geometry only: here are neither Gazebo nor the dynamics of the Jackal, so no
figure ranks anything in the challenge.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from tdac_agent.metrics.paired import bootstrap
from tdac_envs.ladder.set_file import BUILT_IN
from tdac_envs.ladder.task_sets import load_set

LOG, WORLDS = BUILT_IN / "barn" / "dwa_log.csv", BUILT_IN / "barn" / "worlds.json"
SPLITS, RESAMPLES = 500, 4_000
Array = NDArray[np.float64]


def logged() -> pd.DataFrame:
    """The log: `world`, `run`, `success`, `metric`."""
    table = pd.read_csv(LOG, dtype={"world": str})
    worlds = json.loads(WORLDS.read_text(encoding="utf-8"))["worlds"]
    seconds = table["world"].map(lambda name: worlds[name]["path_length"] / 2.0)
    taken = np.clip(table["time_s"], 2.0 * seconds, 8.0 * seconds)
    table["metric"] = table["success"] * seconds / taken
    table["run"] = table.groupby("world").cumcount()
    return table


def driven(folder: Path) -> pd.DataFrame:
    """What entrants did: the columns of `logged`, and `entrant`."""
    table = pd.read_csv(folder / "worlds.csv")
    tasks = load_set("barn")
    names = {i: tasks.label("test", i).removeprefix("barn ") for i in range(500)}
    table["world"] = table["index"].map(names)
    table["run"] = table.groupby(["set", "entrant", "world"]).cumcount()
    table["entrant"] += " (" + table["set"] + ")"
    return table.rename(columns={"barn_score": "metric"})


def by_world(table: pd.DataFrame, worlds: list[str]) -> Array:
    """The metric, shape (runs, worlds)."""
    wide = table.pivot_table(index="run", columns="world", values="metric")
    return wide[worlds].to_numpy(np.float64)


def interval(values: Array) -> str:
    """Mean, and its 95 % interval by resampling worlds."""
    found = bootstrap({"": values.mean(axis=0)[None]})[""].estimate()
    return f"{found.value:.3f} ({found.low:.3f} to {found.high:.3f})"


def correlation(one: Array, other: Array) -> str:
    """Spearman's correlation of the worlds' means, and its interval."""
    rng = np.random.default_rng(0)
    pair = np.stack([one.mean(axis=0), other.mean(axis=0)])
    count = pair.shape[1]
    draws = [
        stats.spearmanr(*pair[:, rng.integers(count, size=count)]).statistic
        for _ in range(RESAMPLES)
    ]
    low, high = np.nanquantile(draws, (0.025, 0.975))
    return f"{stats.spearmanr(*pair).statistic:.2f} ({low:.2f} to {high:.2f})"


def ceiling(log: Array) -> tuple[float, float]:
    """Mean correlation of two halves of the log, and of one run with the others."""
    rng = np.random.default_rng(0)
    halves = []
    for _ in range(SPLITS):
        order = rng.permutation(len(log))
        one, other = log[order[:5]].mean(axis=0), log[order[5:]].mean(axis=0)
        halves.append(stats.spearmanr(one, other).statistic)
    single = [
        stats.spearmanr(log[k], np.delete(log, k, axis=0).mean(axis=0)).statistic
        for k in range(len(log))
    ]
    return float(np.mean(halves)), float(np.mean(single))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.barn")
    parser.add_argument("results", type=Path, nargs="+")
    folders = parser.parse_args().results
    table = logged()
    worlds = sorted(table["world"].unique(), key=int)
    log = by_world(table, worlds)
    halves, single = ceiling(log)
    reached = table["success"].mean()
    print("| entrant | reached | metric of BARN | correlation with the log |")
    print("|---|---:|---|---|")
    print(
        f"| log of move_base's DWA, in Gazebo | {reached:.3f} | {interval(log)} "
        f"| halves {halves:.2f}, one run {single:.2f} |"
    )
    for folder in folders:
        rows = driven(folder)
        for name, own in rows.groupby("entrant", sort=False):
            found = by_world(own, worlds)
            print(
                f"| {name} | {own['success'].mean():.3f} | {interval(found)} "
                f"| {correlation(found, log)} |"
            )
    first = driven(folders[0])
    for column, label in (("gap", "narrowest gap"), ("density", "occupied floor")):
        figure = first.groupby("world")[column].first()[worlds].to_numpy(np.float64)
        print(f"| {label} of the world | | | {correlation(figure[None], log)} |")


if __name__ == "__main__":
    main()
