"""Compares episodes that arrive here and fail in MuJoCo, step by step.

    python -m benchmarks.agreement_causes results/physics [--only PART_OF_A_NAME]

For each pair of the agreement table that passes here and fails there, the first episode
that fails there is driven again in both, with trajectories. A row of OUT/compared.csv
says how far apart the two paths are where it fails; lengths are in body radii:

- `apart`, between the robots at the step of the failure,
- `aside`, from the robot there to the nearest point of the path here,
- `turned`, difference of the headings at this point, rad,
- `gap`, smallest gap of the episode here,
- `slip`, what a start at full speed loses in MuJoCo (v²/20).

It is what causes.csv is written from; it decides nothing by itself.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.agreement import ARMS, ROWS, append, read
from benchmarks.agreement_pairs import Pair, all_pairs
from benchmarks.agreement_tables import SLIP, load
from tdac_agent.evaluation.replay import drive_episode
from tdac_agent.falsify.drives import named_disturbance
from tdac_agent.problems.part import Part

COMPARED = "compared.csv"
FIELDS = (
    *("pair", "number", "outcome", "cause", "step", "steps_here", "apart", "aside"),
    *("turned", "gap", "slip"),
)


def compare(out: Path, only: str = "") -> None:
    """Drives what has no row yet."""
    pairs, rows = load(out)
    wanted = pairs[pairs["here"].astype(bool) & ~pairs["there"].astype(bool)]
    facts = wanted.set_index("pair")
    done = {row["pair"] for row in read(out / COMPARED)}
    for pair in all_pairs():
        if pair.name not in facts.index or pair.name in done or only not in pair.name:
            continue
        own = rows[(rows["pair"] == pair.name) & (rows["arm"] == "there")]
        failed = own[~own["success"]].iloc[0]
        fact = facts.loc[pair.name]
        row = _compared(pair, int(failed["number"]), fact["radius"])
        speed = fact["speed"] * fact["metres"]
        row["slip"] = round(speed**2 / SLIP / fact["metres"] / fact["radius"], 4)
        append(out / COMPARED, FIELDS, [row])
        print(row, flush=True)


def _compared(pair: Pair, number: int, radius: float) -> dict[str, Any]:
    """The row of an episode, without `slip`."""
    problem = pair.opened()
    entrant, split = pair.entrant(problem), "test" if pair.is_level else ""
    own = named_disturbance(problem)
    found = {}
    for arm in ("here", "there"):
        physics, deviation = ARMS[arm]
        part = Part((number,), split, disturbance=own, physics=physics)
        driven = drive_episode(entrant, problem, part, deviation=deviation)
        found[arm] = driven.row, driven.rollout.trajectory
    (here, path), (there, other) = found["here"], found["there"]
    end, step = other.poses[-1], other.steps
    same = path.poses[min(step, path.steps)]
    offsets = np.hypot(*(path.poses[:, :2] - end[:2]).T)
    near = int(offsets.argmin())
    turned = math.remainder(float(end[2] - path.poses[near, 2]), math.tau)
    return {
        "pair": pair.name,
        "number": number,
        "outcome": there.outcome,
        "cause": there.cause or "",
        "step": step,
        "steps_here": here.steps,
        "apart": round(float(np.hypot(*(same - end)[:2]) / radius), 4),
        "aside": round(float(offsets[near] / radius), 4),
        "turned": round(turned, 4),
        "gap": round(float((here.least_gap or 0.0) / radius), 4),
    }


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.agreement_causes")
    parser.add_argument("out", type=Path, help=f"folder with {ROWS}")
    parser.add_argument("--only", default="", help="part of a pair's name")
    options = parser.parse_args()
    compare(options.out, options.only)


if __name__ == "__main__":
    main()
