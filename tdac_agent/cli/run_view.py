"""Prints a run on the terminal: its attempts, result and cost."""

from __future__ import annotations

import shlex

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.run_ending import show_ending, show_next
from tdac_agent.cli.sentences import print_indented, print_plain
from tdac_agent.cli.set_view import show_set_report
from tdac_agent.library.listing import resume_command
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.improvement_record import (
    NOT_SHOWN,
    TaskImprovement,
    is_shown,
    read_improvement,
)
from tdac_agent.runs.run_record import Attempt, Run
from tdac_agent.runs.selection_record import (
    HIDDEN_FILE,
    CandidateFigures,
    Improvement,
    Selection,
    asked_text,
    losses_text,
)
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.verification.diagnosis.listed import list_tests
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verdict import COLOURS
from tdac_envs.core.intake import RECORD_BYTES, read_file


def show_run(run: Run, console: Console) -> None:
    """Prints the attempts in a table, then the result and the next commands."""
    usage, folder = usage_of(run), run.folder
    search = read_improvement(folder) if run.improve else None
    if run.attempts:
        console.print(_attempts(run, search))
    if run.passed and run.status != "budget":
        show_ending(run, search, console)
        print_indented(console, usage)
        show_next(run, console)
    elif run.status == "budget":
        print_budget_end(run, console)
    else:
        times = f"{run.iterations} iteration{'' if run.iterations == 1 else 's'}"
        ending = f"[bold red]not verified[/] after {times}; "
        attempts = escape(str(folder / "iterations"))
        console.print(f"{ending}the attempts are in {attempts}", soft_wrap=True)
        print_indented(console, usage)


def print_budget_end(run: Run, console: Console) -> None:
    """Prints that the budget ended a run, and how to continue it."""
    console.print(f"[bold yellow]stopped by the budget[/]: {escape(run.reason)}")
    print_indented(console, usage_of(run))
    print_indented(console, run.outlook)
    print_plain(console, f"  to continue: {resume_command(run)}")


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


def _attempts(run: Run, search: TaskImprovement | None) -> Table:
    table = Table(title=escape(f"{run.task}: {run.learner}"), title_justify="left")
    table.add_column("k", justify="right")
    table.add_column("j", justify="right")
    table.add_column("result")
    varied = any(attempt.parent is not None for attempt in run.attempts)
    table.add_column("details")
    table.caption = "k: iteration; j: attempt to repair its candidate (0: the first)"
    if varied:
        table.caption += f"; k above {run.iterations}: a variation"
    table.caption_justify = "left"
    for attempt in run.attempts:
        failed = "" if attempt.passed else list_tests(attempt.failed_tests, 4)
        if attempt.unchanged or not failed:
            failed = _remark(attempt)
        if search is not None and (attempt.confirmed is not None or not failed):
            failed = search.text_of(attempt.k, attempt.j) or failed
        table.add_row(str(attempt.k), str(attempt.j), _result(attempt), escape(failed))
    return table


def _remark(attempt: Attempt) -> str:
    """The last note on an attempt without valid or new code, or on a variation."""
    is_explained = not attempt.valid or attempt.unchanged or attempt.parent is not None
    is_explained = is_explained or attempt.confirmed is not None
    return "; ".join(attempt.notes[-1:]) if is_explained else ""


def _result(attempt: Attempt) -> str:
    if not attempt.valid:
        return "[yellow]invalid[/]"
    if attempt.unchanged:
        return "[yellow]same code[/]"
    if not attempt.passed:
        return "[red]failed[/]"
    if attempt.confirmed is None:
        return f"[{COLOURS['passed']}]passed[/]"
    word = "verified" if attempt.confirmed else "not verified"
    return f"[{COLOURS[word]}]{word}[/]"


def show_selection(run: Run, console: Console) -> None:
    """Prints a run on a task set: what was selected, or why nothing was."""
    if run.status == "budget":
        print_budget_end(run, console)
        return
    if run.tau is not None:
        _show_selected(run, console)
    else:
        reason = escape(run.reason)
        console.print(f"[bold red]no controller was selected[/]: {reason}")
        console.print(f"  the attempts are in {run.folder / 'iterations'}")
    if usage := usage_of(run):
        console.print(f"  {escape(usage)}")


