"""Prints a verification report on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.episodes.trajectory import nominal_first
from tdac_agent.prompting.feedback import Group, cut, group_failures
from tdac_agent.tasks.units import UNITS, Units
from tdac_agent.verification.diagnosis.gap import gap_figure, too_close_text
from tdac_agent.verification.diagnosis.listed import list_tests
from tdac_agent.verification.diagnosis.report import (
    Episode,
    Failure,
    Report,
    in_units,
)
from tdac_agent.verification.diagnosis.second_opinion import opinion_text
from tdac_agent.verification.verdict import COLOURS

MOST_NAMES, SOME_NAMES = 6, 3
"""Of tests that fail for one reason, all are named up to `MOST_NAMES`, else some."""
LEGEND = (
    "grid path left, straight left: the smallest distance to the goal in the episode / "
    "at its start, along the grid path and in a straight line; ms per call: mean time "
    "of policy(obs); smallest gap: between body and obstacles"
)


def show_report(
    report: Report,
    console: Console,
    out: Path | None = None,
    folder: Path | None = None,
    units: Units | None = None,
) -> None:
    """Prints the verdict, the failures with their diagnosis, and the episodes.

    Args:
        report: The report.
        console: Console to print to.
        out: Folder to which the report and its pictures were written.
        folder: Folder of the task file; None for a bundled task.
        units: Units of the task, as from `Setting.shown`; None for the report's.
    """
    units = UNITS[report.provenance.unit] if units is None else units
    report = in_units(report, units)
    verdict, provenance = report.verdict, report.provenance
    for warning in provenance.warnings:
        console.print(f"[yellow]warning: {escape(warning)}[/]")
    for node in provenance.left_out:
        console.print(f"[yellow]left out of the world: {escape(node)}[/]")
    groups, not_run = group_failures(report)
    for group in groups:
        _show_failed(console, group.members)
        for message in _messages(group):
            print_sentences(console, message, indent=2)
        for text in _held_out(report) if group.held_out else group.happened:
            print_sentences(console, f"what happened: {text}", indent=2)
    if not_run:
        _show_failed(console, not_run)
        print_sentences(console, not_run[0].message, indent=2)
    console.print(episode_table(report, units))
    if report.episodes:
        print_sentences(console, LEGEND, "dim")
    for episode in report.too_close:
        assert episode.smallest_gap is not None
        text = too_close_text(episode.smallest_gap, units)
        print_sentences(console, f"{episode.name}: reached, {text}", "yellow")
    if out is not None:
        _show_files(out, console)
    word = "passed" if verdict.passed else "failed"
    colour = COLOURS["passed" if verdict.passed else "not verified"]
    task = provenance.called or provenance.task
    # Task names are not unique, so the folder is shown, too.
    task += f" of {folder}" if folder is not None and task != provenance.task else ""
    _, _, name = provenance.suite.partition(" + ")
    own = (
        f" with the tests {name} ({provenance.own_suite})"
        if provenance.own_suite
        else ""
    )
    console.print(
        f"[bold {colour}]{word}[/]: {verdict.passed_tests} of {verdict.expected} tests "
        f"passed in {report.seconds:.1f} s  (task {escape(task)}, profile "
        f"{provenance.profile}{escape(own)}, sandbox {escape(provenance.sandbox)}, "
        f"seed {provenance.seed})"
    )
    if report.second_opinion is not None:
        print_sentences(console, opinion_text(report.second_opinion, units))
    if _lacks_names(report):
        console.print(
            "the profile paper needs all these functions and constants; "
            "--profile policy needs only policy(obs)"
        )


def _messages(group: Group) -> list[str]:
    """Messages of a group, each after the names of its tests if there are several."""
    names: dict[str, list[str]] = {}
    for failure in group.members:
        names.setdefault(cut(failure.message), []).append(failure.test)
    if len(group.members) == 1:
        return group.messages
    return [
        f"{list_tests(names[text], SOME_NAMES)}: {text}" if text in names else text
        for text in group.messages
    ]


def _held_out(report: Report) -> list[str]:
    """How each failed held-out episode ended; its diagnosis is kept from models."""
    ended = [
        f"{episode.name}: {episode.outcome} in step {episode.steps}"
        + (f": {episode.error}" if episode.error else "")
        for episode in report.episodes
        if episode.held_out and (episode.outcome != "reached" or episode.collisions)
    ]
    reason = "held out: a model is told only that such a start failed, so there is no"
    return [*ended, f"({reason} diagnosis; `tdac play --episode` shows it)"]


def _show_failed(console: Console, failures: Sequence[Failure]) -> None:
    """Prints the names of tests that fail for one reason, grouped by file."""
    names = [failure.test for failure in failures]
    if len(names) > MOST_NAMES:
        names = names[:SOME_NAMES]
    more = len(failures) - len(names)
    files: dict[str, list[str]] = {}
    for name in names:
        file, _, test = name.partition("::")
        files.setdefault(file, []).append(test)
    shown = "; ".join(f"{file}::{', '.join(tests)}" for file, tests in files.items())
    shown += f" and {more} more tests" if more else ""
    console.print(f"[red]failed[/] [bold]{escape(shown)}[/]")


def _lacks_names(report: Report) -> bool:
    """Whether functions or constants of the profile `paper` are missing."""
    failed = {failure.test.rpartition("::")[2] for failure in report.failures}
    parses = "test_source_parses" not in failed
    return parses and bool(failed & {"test_constants", "test_entry_points"})


def _show_files(out: Path, console: Console) -> None:
    for path in sorted((out / "trajectories").glob("*.png"), key=nominal_first):
        console.print(Text(f"picture: {path}"), soft_wrap=True)
    console.print(Text(f"report: {out / 'report.json'}"), soft_wrap=True)


def episode_table(report: Report, units: Units) -> Table:
    """One row per judged episode; `units` are those of lengths."""
    table = Table(
        title=f"Episodes as the environment recorded them ({units.length})",
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=0,
    )
    table.add_column("start", no_wrap=True)
    table.add_column("outcome", no_wrap=True)
    figures = (
        "steps",
        "contacts",
        "grid path\nleft",
        "straight\nleft",
        "smallest\ngap",
    )
    for name in (*figures, "ms per\ncall"):
        table.add_column(name, justify="right", no_wrap=True)
    for episode in (e for e in report.episodes if e.outcome != "not run"):
        colour = "green" if episode.outcome == "reached" else "red"
        table.add_row(
            escape(episode.name),
            f"[{colour}]{escape(episode.outcome)}[/]",
            str(episode.steps),
            str(episode.collisions),
            _fraction(units, episode.d_min, episode.d0),
            _fraction(units, episode.d_min_euclidean, episode.d0_euclidean),
            _gap(episode, units),
            f"{episode.call_ms_mean:.2f}" if episode.call_ms_p99 else "–",
        )
    return table


def _gap(episode: Episode, units: Units) -> str:
    """The smallest gap of an episode, yellow if it reached the goal too close."""
    if episode.smallest_gap is None:
        return "–"
    shown = gap_figure(episode.smallest_gap.gap, units)
    return f"[yellow]{shown}[/]" if episode.too_close else shown


def _fraction(units: Units, left: float, whole: float) -> str:
    shown = (units.amount(units.scale * length, 0) for length in (left, whole))
    return "/".join(shown)
