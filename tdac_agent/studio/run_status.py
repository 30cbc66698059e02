"""The state of a run, in words."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from tdac_agent.html_report.names import candidate_name
from tdac_agent.library.listing import variations_text
from tdac_agent.runs.ownership import is_own_folder, remark_on, suite_in, wishes_of
from tdac_agent.runs.run_record import DELIVERED, JOURNAL, Run, at_work, load_run
from tdac_agent.storage.journal import read_records
from tdac_agent.studio.folder import lines_in
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE
from tdac_agent.verification.store import ROWS_FILE, UNFINISHED
from tdac_envs.core.errors import TdacError

COUNTED = "feedback", "validation", "improve"
"""What the limit of episodes of a run on a task set is for."""
NOTE = "tdac: "
"""Before what a command says about itself."""
SELECTED = (
    "Selected: the best candidate on worlds of the split dev. Only hidden worlds, "
    "which nobody has seen, can verify it."
)


def progress_of(row: dict[str, Any], running: bool) -> str:
    """The state of a run on one line.

    Args:
        row: Its row of the list of runs; empty if it has not begun.
        running: Whether its command runs.
    """
    if not row or "k" not in row:
        return "preparing the task …" if running else ""
    text, varied = f"iteration {row['k']}", variations_text(row)
    if row["status"] in DELIVERED:
        text = f"in {text}{varied}, {row['seconds']:.0f} s"
    else:
        text += f" of at most {row['iterations']}{varied}"
    tokens = row["tokens_in"] + row["tokens_out"]
    if tokens:
        cost = row["cost"]
        text += f"; {tokens:,} tokens"
        text += "" if cost is None else f", {cost:.4f} USD"
    if row.get("reason"):
        text += f"; {row['reason']}"
    return text


def last_step(output: str) -> str:
    """The last step of a candidate that a command printed; empty if there is none.

    It has `iteration 2, repair 1` for the `k=2 j=1` of the command. While code is
    compiled, that is the step.
    """
    last = output.strip().splitlines()[-1:]
    if last and last[0].startswith(NOTE):
        return last[0].removeprefix(NOTE)
    steps = re.findall(r"^ *([^\w\s])? *k=(\d+) j=(\d+) +(\S.*)$", output, re.MULTILINE)
    if not steps:
        return ""
    mark, k, j, text = steps[-1]
    text = re.sub(r"\S+\.py::", "", text.strip())
    return f"{mark} {candidate_name(int(k), int(j))}: {text}".strip()


def readable_run(folder: Path) -> Run | None:
    """A run; None if it cannot be read."""
    try:
        return load_run(folder)
    except (TdacError, OSError):
        return None


def episodes_driven(run: Run) -> str:
    """How far a run on a task set is; empty for a run on one task."""
    if run.episodes is None:
        return ""
    try:
        records = read_records(run.folder / JOURNAL)
    except (TdacError, OSError):
        return ""
    ended = [each for each in records if each.get("event") == "drive.end"]
    driven = sum(
        each["driven"]
        for each in ended
        if each.get("what") in COUNTED and type(each.get("driven")) is int
    )
    for rows in run.folder.glob(f"iterations/*/*/*/{UNFINISHED}/{ROWS_FILE}"):
        if rows.parent.parent.name.startswith(COUNTED):
            driven += lines_in(rows)
    return f"{driven} of at most {run.episodes + run.improve} episodes driven"


def from_elsewhere(run: Run) -> str:
    """Why a run is not believed to be from here; empty for an own one.

    While a run's own files are being written, its mark does not hold yet.
    """
    names = (TASK_FILE, SET_FILE)
    at_first = not any((run.folder / name).is_file() for name in names)
    return "" if at_first and at_work(run.folder) else remark_on(run)


def asked_by(run: Run) -> list[str] | None:
    """What a run from elsewhere asks for to be continued; None for one of our own."""
    if is_own_folder(run):
        return None
    asked = [wish.what for wish in wishes_of(run, suite_in(run.folder), ())]
    if run.enough is not None:
        unit = "USD" if run.enough.max_tokens is None else "tokens"
        asked.append(f"use up to {run.enough.words[1]} {unit} in all")
    return asked


def initial_controller_text(run: Run) -> str:
    """What came of the controller that the run began with, if it failed."""
    first = next((each for each in run.attempts if (each.k, each.j) == (1, 0)), None)
    if run.given_sha256 is None or first is None or first.passed:
        return ""
    failed = len(first.failed_tests)
    text = f"Your controller failed {failed} test{'' if failed == 1 else 's'}"
    text += ": see iteration 1 below"
    if not run.passed:
        return f"{text}."
    author = "the built-in template" if run.optimizer == "builtin" else run.optimizer
    return f"{text}. The controller that passed is another one, by {author}."
