"""Whether `tdac falsify` names the right cause, and what an envelope costs.

    python -m benchmarks.falsify [--seeds 20] [--episodes 160] [--maze]

Three controllers fail at a known deviation alone: they break if an action is three
steps late; if the axle is 10.7 % too short or 13.6 % too long; if the robot is 2.5 px
nearer to a wall than it seems. A fourth cannot fail in what is searched. For each and
each seed: whether the smallest failure has the right part alone, and is within 10 % of
the true margin. `--maze` times 256 episodes of the first controller of `builtin`.
"""

from __future__ import annotations

import argparse
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
from tdac_agent.verification.judge.warm import WarmJudge

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
    parser.add_argument("--maze", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name, WarmJudge() as judge:
        if options.maze:
            time_maze(judge)
            return
        task = load_task(write_corridor(Path(name)))
        for title, (source, parts, expected) in CASES.items():
            file = Path(name) / "controller.py"
            file.write_text(source, encoding="utf-8")
            right, driven = 0, 0
            for seed in range(options.seeds):
                space = dict.fromkeys(parts)
                plan = SearchPlan(episodes=options.episodes, seed=seed, space=space)
                entrant = replace(entrant_of(str(file)), name=title)
                found = falsify(entrant, task, plan, judge=judge)
                driven += found.episodes
                failed = found.counterexample
                own = {} if failed is None else failed.deviation.parts()
                right += is_right(own, expected)
                if not is_right(own, expected):
                    print(f"  {title}, seed {seed}: {own}", flush=True)
            mean = driven / options.seeds
            print(f"{title}: {right} of {options.seeds}; {mean:.0f} episodes each")


def is_right(found: dict[str, float], expected: tuple[str, float] | None) -> bool:
    """Whether the smallest failure is the expected one, within a tenth."""
    if expected is None:
        return not found
    name, value = expected
    close = abs(found.get(name, 0.0) - value) <= WITHIN * abs(value)
    return list(found) == [name] and close


def time_maze(judge: WarmJudge) -> None:
    """CPU time of an envelope of 256 episodes, all processes."""
    task = load_task("maze")

    def cpu() -> float:
        who = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
        used = [resource.getrusage(each) for each in who]
        return sum(each.ru_utime + each.ru_stime for each in used)

    entrant, _ = prepared(entrant_of("builtin"), task)
    plan = SearchPlan(episodes=256)
    began = cpu()
    found = falsify(entrant, task, plan, judge=judge)
    judge.close()
    print(f"{found.episodes} episodes on maze: {cpu() - began:.1f} s of CPU")


if __name__ == "__main__":
    main()