def _show_selected(run: Run, console: Console) -> None:
    """Prints the selection, the verdict on hidden worlds if any, and next commands."""
    content = read_file(run.folder / "report.json", RECORD_BYTES)
    selection = Selection.model_validate_json(content)
    console.print(_candidates(selection))
    most = selection.episodes + selection.improve
    console.print(
        f"  goals reached, of worlds of dev; {selection.used} of at most {most} "
        "episodes were driven",
        highlight=False,
    )
    if selection.stopped:
        console.print(f"  the writing ended: {escape(selection.stopped)}")
    console.print(
        f"[bold]selected[/] k={selection.k} j={selection.j}, {run.seconds:.0f} s: "
        f"{escape(str(run.controller))}",
        soft_wrap=True,
    )
    scores = selection.optimistic
    if scores is not None:
        console.print(
            f"  selected, optimistic: {100 * scores.success:.1f} % reached, time score "
            f"{scores.time:.3f}",
            highlight=False,
        )
    if selection.improvement is not None:
        for line in _improvement(selection.improvement):
            console.print(f"  {line}", highlight=False)
    hidden = run.folder / HIDDEN_FILE
    if run.status != "selected" and hidden.is_file():
        text = read_file(hidden, RECORD_BYTES)
        show_set_report(EpisodeReport.model_validate_json(text), console)
        return
    words = ["tdac", "verify", str(run.controller), "--set", str(run.folder / SET_FILE)]
    print_plain(console, f"  not verified yet: {shlex.join(words)}")


def _improvement(search: Improvement) -> list[str]:
    """What the search for improvements brought, in lines."""
    count = f"{search.variations} variation{'' if search.variations == 1 else 's'}"
    base = f"k={search.k} j={search.j}"
    if not search.worlds:
        return [f"improving: {count}; none was better than {base}, which stays"]
    assert search.before is not None
    assert search.after is not None
    assert search.low is not None
    assert search.high is not None
    caution = "" if is_shown(search.low, search.p) else f"; {NOT_SHOWN}"
    line = (
        f"improving: {count}; time score {search.before:.3f} ({base}) -> "
        f"{search.after:.3f} on {search.worlds} other worlds: "
        f"{search.after - search.before:+.3f} "
        f"(95 % interval {search.low:+.3f} to {search.high:+.3f})"
        f"{caution}"
    )
    lost = losses_text(search.lost_before, search.lost_after)
    return [line, *([f"lost there: {lost}"] if lost else [])]


def _candidates(selection: Selection) -> Table:
    """The candidates of the loop or race, and how those did that were selected from."""
    raced = selection.search == "race"
    table, searched = Table(box=SIMPLE, padding=(0, 1, 0, 0)), selection.improve > 0
    columns = ("k", "asked for", "pool", "time score", "lost most by")
    if not raced:
        columns = ("k", "j", "feedback", *(("improving",) if searched else ()))
    for name in columns:
        left = name in {"asked for", "lost most by"}
        table.add_column(name, justify="left" if left else "right")
    for name in ("validation", "time score"):
        table.add_column(name, justify="right")
    for each in selection.candidates:
        if raced or each.feedback_worlds or each.validation_worlds:
            chosen = (each.k, each.j) == (selection.k, selection.j)
            cells = _raced(each) if raced else _cells(each, searched=searched)
            table.add_row(*cells, style="bold" if chosen else None)
    return table


def _raced(each: CandidateFigures) -> tuple[str, ...]:
    """The cells of a candidate of a race."""
    worst = max(each.lost, key=each.lost.__getitem__, default="")
    return (
        str(each.k),
        asked_text(each.asked, each.parents),
        _part(each.pool_reached, each.pool_worlds),
        _score(each.improve_time),
        f"{worst} {each.lost[worst]:.2f}" if worst and each.lost[worst] else "",
        _part(each.validation_reached, each.validation_worlds),
        _score(each.validation_time),
    )


def _cells(each: CandidateFigures, *, searched: bool) -> tuple[str, ...]:
    return (
        str(each.k),
        str(each.j),
        _part(each.feedback_reached, each.feedback_worlds),
        *([_score(each.improve_time)] if searched else []),
        _part(each.validation_reached, each.validation_worlds),
        _score(each.validation_time),
    )


def _part(reached: int, worlds: int) -> str:
    return f"{reached}/{worlds}" if worlds else ""


def _score(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"
