"""Whether verdicts hold in another simulator: the agreement table.

    python -m benchmarks.agreement plan OUT      # the pairs of controller and problem
    python -m benchmarks.agreement drive OUT     # in three arms; goes on where it was
    python -m benchmarks.agreement drive OUT --part 1 --parts 2    # of two processes
    python -m benchmarks.agreement irsim OUT     # map controllers in ir-sim
    python -m benchmarks.agreement further OUT   # what arms that ended early left out
    python -m benchmarks.agreement tables OUT    # from the rows alone

OUT is `results/physics`, whose PLAN.md says what is driven and how it is judged.
`drive` needs the extras `physics` and `sb3`, `irsim` the package `ir-sim`. The rows of
an arm of a pair are appended to OUT/episodes.csv together.
"""

from __future__ import annotations

import argparse
import csv
import random
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.agreement_pairs import Pair, all_pairs
from benchmarks.agreement_tables import SEED, load, written
from tdac_agent.falsify.drives import JITTER, Drives
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.deviation import Deviation
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.judge.worlds import Case
from tdac_envs.ladder.env import make
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.carried import metres_of
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.mapping.bundled import bundled_maps
from tdac_envs.physics.moved import EXACT, MUJOCO

EPISODES = 4
"""Most episodes of a pair in each arm: worlds 0 to 3 of `test`, or seeds 0 to 3."""
NUDGE = Deviation(axle=0.001)
ARMS = {
    "here": (EXACT, Deviation()),
    "nudged": (EXACT, NUDGE),
    "there": (MUJOCO, Deviation()),
}
PAIRS, ROWS, IRSIM_ROWS = "pairs.csv", "episodes.csv", "irsim.csv"
FURTHER_ROWS = "further.csv"
IRSIM_EPISODES = 3
IRSIM_FIELDS = "pair", "number", "outcome", "steps", "error"
PAIR_FIELDS = (
    *("pair", "controller", "family", "kind", "problem", "is_level", "sha256"),
    *("radius", "speed", "metres"),
)
ROW_FIELDS = (
    *("pair", "arm", "number", "outcome", "collisions", "cause", "steps", "horizon"),
    *("gap", "too_close", "d_min", "d0", "cpu_seconds", "error"),
)


def plan(out: Path) -> None:
    """Writes the pairs, with what the robots of their problems are like."""
    rows, robots = [], dict[str, dict[str, float]]()
    for pair in all_pairs():
        if pair.problem not in robots:
            robots[pair.problem] = robot_of(pair.opened())
        own = {name: getattr(pair, name) for name in PAIR_FIELDS[1:6]}
        sha256 = sha256_of((pair.source or pair.word).encode())[:16]
        rows.append(
            {"pair": pair.name, **own, "sha256": sha256, **robots[pair.problem]}
        )
    out.mkdir(parents=True, exist_ok=True)
    _write(out / PAIRS, PAIR_FIELDS, rows)
    print(f"{len(rows)} pairs")


def robot_of(problem: Task | TaskSet) -> dict[str, float]:
    """Radius and greatest speed of a robot in the unit of its problem, and metres.

    `metres` are those of a unit in MuJoCo: of a map without a resolution, the radius is
    0.1 m there.
    """
    env: Any = (
        problem.make_env()
        if isinstance(problem, Task)
        else make(problem.name, split="test")
    )
    nominal = env.nominal
    is_map = isinstance(env, Map2DEnv)
    metres = metres_of(env.setup, nominal) if is_map else 1.0
    return {
        "radius": nominal.body_radius,
        "speed": nominal.full_step / nominal.dt,
        "metres": metres,
    }


def drive(out: Path, only: str = "", part: int = 0, parts: int = 1) -> None:
    """Drives what has no rows yet, in a drawn order.

    Args:
        out: Folder of the results.
        only: Part of the names of the pairs.
        part: Number of this process, from 0, of those that work at the same time.
        parts: Their number.
    """
    file = out / ROWS
    pairs = all_pairs()
    random.Random(SEED).shuffle(pairs)
    with WarmJudge() as judge:
        for pair in pairs[part::parts]:
            before = {row["arm"] for row in read(file) if row["pair"] == pair.name}
            missing = [arm for arm in ARMS if arm not in before]
            if only in pair.name and missing:
                began = time.monotonic()
                rows = drive_pair(pair, missing, judge)
                append(file, ROW_FIELDS, rows)
                said = {arm: _arrivals(rows, arm) for arm in missing}
                print(pair.name, said, f"{time.monotonic() - began:.0f} s", flush=True)


