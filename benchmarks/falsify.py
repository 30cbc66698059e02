"""Whether `tdac falsify` names the right cause, and what an envelope costs.

    python -m benchmarks.falsify [--seeds 20] [--episodes 160] [--out results/falsify]
    python -m benchmarks.falsify --maze

Three controllers fail at a known deviation alone: they break if an action is three
steps late; if the axle is 10.7 % too short or 13.6 % too long; if the robot is 2.5 px
nearer to a wall than it seems. A fourth cannot fail in what is searched. For each and
each seed: whether the smallest failure has the right part alone, and is within 10 % of
the true margin. OUT/margins.csv has a row for each search; those that it has are not
made again, so that the same command goes on after an interruption. `--maze` times 256
episodes of the first controller of `builtin`, on Linux.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import ctypes
import io
import itertools
import os
import resource
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmarks.margins import (
    BREAKS_WHEN_LATE,
    CAREFUL,
    GAP,
    KNOWS_ITS_AXLE,
    LATE,
    RADIUS,
    TURN,
    write_corridor,
)
from tdac_agent import load_task
from tdac_agent.evaluation.policies import entrant_of, prepared
from tdac_agent.falsify.falsify import SearchPlan, falsify
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.warm import WarmJudge

MARGINS = "margins.csv"
WITHIN = 0.1
OTHERS = ("delay", "axle", "range_scale", "range_bias", "lag")
CASES = {
    "breaks when late": (BREAKS_WHEN_LATE, OTHERS, ("delay", float(LATE))),
    "knows its axle": (KNOWS_ITS_AXLE, OTHERS, ("axle", 1.0 / (1.0 + TURN) - 1.0)),
    "ignores the last 2.5 px": (
        CAREFUL,
        (*OTHERS, "pose_y"),
        ("pose_y", -GAP / RADIUS),
    ),
    "cannot fail": (CAREFUL, OTHERS, None),
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.falsify")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--episodes", type=int, default=160)
    parser.add_argument("--out", type=Path, default=Path("results/falsify"))
    parser.add_argument("--maze", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, WarmJudge() as judge:
        if options.maze:
            time_maze(judge)
            return
        task = load_task(write_corridor(Path(name)))
        file, rows = options.out / MARGINS, list[dict[str, str]]()
        if file.is_file():
            rows = list(csv.DictReader(file.read_text("utf-8").splitlines()))
        known = {(row["case"], row["seed"], row["budget"]) for row in rows}
        # Seeds first, so that an interrupted benchmark has some of all cases.
        for seed, title in itertools.product(range(options.seeds), CASES):
            about = title, str(seed), str(options.episodes)
            if about in known:
                continue
            row = searched(title, seed, options.episodes, task, Path(name), judge)
            rows.append(row)
            write_rows(file, rows)
            print(" ".join(f"{key}={value}" for key, value in row.items()), flush=True)
    for title in CASES:
        own = [row for row in rows if row["case"] == title]
        mean = sum(int(row["episodes"]) for row in own) / max(1, len(own))
        right = sum(row["right"] == "yes" for row in own)
        print(f"{title}: {right} of {len(own)}; {mean:.0f} episodes each")


def searched(
    title: str, seed: int, episodes: int, task: Task, folder: Path, judge: WarmJudge
) -> dict[str, str]:
    """A search for the failures of one of the controllers, as a row."""
    source, parts, expected = CASES[title]
    file = folder / "controller.py"
    file.write_text(source, encoding="utf-8")
    plan = SearchPlan(episodes=episodes, seed=seed, space=dict.fromkeys(parts))
    entrant = replace(entrant_of(str(file)), name=title)
    found = falsify(entrant, task, plan, judge=judge)
    failed = found.counterexample
    own = {} if failed is None else failed.deviation.parts()
    return {
        "case": title,
        "seed": str(seed),
        "budget": str(episodes),
        "expected": "" if expected is None else f"{expected[0]}={expected[1]:.6g}",
        "found": " ".join(f"{name}={value:.6g}" for name, value in own.items()),
        "right": "yes" if is_right(own, expected) else "no",
        "episodes": str(found.episodes),
    }


def write_rows(file: Path, rows: list[dict[str, str]]) -> None:
    """Writes the table, which has at least one row."""
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(file, text.getvalue())


def is_right(found: dict[str, float], expected: tuple[str, float] | None) -> bool:
    """Whether the smallest failure is the expected one, within a tenth."""
    if expected is None:
        return not found
    name, value = expected
    close = abs(found.get(name, 0.0) - value) <= WITHIN * abs(value)
    return list(found) == [name] and close


def time_maze(judge: WarmJudge) -> None:
    """CPU time of an envelope of 256 episodes, all processes, the sandbox included."""
    task = load_task("maze")
    # Processes whose parents have ended become our children, so that none is left out.
    pr_set_child_subreaper = 36
    ctypes.CDLL(None).prctl(pr_set_child_subreaper, 1, 0, 0, 0)

    def cpu() -> float:
        who = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
        used = [resource.getrusage(each) for each in who]
        return sum(each.ru_utime + each.ru_stime for each in used)

    entrant, _ = prepared(entrant_of("builtin"), task)
    plan = SearchPlan(episodes=256)
    began = cpu()
    found = falsify(entrant, task, plan, judge=judge)
    judge.close()
    with contextlib.suppress(ChildProcessError):  # none is left
        while True:
            os.waitpid(-1, 0)
    print(f"{found.episodes} episodes on maze: {cpu() - began:.1f} s of CPU")


if __name__ == "__main__":
    main()
