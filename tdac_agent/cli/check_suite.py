"""`tdac check-suite`: tests a suite with a reference and with bad controllers."""

from __future__ import annotations

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.check_suite_flags import CheckSuiteOptions
from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.cli.task_choice import check_tier, chosen_single
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.tasks.task import display_name
from tdac_agent.tasks.trust import allowed
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite.privileged import REFERENCE
from tdac_agent.verification.suite.proof import ProofRow, SuiteCheck
from tdac_agent.verification.suite_check import check_suite


def run(flags: TaskFlags, options: CheckSuiteOptions) -> int:
    """Checks a suite and prints the result; returns the exit code."""
    check_tier(options.tier)
    console = Console(stderr=options.as_json)
    with WarmJudge() as judge, console.status("preparing the task …") as status:
        task = allowed(chosen_single(flags), options.suite, trust=options.trust)
        check = check_suite(
            task,
            profile=options.profile,
            tier=options.tier,
            seed=options.seed,
            repeats=options.repeats,
            judge=judge,
            on_progress=lambda doing: status.update(
                f"checking the suite on {escape(task.name)}: {doing} …"
            ),
        )
    if options.as_json:
        print_json(check)
    else:
        _show(check, display_name(task), console)
    return 0 if check.proven else 1


def _show(check: SuiteCheck, task: str, console: Console) -> None:
    for note in check.notes:
        print_sentences(console, f"note: {note}", "yellow")
    for problem in check.problems:
        print_sentences(console, problem, "red")
    console.print(_table(check))
    colour, word = ("green", "proven") if check.proven else ("red", "not proven")
    console.print(
        f"[bold {colour}]{word}[/]: {escape(check.suite)} on {escape(task)}, "
        f"profile {check.profile}, seed {check.seed}, sandbox {check.sandbox}, "
        f"{check.seconds:.0f} s"
    )


def _table(check: SuiteCheck) -> Table:
    """One row per controller."""
    table = Table(title="The suite on the reference and on bad controllers")
    table.title_justify = "left"
    for name in ("controller", "expected", "result"):
        table.add_column(name)
    table.add_column("repeats agree", justify="right")
    table.add_column("failed tests")
    for row in check.rows:
        good = row.controller == REFERENCE
        right = row.passed == (row.repeats if good else 0)
        colour = "green" if right else "red"
        table.add_row(
            row.controller,
            "pass" if good else "fail",
            f"[{colour}]{_result(row)}[/]",
            "[red]no[/]" if row.disagreements else f"{row.repeats}",
            escape(_failed_tests(row)),
        )
    return table


def _result(row: ProofRow) -> str:
    if 0 < row.passed < row.repeats:
        return f"pass {row.passed} of {row.repeats}"
    return "pass" if row.passed else "fail"


def _failed_tests(row: ProofRow) -> str:
    names = [test.partition("::")[2] for test in row.failures]
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if names[3:] else "")
