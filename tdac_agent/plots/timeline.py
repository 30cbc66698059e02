"""The timeline of one run: what was found, and what it learnt from that."""

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
from tdac_agent.runs.history import Told, Tried, gather_run, learner_named
from tdac_agent.runs.records import Run
from tdac_agent.storage.journal import JournalRecord

COLUMNS, MOST_LINES, MOST_CAUSES = 106, 3, 4
LINE, GAP = 0.165, 0.6
"""Height of a line, inches; space between entries, lines."""
NAMED = 3
RULE, TROUBLE = COLOURS[0], COLOURS[4]


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that happened.

    Attributes:
        k: In which iteration; None where that has no meaning.
        head: What it was, in some words.
        lines: More of it.
        colour: Of its mark.
        mark: As matplotlib names it.
    """

    k: int | None
    head: str
    lines: tuple[str, ...]
    colour: str
    mark: str = "o"

    @property
    def rows(self) -> float:
        """Lines that it takes."""
        return max(1, len(self.lines)) + GAP


def plot_timeline(run: Run) -> Figure:
    """The run from above to below: what failed and why, and the rules that came of it.

    Raises:
        RunError: It has no journal.
    """
    told = gather_run(run)
    entries = list(_entries(told, journal_of(run)))
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
    about = f"{run.task}; {learner_named(run.learner)}"
    if run.optimizer != run.learner:
        about += f"; repairs by {learner_named(run.optimizer)}"
    title(axes, f"Timeline of {run.folder.name}", about)
    return figure


def _draw(axes: Axes, entry: Entry, row: float, *, begins: bool) -> None:
    style: dict[str, Any] = {"va": "center", "fontsize": 8.5, "color": TEXT}
    style["parse_math"] = False  # what a model wrote is no formula
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


def _entries(told: Told, records: list[JournalRecord]) -> Iterator[Entry]:
    """What a reader wants to know, in the order in which it happened."""
    tried = {(one.k, one.j): one for one in told.tried}
    for record in records:
        event, k = record["event"], record.get("k")
        if event == "verify.end":
            yield _verdict(record, tried.get((record["k"], record["j"])))
        elif event == "rules" and record["notes"]:
            lines = _wrapped(record["notes"], 2 * MOST_LINES)
            yield Entry(k, "rules", lines, RULE, "s")
        elif event == "call.fault":
            yield Entry(k, "fault", _wrapped([record["reason"]]), TROUBLE, "X")
        elif event == "run.end" and record["status"] != "verified":
            reason = [record["reason"]] if record.get("reason") else []
            yield Entry(None, record["status"], _wrapped(reason), FAILED, "X")


def _verdict(record: JournalRecord, tried: Tried | None) -> Entry:
    k, at, notes = record["k"], f"j = {record['j']}", record["notes"][:3]
    if record["passed"]:
        lines = _wrapped(["all tests passed", *notes])
        return Entry(k, f"{at}  verified", lines, PASSED)
    if not record["valid"]:
        return Entry(k, f"{at}  no code", _wrapped(notes), TROUBLE)
    head = f"{at}  {len(record['failed_tests'])} failed"
    if record.get("unchanged"):
        return Entry(k, head, _wrapped(["the same code again", *notes]), FAILED)
    return Entry(k, head, (*_causes(record, tried), *_wrapped(notes)), FAILED)


def _causes(record: JournalRecord, tried: Tried | None) -> tuple[str, ...]:
    """What failed by root cause, or by name where no report tells more."""
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
    """A root cause: which tests, and the first sentence of what happened."""
    names = [short_name(failure.test) for failure in group.members]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    first = group.members[0]
    what = first.message if first.diagnosis is None else first.diagnosis.text
    # A sentence ends before a space, a figure does not.
    sentence = what.partition(". ")[0].partition("\n")[0].rstrip(".")
    return f"{', '.join(names[:NAMED])}{more}: {sentence}"


def _wrapped(texts: Sequence[str], most: int = MOST_LINES) -> tuple[str, ...]:
    """Texts in lines, as many for each."""
    lines: list[str] = []
    for text in texts:
        rows = textwrap.wrap(text, COLUMNS, max_lines=most, placeholder=" …")
        lines += [rows[0], *(f"   {row}" for row in rows[1:])] if rows else []
    return tuple(lines)
