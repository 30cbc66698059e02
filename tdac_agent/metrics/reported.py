"""Loads results known only by their first successes, as a paper prints them."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd

from tdac_agent.errors import RunError
from tdac_agent.metrics.frames import (
    RUN_COLUMNS,
    RunFrames,
    frames_from_tau,
    join_frames,
)
from tdac_agent.storage.csv_file import read_rows
from tdac_envs.core.errors import one_line_reason

PAPER_K = 20
LABELS = {*RUN_COLUMNS, "environment"} - {"tau"}
_WORD = re.compile(r"(\d+)(\+?)")


def load_reported(path: Path, *, most: int = PAPER_K, **only: str) -> RunFrames:
    """Loads a table with one row per kind of run, such as `results/paper/results.csv`.

    The column `tau` lists the iterations of the first successes, such as `1 2 5`; `2+`
    is a run that budget, time or a fault ended after two iterations without success.
    `invalid` is the number of iterations without a controller. Columns named in
    `RUN_COLUMNS` are copied; `environment` (`2d` or `3d`) becomes part of the run
    names, so that runs of both can be joined. Other columns only serve to select rows.

    Args:
        path: A CSV file.
        most: K, the maximum number of iterations.
        only: Column values of the rows to load, such as `environment="2d"`.

    Raises:
        RunError: The file cannot be read, or a column or row is missing.
    """
    try:
        table = pd.DataFrame(read_rows(path))
    except (OSError, ValueError) as error:
        raise RunError(f"cannot read {path}: {one_line_reason(error)}") from error
    for name in ("tau", *only):
        if name not in table:
            known = ", ".join(table.columns)
            raise RunError(f"{path} has no column {name!r}; expected one of {known}")
    for name, value in only.items():
        table = table[table[name] == value]
    if table.empty:
        raise RunError(f"{path} has no row with {only}")
    labels = [name for name in table if name in LABELS]
    return join_frames(
        *(_kind(row, labels, path, most) for row in table.to_dict("records"))
    )


def _kind(row: dict[str, str], labels: list[str], path: Path, most: int) -> RunFrames:
    tau: list[int] = []
    ended: list[int] = []
    for word in row["tau"].split():
        match = _WORD.fullmatch(word)
        if match is None:
            wanted = "expected iterations such as 1 2 5+"
            raise RunError(f"{path}: {wanted}, got {row['tau']!r}")
        (ended if match[2] else tau).append(int(match[1]))
    return frames_from_tau(
        tau,
        most,
        ended=ended,
        invalid=int(row.get("invalid") or 0),
        **{name: row[name] for name in labels},
    )
