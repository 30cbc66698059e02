"""Judges the whole zoo and prints a table; exit 1 where a verdict is not as expected.

After the controllers come the folders and files of somebody else's.

python tests/agent/zoo/run.py [NAME ...] [--kind KIND] [--tier TIER] [--core]
"""

from __future__ import annotations

import difflib
import re
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from queue import SimpleQueue
from typing import Annotated

import typer
from cases import Case, all_cases, tiers_of, working_tiers
from enclosure import Enclosure, Result, differences
from foreign import wrong_foreign
from grounds import KINDS, zoo_task
from offers import chosen_offers, wrong_offers
from rich.console import Console
from rich.table import Table

# One more than the least machine has processors: some attacks only wait.
WORKERS = 3
Job = tuple[Case, str]
Told = dict[tuple[str, str], list[tuple[Result, bool]]]
CONSOLE = Console(width=100, highlight=False)


def main(
    names: Annotated[list[str] | None, typer.Argument(help="All by default.")] = None,
    kind: Annotated[
        str | None, typer.Option(help="Only this kind of task, or `foreign` files.")
    ] = None,
    tier: Annotated[str | None, typer.Option(help="Only on this one.")] = None,
    core: Annotated[bool, typer.Option(help="Only what is judged on all.")] = False,
    workers: Annotated[int, typer.Option(help="Verifications at a time.")] = WORKERS,
) -> None:
    """Judges controllers of the zoo and compares with what their headers promise."""
    if tier not in (None, *working_tiers()):
        works = ", ".join(working_tiers())
        raise typer.BadParameter(
            f"expected one that works here ({works}), got {tier!r}"
        )
    if kind not in (None, *KINDS):
        raise typer.BadParameter(f"expected one of {', '.join(KINDS)}, got {kind!r}")
    everything = not (kind or tier or core)
    offers = chosen_offers(names or []) if everything else []
    kinds = [kind] if kind else list(KINDS)
    cases = [] if names and offers else chosen_cases(names or [], kinds)
    cases = [case for case in cases if case.every_tier or not core]
    jobs = [(case, t) for case in cases for t in tiers_of(case) if tier in (None, t)]
    # What waits for a limit comes first, so that it is not waited for at the end.
    jobs.sort(key=lambda job: "limits" not in job[0].header)
    for name in KINDS:
        zoo_task(name)
    began = time.monotonic()
    told: Told = {(k, t): [] for k in KINDS for t in working_tiers()}
    late: list[Job] = []
    for case, result in judged(jobs, workers, late):
        problems = differences(case, result)
        told[case.kind, result.tier].append((result, not problems))
        CONSOLE.print(row(case, result, problems), markup=False)
        for problem in problems:
            CONSOLE.print(f"    {problem[:600]}", markup=False)
    CONSOLE.print(summary(told))
    wrong = sum(not right for results in told.values() for _, right in results)
    CONSOLE.print(
        f"{len(cases)} controllers, {len(jobs)} verdicts, {len(late)} of them at the "
        f"second try, {wrong} not as expected, {time.monotonic() - began:.0f} s"
    )
    wrong += wrong_offers(offers, workers, CONSOLE)
    if everything and not names:
        wrong += wrong_foreign(workers, CONSOLE)
    raise typer.Exit(1 if wrong or not (jobs or offers) else 0)


def chosen_cases(names: list[str], kinds: list[str]) -> list[Case]:
    """The cases of these names and kinds of task; of all names where none is given."""
    cases = [case for case in all_cases() if case.kind in kinds]
    known = {case.name for case in cases}
    for name in names:
        if name not in known:
            near = ", ".join(difflib.get_close_matches(name, known))
            raise typer.BadParameter(f"no controller {name!r}; near: {near or 'none'}")
    return [case for case in cases if not names or case.name in names]


def judged(
    jobs: list[Job], workers: int, late: list[Job]
) -> Iterator[tuple[Case, Result]]:
    """Results as they come; what was only too slow is judged once more, alone.

    Args:
        jobs: Cases and tiers.
        workers: How many at a time.
        late: Gets the jobs that were judged twice.
    """
    for case, result in side_by_side(jobs, workers):
        if is_late(case, result):
            late.append((case, result.tier))
        else:
            yield case, result
    yield from side_by_side(late, 1)


def is_late(case: Case, result: Result) -> bool:
    """Whether a clock decided otherwise than expected, and nobody was deceived."""
    if result.passed or result.harm or not differences(case, result):
        return False
    return bool(re.search(r"did not end within|ms are allowed", result.messages))


def side_by_side(jobs: list[Job], workers: int) -> Iterator[tuple[Case, Result]]:
    """Results as they come, each from an enclosure that is not in use meanwhile."""
    with ExitStack() as stack:
        free: SimpleQueue[Enclosure] = SimpleQueue()
        for _ in range(min(workers, len(jobs))):
            free.put(stack.enter_context(Enclosure()))

        def judge(case: Case, tier: str) -> tuple[Case, Result]:
            enclosure = free.get()
            try:
                return case, enclosure.judge(case, tier)
            finally:
                free.put(enclosure)

        pool = stack.enter_context(ThreadPoolExecutor(workers))
        for future in as_completed([pool.submit(judge, *job) for job in jobs]):
            yield future.result()


def row(case: Case, result: Result, problems: list[str]) -> str:
    """One line of the table: file, tier, expected, got, seconds."""
    expected = "passed" if case.passes else "failed"
    got = "passed" if result.passed else "failed"
    mark = "  <-- not as expected" if problems else ""
    harm = f" harm: {', '.join(result.harm)}" if result.harm else ""
    return (
        f"{case!s:36} {result.tier:11} {expected:7} {got:7} "
        f"{result.seconds:5.1f} s{harm}{mark}"
    )


def summary(told: Told) -> Table:
    """What came of each kind of task, on each tier."""
    table = Table("kind", "tier")
    for name in ("verdicts", "as expected", "passed", "harmed", "seconds", "longest"):
        table.add_column(name, justify="right")
    for (kind, tier), results in told.items():
        seconds = [result.seconds for result, _ in results]
        table.add_row(
            kind,
            tier,
            str(len(results)),
            str(sum(right for _, right in results)),
            str(sum(result.passed for result, _ in results)),
            str(sum(bool(result.harm) for result, _ in results)),
            f"{sum(seconds):.0f}",
            f"{max(seconds, default=0.0):.1f}",
        )
    return table


if __name__ == "__main__":
    typer.run(main)
