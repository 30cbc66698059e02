"""The robust verification of `tdac verify`, with a progress bar."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.progress import TimeRemainingColumn as TimeLeft

from tdac_agent.cli.console import Console
from tdac_agent.cli.robust_flags import RobustFlags
from tdac_agent.tasks.task import Task
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.sequential import MARGIN
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify_episodes import verify_episodes


def measure(
    file: Path,
    task: Task,
    wanted: RobustFlags,
    *,
    tier: str,
    out: Path | None,
    judge: WarmJudge,
    as_json: bool,
) -> EpisodeReport:
    """Runs the disturbed episodes with a progress bar."""
    assert wanted.robust is not None
    columns = (
        TextColumn("disturbed episodes"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[successes]} reached"),
        TimeLeft(),
    )
    console = Console(stderr=as_json)
    bar = Progress(*columns, console=console, transient=True, auto_refresh=False)
    counts = (0, 0)

    def watch(episodes: int, successes: int) -> None:
        nonlocal counts
        counts = episodes, successes
        bar.update(row, completed=episodes, successes=successes, refresh=True)

    row = bar.add_task("", total=wanted.robust, successes=0)
    try:
        with bar:
            return verify_episodes(
                file,
                task,
                wanted.robust,
                disturbance=wanted.disturbed.disturbance(),
                first=wanted.first_seed,
                accept_at=wanted.accept_at,
                margin=MARGIN if wanted.margin is None else wanted.margin,
                tier=tier,
                out=out,
                judge=judge,
                watch=watch,
            )
    except KeyboardInterrupt:
        reached = f"{counts[1]} of {counts[0]} episodes reached the goal"
        console.print(f"{reached}; no success rate computed")
        if out is not None:
            console.print(
                escape(f"{out} contains the report of the suite, but no episodes.json"),
                soft_wrap=True,
            )
        raise
