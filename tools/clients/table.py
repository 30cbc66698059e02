"""The table of outcomes."""

from __future__ import annotations

import platform
from collections.abc import Sequence

from attempt import PASSED, Outcome

_LONGEST = 160


def table(outcomes: Sequence[Outcome]) -> str:
    """A Markdown table with a row for each library, and the version of Python."""
    rows = ["| library | versions | trained | result |", "|---|---|---|---|"]
    rows += [_row(outcome) for outcome in outcomes]
    python = f"Python {platform.python_version()}, {platform.machine()}"
    return "\n".join([*rows, "", python])


def _row(outcome: Outcome) -> str:
    said = outcome.said.replace("|", "/")
    said = said if len(said) <= _LONGEST else f"{said[:_LONGEST]}…"
    result = said if outcome.result == PASSED else f"{outcome.result}: {said}"
    return f"| {outcome.name} | {outcome.versions} | {outcome.trained} | {result} |"
