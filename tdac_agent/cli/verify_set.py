"""`tdac verify --set`: drives a controller on worlds that it has never seen."""

from __future__ import annotations

import gc
import shlex
import sys
from functools import partial
from pathlib import Path

from rich.box import SIMPLE
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.progress import TimeRemainingColumn as TimeLeft
from rich.table import Table

from tdac_agent.builtin.level import controller_of
from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import check_tier
from tdac_agent.cli.pulse import Pulse
from tdac_agent.cli.robust_view import error_rates, rate_text
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.set_flags import SetFlags
from tdac_agent.cli.verify import check_folder, controller_file
from tdac_agent.evaluation.policies import BUILTIN
from tdac_agent.runs.ownership import mark_verified
from tdac_agent.verification.episode_report import (
    EpisodeReport,
    HiddenCount,
    decision_text,
)
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.episode_row import Scores
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.store import REPORT_FILE, TRAJECTORIES
from tdac_agent.verification.verify_episodes import most_worlds, verify_episodes
from tdac_envs.ladder.task_sets import load_set

MOST_CAUSES = 6


def run(
    controller: str,
    flags: SetFlags,
    tier: str,
    out: Path | None,
    as_json: bool,
    child_pool: ChildPool,
) -> int:
    """Drives a controller on a set and prints the report; returns the exit code."""
    check_tier(tier)
    if out is not None:
        check_folder(out)
    assert flags.name is not None
    tasks = load_set(flags.name, flags.hidden_folder)
    if controller == BUILTIN:
        file = controller_of(tasks, "give a file")
    else:
        file = controller_file(controller)
    if flags.worlds is not None:
        tasks.check_count(flags.split or "test", flags.worlds, "-n")
    gc.freeze()
    gc.enable()
    columns = (
        TextColumn(f"worlds of {escape(tasks.name)}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[successes]} reached"),
        TimeLeft(),
    )
    console = Console(stderr=as_json)
    bar = Progress(
        *columns,
        console=console,
        transient=True,
        auto_refresh=False,
        disable=not console.is_terminal,
    )
    row = bar.add_task(
        "", total=flags.worlds or most_worlds(tasks, flags.split or "test"), successes=0
    )

    pulse = Pulse(is_terminal=console.is_terminal)

    def watch(episodes: int, successes: int) -> None:
        bar.update(row, completed=episodes, successes=successes, refresh=True)
        pulse(f"{tasks.name}: the goal reached in {successes} of {episodes} worlds …")

    with WarmJudge(child_pool) as judge, bar:
        report = verify_episodes(
            file,
            tasks,
            flags.worlds,
            split=flags.split or "test",
            salt_file=flags.salt_file,
            tier=tier,
            out=out,
            judge=judge,
            watch=watch,
        )
    if report.passed and report.sequential is not None:
        again = mark_verified(file, report.provenance.sha256, "policy")
        print(again, end="\n" * bool(again), file=sys.stderr)
    if as_json:
        sys.stdout.write(report.model_dump_json(indent=2) + "\n")
    else:
        console = Console()
        show(report, console)
        _say_how_to_go_on(report, flags.name, controller, out, console)
    return 0 if report.passed else 1


def show(report: EpisodeReport, console: Console) -> None:
    """Prints the scores or the decision, the failures by cause, and diagnoses."""
    say = partial(console.print, highlight=False)
    about = report.provenance
    if report.refused:
        _say_refused(report, console)
        return
    say(
        f"[bold]{escape(about.name)}[/] {about.sha256[:8]}, worlds 0 to "
        f"{report.count - 1} of {about.split}: {report.successes} reached, "
        f"{report.count - report.successes} failed; {report.seconds:.0f} s"
    )
    if report.scores is not None and report.interval is not None:
        say(_scores(report, report.scores))
        say(rate_text(report.scores.success, report.interval))
    if report.causes:
        causes = list(report.causes.items())[:MOST_CAUSES]
        say("failures: " + ", ".join(f"{count} {name}" for name, count in causes))
    for text in report.told:
        print_sentences(console, text, indent=2)
    if report.clock_dependent is not None:
        say(
            f"[yellow]clock-dependent[/]: {report.clock_dependent}, so a slower or "
            "busier machine may give other results"
        )
    result = report.sequential
    if result is not None:
        colour = "green" if report.passed else "red"
        verdict = "verified" if report.passed else "not verified"
        say(
            f"[bold {colour}]{verdict}[/]: {decision_text(result)} after "
            f"{report.count} of at most {result.test.limit} worlds"
        )
        say(error_rates(result))
    else:
        say("no verdict: -n asks for scores; leave it out for a verdict")
    if report.hidden is not None:
        say(_counted(report.hidden, about.name))


def _say_how_to_go_on(
    report: EpisodeReport,
    name: str,
    controller: str,
    out: Path | None,
    console: Console,
) -> None:
    """Prints how to see the first failure, and where the files are."""
    failed = [episode.index for episode in report.episodes if not episode.success]
    if failed:
        play = ["tdac", "play", controller, "--set", name]
        play += ["--split", str(report.provenance.split), "--index", str(failed[0])]
        # Not wrapped, so that it can be copied.
        line = f"watch the first failure: [bold]{escape(shlex.join(play))}[/]"
        console.print(line, soft_wrap=True, highlight=False)
    if out is not None and not report.refused:
        kept = f", {TRAJECTORIES}/" if report.episodes else ""
        line = escape(f"wrote {REPORT_FILE}{kept} to {out}")
        console.print(line, soft_wrap=True, highlight=False)


def _say_refused(report: EpisodeReport, console: Console) -> None:
    """Prints the tests that failed; no world was driven."""
    about, tests = report.provenance, list(report.tests.values())
    console.print(
        f"[bold]{escape(about.name)}[/] {about.sha256[:8]}: "
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
