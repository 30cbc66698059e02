"""Times generated worlds, and prints how hard they are and how many drafts are used.

    python -m benchmarks.generated_worlds [NAME …] [-n WORLDS] [--json FILE]

The times are CPU times of one ready world: all drafts, admission, clearance, distance
field and difficulty. The other columns are medians with the 5 % and the 95 % quantile.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np

from tdac_envs.ladder.difficulty import Difficulty
from tdac_envs.ladder.generators.registry import GENERATORS
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.ladder.worlds import WorldSpec, make_world

FIGURES = [field.name for field in fields(Difficulty)]


def main() -> int:
    """Prints a block for each generator."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.generated_worlds")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(GENERATORS))
    parser.add_argument("-n", type=int, default=1000, help="worlds of each generator")
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    wrong = sorted(set(options.names) - set(GENERATORS))
    if wrong:
        parser.error(f"no generator {wrong[0]!r}; there are {', '.join(GENERATORS)}")
    if options.n < 1:
        parser.error(f"-n: expected at least 1 world, got {options.n}")
    found = {}
    for name in options.names or GENERATORS:
        found[name] = measured(name, options.n)
        print(_line(name, found[name]), flush=True)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")
    return 0


def measured(name: str, count: int) -> dict[str, Any]:
    """Times, acceptance and difficulty of so many worlds of a generator."""
    spec = WorldSpec.model_validate({"generator": {"name": name}})
    make_world(spec, bytes(32))
    seconds, figures, rejected = [], [], Counter[str]()
    for index in range(count):
        key = world_key(b"benchmark", name, "bench", index, "world")
        begin = time.process_time()
        world = make_world(spec, key)
        seconds.append(time.process_time() - begin)
        figures.append(astuple(world.difficulty))
        rejected.update(reason.value for reason in world.rejected)
    table = np.quantile(figures, [0.05, 0.5, 0.95], axis=0).T
    return {
        "worlds": count,
        "median_ms": 1e3 * float(np.median(seconds)),
        "p99_ms": 1e3 * float(np.quantile(seconds, 0.99)),
        "acceptance": count / (count + sum(rejected.values())),
        "rejected": dict(rejected.most_common()),
        **dict(zip(FIGURES, table.tolist(), strict=True)),
    }


def _line(name: str, found: dict[str, Any]) -> str:
    times = f"{found['median_ms']:.1f} ms, 99 %: {found['p99_ms']:.1f} ms"
    head = f"{name}: {found['worlds']} worlds, {found['acceptance']:.0%} of the drafts"
    parts = [f"{head}; {times}"]
    for figure in FIGURES:
        low, middle, high = found[figure]
        parts.append(f"  {figure} {middle:.3g} ({low:.3g} to {high:.3g})")
    parts += [f"  rejected: {n} × {why}" for why, n in found["rejected"].items()]
    return "\n".join(parts)


if __name__ == "__main__":
    sys.exit(main())
