"""Measures how near the built-in controllers pass to obstacles on the bundled tasks.

    python -m benchmarks.builtin_gaps [--task NAME ...] [--seed N]

The first controller of `builtin`, with neutral parameters, drives each task from the
starts of a verification, in this process and without a sandbox. For each task, the
table has the episodes that reached the goal, the smallest gap of these, the required
gap, and the gap of the widest path from start to goal: no controller can keep more.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.in_process import Imported
from tdac_agent import load_task
from tdac_agent.builtin.provider import template_of
from tdac_agent.episodes.episode import Record, run_policy
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.tasks.task_file import bundled_tasks
from tdac_agent.verification.diagnosis.gap import Gap, gap_figure, gap_text
from tdac_agent.verification.diagnosis.nearest import gap_of
from tdac_agent.verification.suite.starts import JITTERS, episode_seed, spread_starts
from tdac_envs.epuck.gaps import clear_grid
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.mapping.score import connected

FINE = 0.001
"""Spacing of the lattice on which the widest path in a world is looked for, m."""


def episodes(task: Task, seed: int) -> Iterator[Rollout]:
    """Drives the built-in controller of a task from the starts of a verification."""
    starts = spread_starts(task.nominal, seed, JITTERS, task.start_check())
    template = template_of(task.setting)
    with tempfile.TemporaryDirectory(prefix="tdac-gaps-") as name:
        folder = lay_out(task, Path(name))
        source = template.render(template.kind())
        (folder / "controller.py").write_text(source, encoding="utf-8")
        with contextlib.chdir(folder):
            driver = _imported(folder)
            for number, start in enumerate((task.nominal.start, *starts)):
                steps = task.nominal.horizon
                own = episode_seed(seed, number)
                record = Record(task.make_env(), start, steps, seed=own)
                record.seen = task.setting.seen
                called = f"jitter {number}" if number else "nominal"
                terms: dict[str, Any] = {"held_out": False, "deadline": math.inf}
                yield run_policy(driver, record, called, **terms)


def _imported(folder: Path) -> Imported:
    """The controller in a folder, with the file `sensors.py` beside it."""
    sys.modules.pop("sensors", None)
    sys.path.insert(0, str(folder))
    try:
        return Imported(folder)
    finally:
        sys.path.remove(str(folder))


def widest_gap(task: Task) -> float:
    """The gap of the widest path from the nominal start to the goal, px or m.

    Paths are those of a lattice of pixels, or of `FINE` metres.
    """
    nominal: Any = task.nominal
    places = np.array([nominal.start[:2], nominal.goal])
    if isinstance(nominal, EPuckTask):
        solid, (left, low, right, high) = nominal.ground.solid, nominal.ground.bounds
        shape = (int((high - low) / FINE) + 1, int((right - left) / FINE) + 1)
        clear = np.full(shape, 0.2)
        clear_grid(*solid.arrays(), left, low, FINE, clear)
        places = (places - (left, low)) / FINE
    else:
        clear = nominal.terrain.clear
    ends = [(int(x), int(y)) for x, y in np.rint(places)]
    least, most = 0.0, min(float(clear[y, x]) for x, y in ends)
    for _ in range(30):
        middle = 0.5 * (least + most)
        passes = connected(clear >= middle, *ends)
        least, most = (middle, most) if passes else (least, middle)
    return least - float(nominal.body_radius)


def row(task: Task, seed: int) -> list[str]:
    """The row of a task."""
    driven = list(episodes(task, seed))
    units = task.setting.units
    gaps: list[Gap] = [
        gap
        for each in driven
        if each.reached and (gap := gap_of(each, task.nominal)) is not None
    ]
    least = min(gaps, key=lambda gap: gap.gap, default=None)
    close = sum(gap.too_close for gap in gaps)
    return [
        task.name,
        f"{len(gaps)}/{len(driven)}",
        "–" if least is None else gap_figure(least.gap, units),
        "–" if least is None else gap_figure(least.required, units),
        gap_figure(widest_gap(task), units),
        str(close),
        "–" if least is None else gap_text(least, units),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--task", action="append", help="default: all bundled tasks")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    table = Table()
    for name in ("task", "reached", "smallest gap", "required", "widest path"):
        table.add_column(name)
    table.add_column("too close")
    table.add_column("where")
    for name in options.task or bundled_tasks():
        table.add_row(*row(load_task(name), options.seed))
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
