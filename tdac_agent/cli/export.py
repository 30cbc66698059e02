"""`tdac export`: a controller for Webots or ROS 2, a task as a folder of Harbor."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rich.markup import escape

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.spinner import Spinner
from tdac_agent.cli.task_choice import check_tier, chosen
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.cli.webots_flags import (
    ExportHarborOptions,
    ExportRos2Options,
    ExportWebotsOptions,
)
from tdac_agent.environments.epuck.export import SPARE, Project, export_webots
from tdac_agent.harbor.folder import WORLDS, export_set, export_task
from tdac_agent.option_fields import typed_fields
from tdac_agent.ros2.answers import time_answers
from tdac_agent.ros2.export import export_ros2
from tdac_agent.ros2.package_text import TRIED
from tdac_agent.webots.report import WebotsReport
from tdac_agent.webots.run import run_controller
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.webots.stage import open_stage


def run_webots(options: ExportWebotsOptions) -> int:
    """Writes the project and runs it once without Webots; returns 0 if it passes."""
    check_tier(options.tier)
    project = export_webots(options.run, options.out)
    stage = open_stage(project.world)
    steps = project.horizon + SPARE
    env = stage.make_env(steps=steps, goal_tolerance=project.tolerance)
    done = run_controller(project.controller, stage, env, tier=options.tier)
    if options.as_json:
        print_json(_record(project, done.report))
    else:
        _show(project, done.report, Console())
    return 0 if done.report.passed else 1


def run_ros2(options: ExportRos2Options) -> int:
    """Writes a ROS 2 package; returns 0."""
    made = export_ros2(
        options.run, options.out, name=options.name, unverified=options.unverified
    )
    answers = time_answers(options.run)
    if options.as_json:
        record = {**asdict(made), "folder": str(made.folder), "tried": TRIED}
        record["answers"] = asdict(answers)
        print_json({"schema_version": 1, **record})
        return 0
    console = Console()
    print_plain(console, f"wrote {made.folder} (ROS 2 package {made.name})")
    if made.verified:
        console.print(escape(made.verdict), soft_wrap=True)
    else:
        console.print("[bold red]not verified[/]: the package says so")
    longest = max(made.stops.values())
    console.print(f"stops within {longest:.3f} m (README.md lists the causes)")
    print_plain(console, made.unknown)
    if made.reach is not None:
        print_plain(
            console,
            f"a body that reaches at most {made.reach:.3f} m from the middle of its "
            "axle touched nothing of the map in the verified drives",
        )
    if warning := answers.warning():
        console.print(f"[yellow]{warning}[/]", soft_wrap=True)
    console.print(f"[yellow]{TRIED}[/]", soft_wrap=True)
    print_plain(
        console, f"drive it over DDS: tdac ros sim {options.run}, and in another"
    )
    print_plain(console, f"shell tdac ros drive {options.out}")
    return 0


def run_harbor(flags: TaskFlags, options: ExportHarborOptions) -> int:
    """Writes the folder of a task or a task set; returns 0."""
    if not typed_fields(flags) and options.worlds is None:
        raise TaskError("give a task with --task NAME, or a task set with --set NAME")
    with Spinner(f"writing {options.out} …") as spinner:
        spinner()
        problem = chosen(flags, options)
        if isinstance(problem, TaskSet):
            export_set(problem, options.out, options.worlds or WORLDS)
        else:
            export_task(problem, options.out)
    if options.as_json:
        print_json({"schema_version": 1, "folder": str(options.out)})
        return 0
    console = Console()
    print_plain(console, f"wrote {options.out}")
    if isinstance(problem, TaskSet):
        console.print(
            "[yellow]tests/salt tells the hidden worlds[/]: keep tests/ and solution/ "
            "from the agent, as Harbor does",
            soft_wrap=True,
        )
    return 0


def _record(project: Project, report: WebotsReport) -> dict[str, Any]:
    return {
        "schema_version": 1,
        "world": str(project.world),
        "controller": str(project.controller),
        "verified_steps": project.verified_steps,
        "run_in_webots": False,
        "driven_here": asdict(report),
    }


def _show(project: Project, report: WebotsReport, console: Console) -> None:
    for path in (project.world, project.controller):
        print_plain(console, f"wrote {path}")
    if report.passed:
        result = f"[bold green]reached[/] the goal after {report.steps} steps"
    else:
        result = f"[bold red]not passed[/]: {escape(report.why_not)}"
    before = project.verified_steps
    verified = "" if before is None else f" (when verified: {before})"
    line = f"run by tdac, as a Webots controller: {result}{verified}"
    console.print(line, soft_wrap=True)
    console.print("[yellow]not run in Webots itself[/]")
