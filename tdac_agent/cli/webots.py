"""`tdac webots run`: runs a Webots controller in a Webots world, without Webots."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Table
from rich.text import Text

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.film import film_of
from tdac_agent.cli.printed import show_printed
from tdac_agent.cli.task_choice import check_heading, check_tier
from tdac_agent.cli.webots_flags import WebotsOptions
from tdac_agent.webots.report import WebotsReport
from tdac_agent.webots.run import frames, run_controller
from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.video import SUFFIXES, write_video
from tdac_envs.epuck.task import TOLERANCE
from tdac_envs.webots.stage import open_stage
from tdac_envs.worlds.bundled import world_file


def run(options: WebotsOptions) -> int:
    """Runs a controller and prints its report; returns 0 if it passed, else 1."""
    check_tier(options.tier)
    check_heading(options.heading)
    controller, video, tier = options.controller, options.video, options.tier
    if video is not None and video.suffix.lower() not in SUFFIXES:
        raise TaskError(f"--video must end in .mp4 or .gif, got {video.name!r}")
    start: tuple[float, ...] | None = options.start
    if start is not None and options.heading is not None:
        start = (*start, options.heading)
    file = world_file(options.world)
    stage = open_stage(file, options.goal, options.ignore, start, controller.stem)
    tolerance = TOLERANCE if options.tolerance is None else options.tolerance
    how: dict[str, Any] = {
        "steps": options.steps,
        "goal_tolerance": tolerance,
        "webots_sensors": options.webots_sensors,
    }
    console = Console(stderr=options.as_json)
    env = stage.make_env(**how)
    if not options.as_json:
        _show_notes(stage.notes, console)
    with _bar(console) as bar:
        watch = _watcher(bar, controller.name, env.nominal.horizon)
        done = run_controller(
            controller, stage, env, tier=tier, seconds=options.seconds, watch=watch
        )
    if options.as_json:
        print_json({"schema_version": 1, **asdict(done.report)})
    else:
        _show(done.report, stage.notes, console)
    if video is not None:
        with console.status(f"drawing {escape(video.name)} …"):
            env = stage.make_env(**how, render_mode="rgb_array")
            film = film_of(done.log.steps, env.nominal.dt, options.speed, video)
            write_video(frames(env, done.log, film.stride), video, film.fps)
        if not options.as_json:
            print(f"wrote {video} ({film})")
    return 0 if done.report.passed else 1


def _bar(console: Console) -> Progress:
    """A progress bar that is redrawn only on updates."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    off = not console.is_terminal
    return Progress(
        *columns, console=console, transient=True, auto_refresh=False, disable=off
    )


def _watcher(bar: Progress, name: str, most: int) -> Callable[[int], None]:
    """A callback that advances the bar at every hundredth of the steps."""
    row, shown = bar.add_task(escape(name), total=most), 0

    def watch(steps: int) -> None:
        nonlocal shown
        if 100 * (steps - shown) >= most:
            shown = steps
            bar.update(row, completed=steps, refresh=True)

    return watch


def _show_notes(notes: Iterable[str], console: Console) -> None:
    for note in notes:
        console.print(Text(f"note: {note}"), soft_wrap=True)


def _show(report: WebotsReport, shown: tuple[str, ...], console: Console) -> None:
    """Shows a report but for the notes that were shown before the run."""
    if report.sandbox == "rlimits":
        console.print(
            "[yellow]warning: with the sandbox tier rlimits, the controller can access "
            "files and the network[/]"
        )
    show_printed(report.output, console)
    if report.error is not None:
        console.print("[red]the controller failed[/]")
        console.print(Text(f"  {report.error}\n{report.traceback}"), soft_wrap=True)
    _show_notes((note for note in report.notes if note not in shown), console)
    console.print(_table(report))
    colour, word = ("green", "passed") if report.passed else ("red", "not passed")
    why = f": {escape(report.why_not)}" if report.why_not else ""
    console.print(
        f"[bold {colour}]{word}[/]{why}  ({escape(report.controller)} in "
        f"{escape(report.world)}, sandbox {report.sandbox}; not run in Webots itself)",
        soft_wrap=True,
    )


def _table(report: WebotsReport) -> Table:
    table = Table(
        title="Run as recorded by the environment", title_justify="left",
        show_header=False,
    )  # fmt: skip
    ended = report.goal is None and report.outcome == "out of time"
    table.add_row("outcome", "all steps done" if ended else report.outcome)
    table.add_row("steps", f"{report.steps} ({report.time:.2f} s)")
    contact = report.first_contact
    where = "" if contact is None else f", the first at {_point(*contact[1:])}"
    step = "" if contact is None else f" in step {contact[0]}"
    table.add_row("steps with a contact", f"{report.collisions}{where}{step}")
    if report.goal is None:
        table.add_row("goal", "none in this world")
    else:
        table.add_row("goal", _point(*report.goal))
        table.add_row("path left", f"{report.d_min:.3f} m of {report.d0:.3f} m")
        table.add_row("straight left", f"{report.d_min_euclidean:.3f} m")
    table.add_row("driven", f"{report.way:.3f} m")
    for name, (x, y, heading) in (("start", report.start), ("end", report.end)):
        table.add_row(name, f"{_point(x, y)}, heading {heading:.3f} rad")
    if report.left_out:
        table.add_row("ignored", ", ".join(map(escape, report.left_out)))
    return table


def _point(x: float, y: float) -> str:
    return f"({x:.3f}, {y:.3f})"
