"""Prints how a controller does on worlds of a task set."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.robust_view import error_rates, rate_text
from tdac_agent.cli.sentences import print_command, print_plain, print_sentences
from tdac_agent.verification.decision import decision_text
from tdac_agent.verification.diagnosis.report import OWN
from tdac_agent.verification.episode_report import EpisodeReport, HiddenCount
from tdac_agent.verification.judge.episode_row import Scores
from tdac_agent.verification.store import REPORT_FILE, TRAJECTORIES
from tdac_agent.verification.verdict import COLOURS

MOST_CAUSES = 6


def show_set_report(report: EpisodeReport, console: Console) -> None:
    """Prints the scores or the decision, the failures by cause, and diagnoses."""
    say = partial(console.print, highlight=False)
    provenance = report.provenance
    if report.refused:
        _print_refused(report, console)
        return
    first, last = provenance.first, provenance.first + report.count - 1
    say(
        f"[bold]{escape(provenance.name)}[/] {provenance.sha256[:8]}, worlds {first} "
        f"to {last} of {provenance.split}: {report.successes} reached, "
        f"{report.count - report.successes} failed; {report.seconds:.0f} s"
    )
    if own := [name for name in report.tests if name.startswith(f"{OWN}/")]:
        say(f"tests of your own: all {len(own)} passed")
    if report.scores is not None and report.interval is not None:
        say(_scores(report, report.scores))
        say(rate_text(report.scores.success, report.interval))
    if report.causes:
        causes = list(report.causes.items())[:MOST_CAUSES]
        say("failures: " + ", ".join(f"{count} {name}" for name, count in causes))
    for line in report.gap_lines(provenance.units):
        say(line)
    for text in report.told:
        print_sentences(console, text, indent=2)
    if report.clock_dependent is not None:
        say(
            f"[yellow]clock-dependent[/]: {report.clock_dependent}, so a slower or "
            "busier machine may give other results"
        )
    result = report.sequential
    if result is not None:
        verdict = "verified" if report.passed else "not verified"
        colour = COLOURS[verdict]
        say(
            f"[bold {colour}]{verdict}[/]: {decision_text(result)} after "
            f"{report.count} of at most {result.test.limit} worlds"
        )
        say(error_rates(result))
    else:
        say("no verdict: -n asks for scores; leave it out for a verdict")
    if report.hidden is not None:
        say(_counted(report.hidden, provenance.name))


def show_next_steps(
    report: EpisodeReport, how: list[str], out: Path | None, console: Console
) -> None:
    """Prints how to see the first failure, and where the files are.

    Args:
        report: The report.
        how: Words of the command line that name controller and set.
        out: Folder of the files.
        console: Where it is printed.
    """
    failed = [episode.index for episode in report.episodes if not episode.success]
    if failed:
        play = ["play", *how]
        play += ["--split", str(report.provenance.split), "--index", str(failed[0])]
        print_command(console, "watch the first failure:", play)
    if out is not None and not report.refused:
        kept = f", {TRAJECTORIES}/" if report.episodes else ""
        print_plain(console, f"wrote {REPORT_FILE}{kept} to {out}")


def _print_refused(report: EpisodeReport, console: Console) -> None:
    """Prints the tests that failed; no world was driven."""
    provenance, tests = report.provenance, list(report.tests.values())
    console.print(
        f"[bold]{escape(provenance.name)}[/] {provenance.sha256[:8]}: "
        f"{tests.count('failed')} of {len(tests)} tests failed, so no world was driven",
        highlight=False,
    )
    for text in report.told:
        print_sentences(console, text, indent=2)
    console.print("[bold red]not verified[/]", highlight=False)


def _counted(hidden: HiddenCount, name: str) -> str:
    """Which of the hidden evaluations in the ledger it is."""
    text = f"hidden evaluation {hidden.number} of this file on {escape(name)}"
    if hidden.count > 1:
        text += f", {hidden.count} in all; the first one counts"
    if hidden.lineage is not None and hidden.lineage > hidden.count:
        text += f"; {hidden.lineage} of all controllers of its run"
    if hidden.recorded is not None:
        text += f"; recorded {hidden.recorded}, nothing was driven anew"
    return text


def _scores(report: EpisodeReport, whole: Scores) -> Table:
    """A row for each generator, and one for all worlds."""
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0))
    table.add_column("worlds")
    for name in ("success", "time score", "path score", "BARN score"):
        table.add_column(name, justify="right")
    rows = {**report.by_generator, "[bold]all[/]": whole}
    for name, scores in rows.items():
        table.add_row(
            name,
            f"{100 * scores.success:.1f} %",
            f"{scores.time:.3f}",
            f"{scores.path:.3f}",
            f"{scores.barn:.3f}",
        )
    table.caption = (
        " time: OT / T (least possible / actual time); path: L / driven (shortest / "
        "actual path); BARN: at most 0.5"
    )
    table.caption_justify = "left"
    return table
