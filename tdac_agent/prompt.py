"""The prompts: a fixed part, the repair rules, and the context of the task."""

from __future__ import annotations

import inspect
import math
import re
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from tdac_agent.contract import ALLOWED_IMPORTS, time_step
from tdac_agent.feedback import render_feedback
from tdac_agent.hygiene import FORBIDDEN_ATTRIBUTES, FORBIDDEN_CALLS
from tdac_agent.report import Report
from tdac_agent.rules import RepairRule, render_block
from tdac_agent.task import SENSORS_FILE, Task

LONGEST_WORLD = 16_000
"""Of a world file's characters, so many are shown."""


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
    """The question for a new controller (Listings 1 and 2, for `policy(obs)`)."""
    suite = task.setting.suite
    own = {"map2d": _of_map, "epuck": _of_world}[suite](task)
    context = {**_of_any(task), **own, "rules_block": render_block(rules)}
    return _templates().get_template(f"{suite}.md.j2").render(context)


def _of_any(task: Task) -> dict[str, Any]:
    """What the prompts of both environments tell."""
    nominal, progress = task.nominal, task.spec.progress
    return {
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
        "params_text": task.params.model_dump_json(indent=2),
        "straight": math.dist(nominal.start[:2], nominal.goal),
        "shortest": nominal.shortest,
        "instructions": task.spec.instructions.strip(),
    }


def _of_map(task: Task) -> dict[str, Any]:
    """What only a map's prompt tells."""
    from tdac_envs.map2d import Map2DEnv

    return {
        **_manual(Map2DEnv),
        "number": 6,
        "speed_unit": "px/s",
        "full_speed": "max_wheel_speed",
        "tolerance": task.nominal.goal_tolerance,
        "radius": task.nominal.body_radius,
        "sensors_text": SENSORS_FILE.read_text(encoding="utf-8").rstrip(),
    }


def _of_world(task: Task) -> dict[str, Any]:
    """What only a world's prompt tells."""
    from tdac_agent.task_epuck import EPuckSetting
    from tdac_envs.bodies import BODY_BOTTOM, BODY_TOP
    from tdac_envs.epuck.env import EPuckEnv
    from tdac_envs.epuck.infrared import TABLE

    setting = task.setting
    assert isinstance(setting, EPuckSetting)
    nominal, robot = setting.nominal, setting.params.robot
    manual = _manual(EPuckEnv)
    return {
        **manual,
        "observation_table": _without_options(manual["observation_table"]),
        "distances": [f"{1e3 * row[0]:g}" for row in TABLE.tolist()],
        "readings": [f"{row[1]:.0f}" for row in TABLE.tolist()],
        "number": 7,
        "speed_unit": "m/s",
        "full_speed": f"{robot.max_wheel_speed * robot.wheel_radius:g}",
        "wheel_limit": f"{robot.max_wheel_speed:g}",
        "axle": f"{robot.axle_length:g}",
        "time_step": time_step(nominal.dt),
        "sensor_range": f"{robot.sensor_range:g}",
        "tolerance_m": f"{nominal.goal_tolerance:g}",
        "tolerance_mm": f"{1e3 * nominal.goal_tolerance:g}",
        "radius_mm": f"{1e3 * nominal.body_radius:g}",
        "body_bottom": f"{1e3 * BODY_BOTTOM:g}",
        "body_top": f"{1e3 * BODY_TOP:g}",
        "world_text": _shown(setting.text),
    }


def _without_options(table: str) -> str:
    """The table without what is observed only where it is asked for."""
    lines = [line for line in table.splitlines() if "=True`" not in line]
    return "\n".join(lines)


def _shown(text: str) -> str:
    """A world file, or as much of it as there is room for."""
    if len(text) <= LONGEST_WORLD:
        return text.rstrip()
    head = text[:LONGEST_WORLD].rpartition("\n")[0]
    return f"{head}\n# ... {len(text) - len(head)} characters more: read the file"


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


def _manual(env: type) -> dict[str, str]:
    """The `##` sections of an environment's docstring, so that they cannot drift."""
    text = inspect.cleandoc(env.__doc__ or "")
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    sections = {
        title.strip(): body.strip()
        for title, body in zip(parts[1::2], parts[2::2], strict=True)
    }
    return {
        "env_description": sections["Description"],
        "observation_table": sections["Observation Space"],
        "action_text": sections["Action Space"],
    }
