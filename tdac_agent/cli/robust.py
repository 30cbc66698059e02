"""The robust part of `tdac verify`, with its progress."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.progress import TimeRemainingColumn as TimeLeft

from tdac_agent.cli.console import Console
from tdac_agent.cli.robust_flags import RobustFlags
from tdac_agent.evaluation.robust import verify_robust
from tdac_agent.evaluation.robust_report import RobustReport
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.sequential import MARGIN
from tdac_agent.verification.judge.warm import WarmJudge


def measure(
    file: Path,
    task: Task,
    wanted: RobustFlags,
    *,
    tier: str,
    out: Path | None,
    judge: WarmJudge,
    as_json: bool,
) -> RobustReport:
    """Runs the disturbed episodes, with a bar for whoever watches."""
    assert wanted.robust is not None
    columns = (
        TextColumn("disturbed episodes"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[successes]} reached"),
        TimeLeft(),
    )
    console = Console(stderr=as_json)
    # Drawn where there is something new, and not ten times a second.
    bar = Progress(*columns, console=console, transient=True, auto_refresh=False)
    seen = (0, 0)

    def watch(episodes: int, successes: int) -> None:
        nonlocal seen
        seen = episodes, successes
        bar.update(row, completed=episodes, successes=successes, refresh=True)

    row = bar.add_task("", total=wanted.robust, successes=0)
    try:
        with bar:
            return verify_robust(
                file,
                task,
                wanted.robust,
                disturbance=wanted.disturbed.disturbance(),
                first_seed=wanted.first_seed,
                accept_at=wanted.accept_at,
                margin=MARGIN if wanted.margin is None else wanted.margin,
                tier=tier,
                out=out,
                judge=judge,
                watch=watch,
            )
    except KeyboardInterrupt:
        console.print(f"{seen[1]} of {seen[0]} episodes had reached the goal; no rate")
        if out is not None:
            console.print(
                escape(f"{out} holds the report of the suite; no robust.json"),
                soft_wrap=True,
            )
        raise
