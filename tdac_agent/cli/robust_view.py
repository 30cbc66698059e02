"""Prints a robust verification on the terminal."""

from __future__ import annotations

import shlex
from functools import partial

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_command, print_sentences
from tdac_agent.tasks.units import Units
from tdac_agent.verification.decision import (
    SequentialResult,
    decision_text,
    percent,
)
from tdac_agent.verification.episode_report import EpisodeReport, Interval
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.verdict import COLOURS, verified_text, word_of

LEAST, MOST, ERRORS = 5, 10, 3
REACHED = "reached"


def show_robust(
    report: EpisodeReport, console: Console, play: list[str], units: Units
) -> None:
    """Prints the worst episodes, the success rate and the sequential test's decision.

    `play` is the command line that plays an episode, without `--seed`; `units` are
    those of places and lengths, as from `Setting.shown`.
    """
    say = partial(console.print, highlight=False)
    say(worst_table(report, units))
    for error in _errors(report):
        print_sentences(console, error, indent=2)
    replay = shlex.join([*play, "--seed", str(report.worst[0].number)])
    # Not wrapped, so that it can be copied.
    line = f"  replay the first of them: [bold]{escape(replay)}[/]"
    console.print(line, soft_wrap=True, highlight=False)
    say(f"  disturbance: {report.provenance.disturbance}")
    outcomes = report.outcomes.items()
    others = ", ".join(f"{count} {name}" for name, count in outcomes if name != REACHED)
    say(
        f"{report.successes} of {report.count} episodes reached the goal without a "
        f"contact{f' ({others})' if others else ''}; they took {report.seconds:.0f} s"
    )
    for line in report.gap_lines(units):
        say(f"  {line}")
    if report.time_outs:
        say(_warning(report))
    if report.interval is not None and report.rate is not None:
        say(rate_text(report.rate, report.interval))
    if report.sequential is not None:
        result = report.sequential
        colour = "green" if report.passed else "red"
        say(
            f"[bold {colour}]{decision_text(result)}[/] after {report.count} of at "
            f"most {result.test.limit} episodes"
        )
        say(_legend(result))
        say(error_rates(result))


def show_confirmation(
    report: EpisodeReport, console: Console, play: list[str], units: Units
) -> None:
    """Prints the verdict of blind drives, with the failures.

    `play` are the words after `tdac` that play one of them, without `--seed`; `units`
    are those of places and lengths.
    """
    if report.failures:
        console.print(worst_table(report, units), highlight=False)
        for error in _errors(report):
            print_sentences(console, error, indent=2)
        replay = [*play, "--seed", str(report.worst[0].number)]
        print_command(console, "replay the first of them:", replay)
    if report.time_outs:
        console.print(_warning(report), highlight=False)
    word = word_of(report)
    text = f"{escape(verified_text(report))}; {report.seconds:.0f} s"
    console.print(f"[bold {COLOURS[word]}]{word}[/]: {text}", highlight=False)
    console.print(f"  blind drives: {report.provenance.disturbance}", highlight=False)


def worst_table(report: EpisodeReport, units: Units) -> Table:
    """The worst episodes: up to `MOST` failures, then the slowest successes."""
    first, failures = report.provenance.first, len(report.failures)
    seeds = f"the seeds {first} to {first + report.count - 1} ({units.length})"
    title = f"Worst of {seeds}" if failures else f"No failure; the slowest of {seeds}"
    if failures > MOST:
        title += f", {failures - MOST} further failures"
    table = Table(title=title, title_justify="left")
    table.add_column("seed", justify="right")
    table.add_column("outcome")
    for name in ("steps", "grid path left", *(("from step", "at") if failures else ())):
        table.add_column(name, justify="right")
    for episode in report.worst[: max(LEAST, min(failures, MOST))]:
        table.add_row(*_row(episode, units)[: len(table.columns)])
    return table


def _warning(report: EpisodeReport) -> str:
    return (
        f"[yellow]warning: {report.time_outs} of them timed out, also when retried "
        "alone; if this machine was busy, repeat this when it is idle[/]"
    )


def _row(episode: EpisodeRow, units: Units) -> list[str]:
    cause = episode.side if episode.outcome == "collision" else episode.cause
    more = "" if cause in (None, episode.outcome) else f", {cause}"
    return [
        str(episode.number),
        f"[{'green' if episode.success else 'red'}]{episode.outcome}{more}[/]",
        str(episode.steps),
        f"{units.amount(units.scale * (episode.d_min or 0.0), 0)} of "
        f"{units.amount(units.scale * (episode.d0 or 0.0), 0)}",
        "" if episode.step is None else str(episode.step),
        _place(episode, units),
    ]


def _place(episode: EpisodeRow, units: Units) -> str:
    if episode.x is None or episode.y is None:
        return ""
    return units.place_text(episode.x, episode.y)


def _errors(report: EpisodeReport) -> list[str]:
    """The distinct errors of the worst episodes, each with its first seed."""
    first: dict[str, int] = {}
    for episode in report.worst:
        if episode.error is not None:
            first.setdefault(episode.error, episode.number)
    return [f"seed {seed}: {error}" for error, seed in first.items()][:ERRORS]


def rate_text(rate: float, interval: Interval) -> str:
    """A success rate with its interval."""
    return (
        f"[bold]success rate {percent(rate)}[/], "
        f"{100 * interval.confidence:.0f} % interval {percent(interval.low)} to "
        f"{percent(interval.high)} ({interval.method})"
    )


def _legend(result: SequentialResult) -> str:
    return (
        f"  accepted: a success rate of {percent(result.test.accept_at)} explains the "
        f"episodes far better than one of {percent(result.at_refused_rate.rate)}; the "
        "test ends as soon as it can decide (docs/robustness.md), and errs rarely:"
    )


def error_rates(result: SequentialResult) -> str:
    """How often a sequential test errs."""
    low, high = result.at_refused_rate, result.at_accepted_rate
    text = (
        f"  a true rate of {percent(low.rate)} is accepted with probability "
        f"{percent(low.accepted)}\n"
        f"  a true rate of {percent(high.rate)} is rejected with probability "
        f"{percent(high.rejected)}, undecided with {percent(high.undecided)}"
    )
    if result.contact is None:
        return text
    low, high = result.contact.at_refused_rate, result.contact.at_accepted_rate
    return (
        f"{text}\n"
        f"  a true share of contacts of {percent(1.0 - low.rate)} is accepted with "
        f"probability {percent(low.accepted)}, one of {percent(1.0 - high.rate)} with "
        f"{percent(high.accepted)}"
    )
