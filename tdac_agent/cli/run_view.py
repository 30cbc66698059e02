"""Prints a run on the terminal: its attempts, result and cost."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from rich.markup import escape
from rich.padding import Padding
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.library.listing import resume_command
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.improvement_record import TaskImprovement, read_improvement
from tdac_agent.runs.run_record import Attempt, Run


def show_run(run: Run, console: Console) -> None:
    """Prints the attempts in a table, then the result and the next commands."""
    usage, folder = usage_of(run), run.folder
    found = read_improvement(folder) if run.improve else None
    if run.attempts:
        console.print(_attempts(run, found))
    if run.verified:
        ending = f"[bold green]verified[/] in iteration {run.tau}, "
        if found is not None and found.selected != found.first:
            ending += f"improved in iteration {found.k}, "
        ending += f"{run.seconds:.1f} s: {escape(str(run.controller))}"
        console.print(ending, soft_wrap=True)
        if found is not None:
            _print_indented(console, found.told)
        if run.reason:
            _print_indented(console, f"the search ended early: {run.reason}")
        _print_indented(console, usage)
        evidence = f"{folder / 'report.json'}, {folder / 'trajectory.png'}"
        _print_unwrapped(console, f"evidence: {evidence}")
        drive = shlex.join(["tdac", "play", str(folder), "--video", "drive.mp4"])
        _print_unwrapped(console, f"watch it drive: {drive}")
    elif run.status == "budget":
        print_budget_end(run, console)
    else:
        times = f"{run.iterations} iteration{'' if run.iterations == 1 else 's'}"
        ending = f"[bold red]not verified[/] after {times}; "
        attempts = escape(str(folder / "iterations"))
        console.print(f"{ending}the attempts are in {attempts}", soft_wrap=True)
        _print_indented(console, usage)


def print_budget_end(run: Run, console: Console) -> None:
    """Prints that the budget ended a run, and how to continue it."""
    console.print(f"[bold yellow]stopped by the budget[/]: {escape(run.reason)}")
    _print_indented(console, usage_of(run))
    _print_indented(console, run.outlook)
    _print_unwrapped(console, f"to continue: {resume_command(run)}")


def _print_indented(console: Console, text: str) -> None:
    """Prints a wrapped sentence below the line that it belongs to, unless empty."""
    if text:
        console.print(Padding(escape(text), (0, 0, 0, 2)))


def _print_unwrapped(console: Console, text: str) -> None:
    """Prints a path or command in one line, so that it can be copied."""
    console.print(f"  {escape(text)}", soft_wrap=True)


def usage_of(run: Run) -> str:
    """Tokens and cost in one line; empty if no model was asked."""
    if run.tokens == 0 and run.cost == 0.0 and not run.cost_lost:
        return ""
    cached = f" ({run.tokens_cached} from a cache)" if run.tokens_cached else ""
    tokens = f"{run.tokens_in} tokens in{cached}, {run.tokens_out} out"
    cost = "cost unknown" if run.cost is None else format_usd(run.cost)
    if run.cost_lost:
        cost += f", and at most {format_usd(run.cost_lost)} for lost answers"
    if not run.tokens:
        tokens = "no tokens reported"
        if run.max_tokens is not None:
            tokens += ": each answer counts as the full amount reserved for it"
    return f"{tokens}; {cost}"


def _attempts(run: Run, found: TaskImprovement | None) -> Table:
    table = Table(title=escape(f"{run.task}: {run.learner}"), title_justify="left")
    table.add_column("k", justify="right")
    table.add_column("j", justify="right")
    table.add_column("result")
    varied = any(attempt.parent is not None for attempt in run.attempts)
    table.add_column("failed tests" + (", or how it drives" if varied else ""))
    table.caption = "k: iteration; j: attempt to repair its candidate (0: the first)"
    if varied:
        table.caption += f"; k above {run.iterations}: a variation"
    table.caption_justify = "left"
    for attempt in run.attempts:
        failed = list_tests(attempt.failed_tests, 4)
        if attempt.unchanged or not failed:
            failed = _remark(attempt)
        if found is not None:
            failed = failed or found.text_of(attempt.k, attempt.j)
        table.add_row(str(attempt.k), str(attempt.j), _result(attempt), escape(failed))
    return table


def list_tests(tests: Sequence[str], most: int) -> str:
    """The names of the first `most` tests, and the number of the others."""
    names = [name.rpartition("::")[2] for name in tests]
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _remark(attempt: Attempt) -> str:
    """The last note on an attempt without valid or new code, or on a variation."""
    told = not attempt.valid or attempt.unchanged or attempt.parent is not None
    return "; ".join(attempt.notes[-1:]) if told else ""


def _result(attempt: Attempt) -> str:
    if not attempt.valid:
        return "[yellow]invalid[/]"
    if attempt.unchanged:
        return "[yellow]same code[/]"
    return "[green]verified[/]" if attempt.passed else "[red]failed[/]"
