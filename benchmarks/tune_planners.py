"""Tunes the classical planners of `tdac bench`: the same procedure for all.

    python -m benchmarks.tune_planners OUT [PLANNER LEVEL]...

24 settings drive on 8 worlds of `train`, the best third of them on 24, the best two on
64. The first setting is that of the file, the others are drawn from the ranges in
`planners.yaml`: evenly in the logarithm where the lower bound is positive, else evenly.
The best mean time score wins; of equals, the earlier setting. Without PLANNER LEVEL,
all are tuned. `OUT/tuned.json` is what `tdac_agent/planners/files` has, and
`OUT/tuning.json` has all figures. After an interruption, the same command goes on.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import multiprocessing
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.planners.names import planner_names
from tdac_agent.planners.planner import (
    TUNED,
    levels_of,
    ranges_of,
    source_on,
    with_values,
)
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.judge.set_files import write_files
from tdac_envs.drive.scores import time_score
from tdac_envs.ladder.env import make
from tdac_envs.ladder.task_sets import load_set

FIRST = 100
"""The first of the worlds."""
SETTINGS = 24
ROUNDS = (24, 8), (8, 24), (2, 64)
"""Settings that are left, and worlds on which they drive."""
SEED = 1


def tune(name: str, level: str, out: Path) -> None:
    """Tunes a planner for a level, and writes what came out."""
    source, ranges = source_on(name, load_set(level)), ranges_of(name)
    rng = np.random.default_rng(SEED)
    settings = [own_values(source, ranges)]
    settings += [drawn(ranges, rng) for _ in range(SETTINGS - 1)]
    sources = [source, *(with_values(source, each) for each in settings[1:])]
    left, scores, told = list(range(SETTINGS)), {}, []
    for number, worlds in ROUNDS:
        left = sorted(sorted(left, key=lambda k: -scores.get(k, 0.0))[:number])
        for k in left:
            rows = driven(sources[k], level, worlds, out)
            scores[k] = float(np.mean([row["time_score"] for row in rows]))
            told.append({"setting": k, "worlds": worlds, "time_score": scores[k]})
            print(name, level, told[-1], flush=True)
    best = min(left, key=lambda k: (-scores[k], k))
    before = driven(source, level, ROUNDS[-1][1], out)
    figures = {
        "best": best,
        "of_the_file": float(np.mean([row["time_score"] for row in before])),
        "tuned": scores[best],
        "rounds": told,
    }
    keep(out / TUNED, name, level, settings[best])
    keep(out / "tuning.json", name, level, figures)


def own_values(source: str, ranges: dict[str, tuple[float, float]]) -> dict[str, float]:
    """The values of constants in a file."""
    found = {}
    for name in ranges:
        line = re.search(rf"^{name} = (\S+)", source, re.MULTILINE)
        assert line is not None
        found[name] = float(line[1])
    return found


def drawn(
    ranges: dict[str, tuple[float, float]], rng: np.random.Generator
) -> dict[str, float]:
    """A setting, to three digits."""
    setting = {}
    for name, (low, high) in ranges.items():
        if low > 0.0:
            value = math.exp(rng.uniform(math.log(low), math.log(high)))
        else:
            value = rng.uniform(low, high)
        setting[name] = float(f"{value:.3g}")
    return setting


def driven(source: str, level: str, worlds: int, out: Path) -> list[dict[str, Any]]:
    """The first episodes of a file; those that have been driven are in `OUT/driven`."""
    name = sha256_of(source, load_set(level).dynamics)[:16]
    file = out / "driven" / level / f"{name}.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    text = file.read_text(encoding="utf-8") if file.exists() else ""
    rows = [json.loads(line) for line in text.splitlines()]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for index in range(FIRST + len(rows), FIRST + worlds):
            rows.append(pool.apply(drive, (source, level, index)))
            with file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(rows[-1]) + "\n")
    return rows[:worlds]


def drive(source: str, level: str, index: int) -> dict[str, Any]:
    """Drives an episode with a fresh module, in a process for such episodes."""
    env = make(level, split="train", privileged=True)
    # The seed draws the disturbances of a training episode.
    observation, _ = env.reset(seed=index, options={"index": index})
    with tempfile.TemporaryDirectory(prefix="tdac-tune-") as name:
        folder = Path(name)
        write_files(folder, env.set.file, env.task)
        (folder / "controller.py").write_text(source, encoding="utf-8")
        os.chdir(folder)
        spec = importlib.util.spec_from_file_location("c", folder / "controller.py")
        assert spec is not None
        assert spec.loader is not None
        controller: Any = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(controller)
        controller.reset(observation)
        steps, over = 0, False
        while not over:
            action = np.asarray(controller.policy(observation), np.float32)
            observation, _, terminated, truncated, info = env.step(action)
            steps, over = steps + 1, terminated or truncated
        os.chdir("/")
    least = env.setup.source.world(index).difficulty.steps
    reached = bool(info["is_success"])
    score = time_score(reached, steps, least)
    return {"index": index, "reached": reached, "steps": steps, "time_score": score}


def keep(file: Path, name: str, level: str, value: object) -> None:
    """Writes an entry of a JSON file."""
    data = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    data.setdefault(name, {})[level] = value
    write_atomic(file, json.dumps(data, indent=1) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tune_planners")
    parser.add_argument("out", type=Path)
    parser.add_argument("pairs", nargs="*", metavar="PLANNER LEVEL")
    options = parser.parse_args()
    words = options.pairs
    pairs = list(zip(words[::2], words[1::2], strict=True)) or [
        (name, level)
        for name in planner_names()
        if ranges_of(name)
        for level in levels_of(name)
    ]
    for name, level in pairs:
        tune(name, level, options.out.resolve())


if __name__ == "__main__":
    main()
