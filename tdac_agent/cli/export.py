"""`tdac export webots`: a verified e-puck controller as a Webots project."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import check_tier
from tdac_agent.environments.epuck.export import SPARE, Project, export_webots
from tdac_agent.webots.report import WebotsReport
from tdac_agent.webots.run import run_controller
from tdac_envs.webots.stage import open_stage


def run(run_folder: Path, out: Path, tier: str, as_json: bool) -> int:
    """Writes the project and runs it once without Webots; returns 0 if it passes."""
    check_tier(tier)
    project = export_webots(run_folder, out)
    stage = open_stage(project.world)
    steps = project.horizon + SPARE
    env = stage.make_env(steps=steps, goal_tolerance=project.tolerance)
    done = run_controller(project.controller, stage, env, tier=tier)
    if as_json:
        sys.stdout.write(json.dumps(_record(project, done.report), indent=2) + "\n")
    else:
        _show(project, done.report, Console())
    return 0 if done.report.passed else 1


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
        console.print(f"wrote {escape(str(path))}", soft_wrap=True)
    if report.passed:
        result = f"[bold green]reached[/] the goal after {report.steps} steps"
    else:
        result = f"[bold red]not passed[/]: {escape(report.why_not)}"
    before = project.verified_steps
    verified = "" if before is None else f" (when verified: {before})"
    line = f"run by tdac, as a Webots controller: {result}{verified}"
    console.print(line, soft_wrap=True)
    console.print("[yellow]not run in Webots itself[/]")
