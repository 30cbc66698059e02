"""The prompts: a fixed part, the repair rules, and the context of the task."""

from __future__ import annotations

import inspect
import math
import re

from jinja2 import Environment, PackageLoader, StrictUndefined

from tdac_agent.contract import ALLOWED_IMPORTS
from tdac_agent.feedback import render_feedback
from tdac_agent.hygiene import FORBIDDEN_ATTRIBUTES, FORBIDDEN_CALLS
from tdac_agent.report import Report
from tdac_agent.rules import RepairRule, render_block
from tdac_agent.task import SENSORS_FILE, Task
from tdac_agent.task_map2d import map_setting
from tdac_envs.map2d import Map2DEnv


def _templates() -> Environment:
    return Environment(
        loader=PackageLoader("tdac_agent", "prompts"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def generate_prompt(task: Task, rules: tuple[RepairRule, ...]) -> str:
    """The question for a new controller (Listing 1 of the paper, for `policy(obs)`)."""
    nominal, progress = map_setting(task.setting).nominal, task.spec.progress
    sections = _docstring_sections()
    context = {
        "env_description": sections["Description"],
        "observation_table": sections["Observation Space"],
        "action_text": sections["Action Space"],
        "allowed_imports": " ".join(sorted(ALLOWED_IMPORTS - {"__future__"})),
        "forbidden_calls": ", ".join(sorted(FORBIDDEN_CALLS)),
        "forbidden_attributes": ", ".join(sorted(FORBIDDEN_ATTRIBUTES)),
        "dt": f"{nominal.dt:g}",
        "dt_ms": f"{1000 * nominal.dt:g}",
        "profile": task.spec.profile,
        "progress_steps": task.progress_steps,
        "progress_fraction": f"{progress.fraction:g}",
        "progress_distance": {
            "geodesic": "length of the shortest free path",
            "euclidean": "straight line",
        }[progress.distance],
        "horizon": nominal.horizon,
        "tolerance": nominal.goal_tolerance,
        "radius": nominal.robot.radius,
        "rules_block": render_block(rules),
        "sensors_text": SENSORS_FILE.read_text(encoding="utf-8").rstrip(),
        "params_text": task.params.model_dump_json(indent=2),
        "straight": math.dist(nominal.start[:2], nominal.goal),
        "shortest": nominal.shortest,
        "instructions": task.spec.instructions.strip(),
    }
    return _templates().get_template("map2d.md.j2").render(context)


def repair_prompt(kind: str, prompt: str, controller: str, report: Report) -> str:
    """The question to `edit` a controller, or to `summarise` its failures as rules."""
    return (
        _templates()
        .get_template(f"{kind}.md.j2")
        .render(
            prompt=prompt,
            controller=controller.rstrip(),
            feedback=render_feedback(report),
        )
    )


def _docstring_sections() -> dict[str, str]:
    """The `##` sections of the environment's docstring, so that they cannot drift."""
    text = inspect.cleandoc(Map2DEnv.__doc__ or "")
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return {
        title.strip(): body.strip()
        for title, body in zip(parts[1::2], parts[2::2], strict=True)
    }
