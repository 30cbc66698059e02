"""Timeline of one run: verdicts, root causes and changes of the rules."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tdac_agent.plots.runs import journal_of, short_name
from tdac_agent.plots.style import COLOURS, FAILED, PASSED, TEXT, new_figure, title
from tdac_agent.prompting.feedback import Group, group_failures
from tdac_agent.runs.history import (
    CandidateHistory,
    RunHistory,
    gather_run,
    learner_named,
)
from tdac_agent.runs.run_record import Run
from tdac_agent.storage.journal import JournalRecord
from tdac_agent.verification.diagnosis.listed import first_of

COLUMNS, MOST_LINES, MOST_CAUSES = 106, 3, 4
LINE, GAP = 0.165, 0.6
"""Height of a line, in inches; space between entries, in lines."""
NAMED = 3
RULE, TROUBLE = COLOURS[0], COLOURS[4]


@dataclass(frozen=True, slots=True)
class Entry:
    """One entry of the timeline.

    Attributes:
        k: Iteration; None for an entry of the whole run.
        head: Short title.
        lines: Text beside the title.
        colour: Colour of marker and title.
        mark: Marker, as named by matplotlib.
    """

    k: int | None
    head: str
    lines: tuple[str, ...]
    colour: str
    mark: str = "o"

    @property
    def rows(self) -> float:
        """Height with the gap below, in lines."""
        return max(1, len(self.lines)) + GAP


def plot_timeline(run: Run) -> Figure:
    """Plots a run from top to bottom: failures with their causes, and new rules.

    Raises:
        RunError: The run has no journal.
    """
    entries = list(_entries(gather_run(run), journal_of(run)))
    rows = sum(entry.rows for entry in entries)
    figure, axes = new_figure(8.6, 0.75 + LINE * rows)
    axes.set_axis_off()
    axes.set_xlim(0, 86)
    axes.set_ylim(rows, -0.7)
    row, last = 0.0, None
    for entry in entries:
        _draw(axes, entry, row, begins=entry.k != last)
        row, last = row + entry.rows, entry.k
    if entries:
        end = row - entries[-1].rows
        axes.plot([7, 7], [0, end], color="#CCCCCC", linewidth=1.5, zorder=0)
    subtitle = f"{run.task}; {learner_named(run.learner)}"
    if run.optimizer != run.learner:
        subtitle += f"; repairs by {learner_named(run.optimizer)}"
    title(axes, f"Timeline of {run.folder.name}", subtitle)
    return figure


def _draw(axes: Axes, entry: Entry, row: float, *, begins: bool) -> None:
    style: dict[str, Any] = {"va": "center", "fontsize": 8.5, "color": TEXT}
    style["parse_math"] = False  # text of a model may contain $
    if begins and entry.k is not None:
        axes.text(5.4, row, f"k = {entry.k}", ha="right", **style)
        if row:
            between = row - (1 + GAP) / 2
            axes.plot([0, 86], [between, between], color="#EEEEEE", linewidth=0.8)
    axes.plot([7], [row], entry.mark, color=entry.colour, markersize=6.5)
    head = {"color": entry.colour, "fontweight": "bold"}
    axes.text(8.6, row, entry.head, **style | head)
    for number, line in enumerate(entry.lines):
        axes.text(22.5, row + number, line, **style | {"fontsize": 8})


def _entries(history: RunHistory, records: list[JournalRecord]) -> Iterator[Entry]:
    tried = {(one.k, one.j): one for one in history.tried}
    for record in records:
        event, k = record["event"], record.get("k")
        if event == "verify.end":
            yield _verdict(record, tried.get((record["k"], record["j"])))
        elif event == "rules" and record["notes"]:
            lines = _wrapped(record["notes"], 2 * MOST_LINES)
            yield Entry(k, "rules", lines, RULE, "s")
        elif event == "call.fault":
            yield Entry(k, "fault", _wrapped([record["reason"]]), TROUBLE, "X")
        elif event == "run.end" and record["status"] not in ("verified", "passed"):
            reason = [record["reason"]] if record.get("reason") else []
            yield Entry(None, record["status"], _wrapped(reason), FAILED, "X")


def _verdict(record: JournalRecord, tried: CandidateHistory | None) -> Entry:
    k, at, notes = record["k"], f"j = {record['j']}", record["notes"][:3]
    if record["passed"]:
        lines = _wrapped(["all tests passed", *notes])
        return Entry(k, f"{at}  passed", lines, PASSED)
    if not record["valid"]:
        return Entry(k, f"{at}  no code", _wrapped(notes), TROUBLE)
    head = f"{at}  {len(record['failed_tests'])} failed"
    if record.get("unchanged"):
        return Entry(k, head, _wrapped(["code unchanged", *notes]), FAILED)
    return Entry(k, head, (*_causes(record, tried), *_wrapped(notes)), FAILED)


def _causes(record: JournalRecord, tried: CandidateHistory | None) -> tuple[str, ...]:
    """Root causes of the failures, or test names if there is no report."""
    if tried is None or tried.report is None:
        names = map(short_name, record["failed_tests"])
        return _wrapped([", ".join(names)])
    groups, not_run = group_failures(tried.report)
    lines = [_cause(group) for group in islice(groups, MOST_CAUSES)]
    if len(groups) > MOST_CAUSES:
        lines.append(f"and {len(groups) - MOST_CAUSES} more causes")
    if not_run:
        lines.append(f"{len(not_run)} tests {not_run[0].message}")
    return tuple(row for line in lines for row in _wrapped([line], 2))


def _cause(group: Group) -> str:
    """Text of a root cause: its tests, and the first sentence of what happened."""
    names = [short_name(failure.test) for failure in group.members]
    first = group.members[0]
    text = first.message if first.diagnosis is None else first.diagnosis.text
    # Unlike a decimal point, the end of a sentence is followed by a space.
    sentence = text.partition(". ")[0].partition("\n")[0].rstrip(".")
    return f"{first_of(names, NAMED)}: {sentence}"


def _wrapped(texts: Sequence[str], most: int = MOST_LINES) -> tuple[str, ...]:
    lines: list[str] = []
    for text in texts:
        rows = textwrap.wrap(text, COLUMNS, max_lines=most, placeholder=" …")
        lines += [rows[0], *(f"   {row}" for row in rows[1:])] if rows else []
    return tuple(lines)
