"""`tdac export harbor`: a task or a task set as a task folder of Harbor."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.set_flags import check_set
from tdac_agent.cli.spinner import Spinner
from tdac_agent.harbor.folder import WORLDS, export_set, export_task
from tdac_agent.runs.ownership import load_task
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import load_set


def run(
    task: str | None, name: str | None, worlds: int | None, out: Path, as_json: bool
) -> int:
    """Writes the folder; returns 0."""
    check_set(name, {"-n": worlds}, {"--task": task})
    if name is None and task is None:
        raise TaskError("give a task with --task NAME, or a task set with --set NAME")
    with Spinner(f"writing {out} …") as spinner:
        spinner()
        if name is not None:
            export_set(load_set(name), out, worlds or WORLDS)
        else:
            assert task is not None
            export_task(load_task(task), out)
    if as_json:
        sys.stdout.write(json.dumps({"schema_version": 1, "folder": str(out)}) + "\n")
        return 0
    console = Console()
    console.print(f"wrote {escape(str(out))}", soft_wrap=True)
    if name is not None:
        console.print(
            "[yellow]tests/salt tells the hidden worlds[/]: keep tests/ and solution/ "
            "from the agent, as Harbor does",
            soft_wrap=True,
        )
    return 0
