"""The tables of a campaign, from the folders of its runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from tdac_agent.campaign.plan import Plan
from tdac_agent.errors import RunError
from tdac_agent.metrics import Frames, frames_of, summarise
from tdac_agent.runs.run_record import RUN_FILE, Run, load_run
from tdac_agent.storage.files import write_atomic

TABLES = ("runs.csv", "candidates.csv", "summary.csv")


def collect(plan: Plan, runs: Path) -> Frames:
    """The records of all runs of a plan, finished or not.

    The column `run` has their names, `KIND/rNNNN`, wherever the folder is.
    """
    frames = frames_of(_records(plan, runs))
    for frame in (frames.runs, frames.candidates):
        frame["run"] = frame["run"].str.removeprefix(f"{runs}/")
    return frames


def write_tables(frames: Frames, out: Path) -> pd.DataFrame:
    """Writes `runs.csv`, `candidates.csv` and `summary.csv`; returns the last one."""
    summary = summarise(frames) if len(frames.runs) else pd.DataFrame()
    for name, frame in zip(
        TABLES, (frames.runs, frames.candidates, summary), strict=True
    ):
        write_atomic(out / name, frame.to_csv(index=False))
    return summary


def _records(plan: Plan, runs: Path) -> Iterator[Run]:
    """Yields the readable records; damaged ones are reported when runs are resumed."""
    for planned in plan.all():
        folder = runs / planned.name
        if (folder / RUN_FILE).is_file():
            try:
                yield load_run(folder)
            except RunError:
                continue