def drive_further(out: Path, only: str = "") -> None:
    """Drives what was left out after a failed first episode, of pairs that pass here.

    It was not planned: a reviewer asked for it after the tables. It decides no verdict.
    """
    passing = load(out)[0]
    passing = set(passing.loc[passing["here"].astype(bool), "pair"])
    file = out / FURTHER_ROWS
    done = {(row["pair"], row["arm"]) for row in read(file)}
    driven = Counter((row["pair"], row["arm"]) for row in read(out / ROWS))
    with WarmJudge() as judge:
        for pair in all_pairs():
            if pair.name not in passing or only not in pair.name:
                continue
            for arm in ARMS:
                first = driven[pair.name, arm]
                if first < EPISODES and (pair.name, arm) not in done:
                    rows = drive_pair(pair, [arm], judge, range(first, EPISODES))
                    append(file, ROW_FIELDS, rows)
                    print(pair.name, arm, _arrivals(rows, arm), flush=True)


def drive_pair(
    pair: Pair, arms: Sequence[str], judge: WarmJudge, numbers: range | None = None
) -> list[dict[str, Any]]:
    """The rows of some arms of a pair; without numbers, a failed first one ends it."""
    problem = pair.opened()
    entrant = pair.entrant(problem)
    found = []
    for arm in arms:
        physics, deviation = ARMS[arm]
        own = numbers or range(EPISODES)
        cases = [Case(number=number, deviation=deviation) for number in own]
        with Drives(
            entrant, problem, "test" if pair.is_level else "", len(cases),
            {"kind": "agreement"}, "auto", None, judge, physics=physics,
        ) as drives:  # fmt: skip
            rows = drives.drive(cases[:1], JITTER)
            # A failure of the first one decides the verdict.
            if numbers or (rows[0] is not None and rows[0].success):
                rows += drives.drive(cases[1:], JITTER)
        for number, row in zip(own, rows, strict=False):
            assert row is not None
            found.append({"pair": pair.name, "arm": arm, **figures(row, number)})
    return found


def drive_irsim(out: Path, only: str = "") -> None:
    """Drives controllers for maps in ir-sim, where they have no rows yet."""
    from benchmarks.irsim_drive import rollouts

    file = out / IRSIM_ROWS
    before = {row["pair"] for row in read(file)}
    pairs = [pair for pair in all_pairs() if fits_irsim(pair)]
    random.Random(SEED).shuffle(pairs)
    for pair in pairs:
        if only not in pair.name or pair.name in before:
            continue
        problem, rows = pair.opened(), []
        numbers = range(IRSIM_EPISODES)
        split = "test" if pair.is_level else ""
        for rollout in rollouts(pair.entrant(problem), problem, numbers, split):
            rows.append(
                {
                    "pair": pair.name,
                    "number": rollout.name,
                    "outcome": rollout.outcome,
                    "steps": rollout.trajectory.steps,
                    "error": (rollout.error or "")[:120].replace("\n", " "),
                }
            )
            if not rollout.reached:
                break
        append(file, IRSIM_FIELDS, rows)
        print(pair.name, [row["outcome"] for row in rows], flush=True)


def fits_irsim(pair: Pair) -> bool:
    """Whether the robot has exact ranges on a map, and no neural network drives."""
    if pair.kind == "learned":
        return False
    if pair.is_level:
        return pair.problem in {"known", "unknown"}
    return pair.problem in bundled_maps()


def figures(row: EpisodeRow, number: int) -> dict[str, Any]:
    """What is kept of an episode; lengths in the unit of its problem."""
    return {
        "number": number,
        "outcome": row.outcome,
        "collisions": row.collisions,
        "cause": row.cause or "",
        "steps": row.steps,
        "horizon": row.horizon,
        "gap": "" if row.least_gap is None else row.least_gap,
        "too_close": int(row.too_close),
        "d_min": row.d_min,
        "d0": row.d0,
        "cpu_seconds": row.cpu_seconds,
        "error": (row.error or "")[:120].replace("\n", " "),
    }


def _arrivals(rows: Iterable[dict[str, Any]], arm: str) -> int:
    return sum(r["outcome"] == "reached" for r in rows if r["arm"] == arm)


def read(file: Path) -> list[dict[str, str]]:
    """The rows of a table; none without a file."""
    if not file.is_file():
        return []
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def append(file: Path, names: Sequence[str], rows: Sequence[dict[str, Any]]) -> None:
    """Appends rows to a table, at once."""
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        _write(file, names, [])
    with file.open("a", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, names, lineterminator="\n")
        writer.writerows(rows)


def _write(file: Path, names: Sequence[str], rows: Sequence[dict[str, Any]]) -> None:
    with file.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.agreement")
    commands = parser.add_subparsers(required=True)
    runs = {
        "plan": plan, "drive": drive, "irsim": drive_irsim, "further": drive_further,
        "tables": written,
    }  # fmt: skip
    for name, run in runs.items():
        command = commands.add_parser(name)
        command.add_argument("out", type=Path)
        command.set_defaults(run=run)
        if name in {"drive", "irsim", "further"}:
            command.add_argument("--only", default="", help="part of a pair's name")
        if name == "drive":
            command.add_argument("--part", type=int, default=0)
            command.add_argument("--parts", type=int, default=1)
    options = vars(parser.parse_args())
    run = options.pop("run")
    run(**options)


if __name__ == "__main__":
    main()
