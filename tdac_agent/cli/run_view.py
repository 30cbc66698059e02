"""A run for people: its attempts, how it ended, what it took."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from rich.markup import escape
from rich.padding import Padding
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.models.budget import told_usd
from tdac_agent.runs.records import Attempt, Run


def show_run(run: Run, console: Console) -> None:
    """Prints the attempts in a table, and what came of the run."""
    if run.attempts:
        console.print(_attempts(run))
    usage, folder = _usage(run), run.folder
    if run.verified:
        ending = (
            f"[bold green]verified[/] in iteration {run.tau}, {run.seconds:.1f} s: "
        )
        console.print(f"{ending}{escape(str(run.controller))}", soft_wrap=True)
        _tell_more(console, usage)
        evidence = f"{folder / 'report.json'}, {folder / 'trajectory.png'}"
        _tell_way(console, f"evidence: {evidence}")
        drive = shlex.join(["tdac", "play", str(folder), "--video", "drive.mp4"])
        _tell_way(console, f"see it drive: {drive}")
    elif run.status == "budget":
        console.print(f"[bold yellow]stopped by the budget[/]: {escape(run.reason)}")
        _tell_more(console, usage)
        _tell_more(console, run.outlook)
        _tell_way(console, f"go on: {way_on(run)}")
    else:
        times = f"{run.iterations} iteration{'' if run.iterations == 1 else 's'}"
        ending = f"[bold red]not verified[/] after {times}; "
        told = f"{ending}the attempts are in {escape(str(folder / 'iterations'))}"
        console.print(told, soft_wrap=True)
        _tell_more(console, usage)


def _tell_more(console: Console, told: str) -> None:
    """A sentence that belongs to the line before, if there is something to say."""
    if told:
        console.print(Padding(escape(told), (0, 0, 0, 2)))


def _tell_way(console: Console, told: str) -> None:
    """A path or command, which stays in one piece to be copied."""
    console.print(f"  {escape(told)}", soft_wrap=True)


def _usage(run: Run) -> str:
    """Tokens and money in a line; none where no model was asked."""
    if run.tokens == 0 and run.cost == 0.0 and not run.cost_lost:
        return ""
    cached = f" ({run.tokens_cached} from a cache)" if run.tokens_cached else ""
    tokens = f"{run.tokens_in} tokens in{cached}, {run.tokens_out} out"
    cost = "cost unknown" if run.cost is None else told_usd(run.cost)
    if run.cost_lost:
        cost += f", and at most {told_usd(run.cost_lost)} for lost answers"
    if not run.tokens:
        tokens = "no tokens reported"
        if run.max_tokens is not None:
            tokens += ": each answer counts with all that was reserved for it"
    return f"{tokens}; {cost}"


def way_on(run: Run) -> str:
    """The command that goes on with a run; empty where it has come to its end."""
    if run.finished:
        return ""
    more = f" {run.enough}" if run.enough else ""
    return f"tdac synth --resume {shlex.quote(str(run.folder))}{more}"


def _attempts(run: Run) -> Table:
    table = Table(title=escape(f"{run.task}: {run.learner}"), title_justify="left")
    table.add_column("k", justify="right")
    table.add_column("j", justify="right")
    table.add_column("result")
    table.add_column("failed tests")
    for attempt in run.attempts:
        told = told_tests(attempt.failed_tests, 4) or _why_invalid(attempt)
        table.add_row(str(attempt.k), str(attempt.j), _result(attempt), escape(told))
    return table


def told_tests(tests: Sequence[str], most: int) -> str:
    """The names of some tests, and how many more there are."""
    names = [name.rpartition("::")[2] for name in tests]
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _why_invalid(attempt: Attempt) -> str:
    """Of an answer without code, the last reason; its notes end with it."""
    return "" if attempt.valid else "; ".join(attempt.notes[-1:])


def _result(attempt: Attempt) -> str:
    if not attempt.valid:
        return "[yellow]invalid[/]"
    if attempt.unchanged:
        return "[yellow]no change[/]"
    return "[green]verified[/]" if attempt.passed else "[red]failed[/]"
