"""The rows of the table and their outcomes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

PASSED, FAILED, NOT_RUN = "passed", "failed", "not run"


class RowFailed(Exception):
    """A check ran and failed."""


class CannotRun(Exception):
    """The check needs something that this machine lacks; the text names it."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One line of the table.

    Attributes:
        row: Name of the row.
        what: What was run.
        result: `PASSED`, `FAILED` or `NOT_RUN`.
        seconds: Duration, s.
        detail: Summary or reason.
    """

    row: str
    what: str
    result: str
    seconds: float
    detail: str


def told(outcomes: list[Outcome]) -> str:
    """The table as text, one line per row."""
    head = ("row", "result", "seconds", "what was run", "details")
    lines = [head]
    lines += [(o.row, o.result, f"{o.seconds:.0f}", o.what, o.detail) for o in outcomes]
    columns = range(len(head) - 1)
    widths = [max(len(line[column]) for line in lines) for column in columns]
    return "\n".join(
        "  ".join(line[c].ljust(widths[c]) for c in columns) + "  " + line[-1]
        for line in lines
    )


def attempt(name: str, what: str, run: Callable[[], str]) -> Outcome:
    """Runs a row and returns its outcome.

    Args:
        name: Name of the row.
        what: What it runs, in words.
        run: Runs it and returns a summary.
    """
    began = time.monotonic()
    try:
        result, detail = PASSED, run()
    except RowFailed as error:
        result, detail = FAILED, str(error)
    except CannotRun as error:
        result, detail = NOT_RUN, str(error)
    return Outcome(name, what, result, time.monotonic() - began, detail)
