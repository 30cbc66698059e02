"""The tables of a campaign, from the folders of its runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from tdac_agent.campaign.plan import Plan
from tdac_agent.errors import RunError
from tdac_agent.metrics import (
    RunFrames,
    frames_of,
    set_frame_of,
    summarise,
    summarise_sets,
)
from tdac_agent.runs.run_record import RUN_FILE, Run, load_run
from tdac_agent.storage.files import write_atomic


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables of a campaign; those of tasks or sets that it has none of are empty.

    Attributes:
        tasks: The runs on single tasks, and their candidates.
        sets: The runs on task sets.
        summary: The metrics of runs on single tasks.
        set_summary: The metrics of runs on task sets.
    """

    tasks: RunFrames
    sets: pd.DataFrame
    summary: pd.DataFrame
    set_summary: pd.DataFrame

    def files(self, plan: Plan) -> dict[str, pd.DataFrame]:
        """The tables by their file names."""
        files: dict[str, pd.DataFrame] = {}
        if plan.tasks:
            files["runs.csv"] = self.tasks.runs
            files["candidates.csv"] = self.tasks.candidates
            files["summary.csv"] = self.summary
        if plan.sets:
            files["set_runs.csv"] = self.sets
            files["set_summary.csv"] = self.set_summary
        return files


def collect(plan: Plan, runs: Path) -> Tables:
    """The records of all runs of a plan, finished or not.

    The column `run` has their names, `KIND/rNNNN`, wherever the folder is.
    """
    records = list(_records(plan, runs))
    tasks, sets = frames_of(records), set_frame_of(records)
    for frame in (tasks.runs, tasks.candidates, sets):
        frame["run"] = frame["run"].str.removeprefix(f"{runs}/")
    return Tables(
        tasks,
        sets,
        summarise(tasks) if len(tasks.runs) else pd.DataFrame(),
        summarise_sets(sets) if len(sets) else pd.DataFrame(),
    )


def write_tables(tables: Tables, plan: Plan, out: Path) -> list[Path]:
    """Writes the tables of a campaign to its folder; returns their paths."""
    paths = []
    for name, frame in tables.files(plan).items():
        write_atomic(out / name, frame.to_csv(index=False))
        paths.append(out / name)
    return paths


def _records(plan: Plan, runs: Path) -> Iterator[Run]:
    """Yields the readable records; damaged ones are reported when runs are resumed."""
    for planned in plan.all():
        folder = runs / planned.name
        if (folder / RUN_FILE).is_file():
            try:
                yield load_run(folder)
            except RunError:
                continue
