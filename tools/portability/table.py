"""What can come of a row of the table."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

PASSED, FAILED, NOT_RUN = "passed", "failed", "not run"


class RowFailed(Exception):
    """Something was run and did not do what it must."""


class CannotRun(Exception):
    """This machine lacks something; the text says what."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One line of the table.

    Attributes:
        row: Its name.
        what: What was run.
        result: `PASSED`, `FAILED` or `NOT_RUN`.
        seconds: How long it took.
        detail: What came of it, or the reason.
    """

    row: str
    what: str
    result: str
    seconds: float
    detail: str


def told(outcomes: list[Outcome]) -> str:
    """The table as text, one line a row."""
    head = ("row", "result", "seconds", "what was run", "what came of it")
    lines = [head]
    lines += [(o.row, o.result, f"{o.seconds:.0f}", o.what, o.detail) for o in outcomes]
    columns = range(len(head) - 1)
    widths = [max(len(line[column]) for line in lines) for column in columns]
    return "\n".join(
        "  ".join(line[c].ljust(widths[c]) for c in columns) + "  " + line[-1]
        for line in lines
    )


def attempt(name: str, what: str, run: Callable[[], str]) -> Outcome:
    """The outcome of a row, which this runs.

    Args:
        name: Of the row.
        what: It runs.
        run: Does it and returns what came of it.
    """
    began = time.monotonic()
    try:
        result, detail = PASSED, run()
    except RowFailed as error:
        result, detail = FAILED, str(error)
    except CannotRun as error:
        result, detail = NOT_RUN, str(error)
    return Outcome(name, what, result, time.monotonic() - began, detail)
