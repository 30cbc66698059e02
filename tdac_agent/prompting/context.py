"""What the prompt templates may tell of a task, by name."""

from __future__ import annotations

import ast
import math
from typing import Any

from tdac_agent.prompting.manual import interface_of
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.task import SENSORS_FILE, Task
from tdac_agent.verification.suite.contract import ALLOWED_IMPORTS, NAMES, time_step
from tdac_agent.verification.suite.hygiene import (
    FORBIDDEN_ATTRIBUTES,
    FORBIDDEN_CALLS,
    SAVERS,
    SURFACES,
)

LONGEST_WORLD = 16_000
"""Of a world file's characters, so many are shown."""

HOW_THE_MAP_WAS_MADE = {
    *("source", "source_sha256", "method", "threshold", "cleanup", "opening"),
    *("score", "score_terms", "notes"),
}
"""Fields of `params.json` that no controller needs."""

FOR_PEOPLE = ("Graphics", "show")
"""What `sensors.py` has to show a drive: names and documentation are enough."""


def context_of(task: Task) -> dict[str, Any]:
    """Names and values for the templates of a task's environment.

    They hold the nominal task alone: nothing of the moved starts, and no test.
    """
    own = {"map2d": _of_map, "epuck": _of_world}[task.setting.suite](task)
    return {**_of_any(task), **own}


def _of_any(task: Task) -> dict[str, Any]:
    """What the prompts of both environments tell."""
    nominal, progress = task.nominal, task.spec.progress
    interface, limits = interface_of(task.make_env()), Limits()
    return {
        "environment": task.setting.suite,
        "env_description": interface.description,
        "observation_table": interface.observation,
        "action_text": interface.action,
        "allowed_imports": " ".join(sorted(ALLOWED_IMPORTS - {"__future__"})),
        "forbidden_calls": ", ".join(sorted(FORBIDDEN_CALLS)),
        "forbidden_attributes": ", ".join(sorted(FORBIDDEN_ATTRIBUTES)),
        "savers": ", ".join(sorted(SAVERS)),
        "surfaces": ", ".join(sorted(SURFACES)),
        "names": NAMES[task.setting.suite],
        "dt": f"{nominal.dt:g}",
        "dt_ms": f"{1000 * nominal.dt:g}",
        "import_seconds": f"{limits.import_seconds:g}",
        "reset_seconds": f"{limits.reset_seconds:g}",
        "call_seconds": f"{limits.call_seconds:g}",
        "cpu_seconds": f"{limits.cpu_seconds:g}",
        "profile": task.spec.profile,
        "progress_steps": task.progress_steps,
        "full_way": task.progress_steps * nominal.full_step,
        "progress_fraction": f"{progress.fraction:g}",
        "progress_distance": {
            "geodesic": "length of the shortest free path",
            "euclidean": "straight line",
        }[progress.distance],
        "horizon": nominal.horizon,
        "straight": math.dist(nominal.start[:2], nominal.goal),
        "shortest": nominal.shortest,
        "instructions": task.spec.instructions.strip(),
    }


def _of_map(task: Task) -> dict[str, Any]:
    """What only a map's prompt tells."""
    from tdac_agent.environments.map2d.task import map_setting
    from tdac_envs.map2d.terrain import widest_connected_radius

    setting = map_setting(task.setting)
    nominal = setting.nominal
    terrain, grid = nominal.terrain, nominal.terrain.grid
    start = (nominal.start.x, nominal.start.y)
    params = setting.params.model_dump_json(indent=2, exclude=HOW_THE_MAP_WAS_MADE)
    return {
        "params_text": params,
        "widest": widest_connected_radius(terrain.clear, start, nominal.goal),
        "number": 6,
        "speed_unit": "px/s",
        "full_speed": "max_wheel_speed",
        "width": grid.width,
        "height": grid.height,
        "tolerance": nominal.goal_tolerance,
        "radius": nominal.body_radius,
        "sensors_text": _needed(SENSORS_FILE.read_text(encoding="utf-8")),
    }


def _of_world(task: Task) -> dict[str, Any]:
    """What only a world's prompt tells."""
    from tdac_agent.environments.epuck.task import EPuckSetting
    from tdac_envs.epuck.infrared import TABLE
    from tdac_envs.epuck.paths import widest_body
    from tdac_envs.worlds.bodies import BODY_BOTTOM, BODY_TOP

    setting = task.setting
    assert isinstance(setting, EPuckSetting)
    nominal, robot = setting.nominal, setting.params.robot
    start = (nominal.start.x, nominal.start.y)
    widest = widest_body(nominal.ground, start, nominal.goal)
    room = max(widest - nominal.body_radius, 0.0)
    return {
        "params_text": setting.params.model_dump_json(indent=2),
        # The ground's grid knows distances up to 100 mm.
        "widest_mm": f"{1e3 * widest:.1f}" if widest < 0.099 else "at least 99",
        "room_mm": f"{1e3 * room:.1f}",
        "cell_mm": min(10, max(1, math.floor(1e3 * room))),
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


def _needed(source: str) -> str:
    """The part of `sensors.py` that a controller may use, as it stands in the file."""
    lines, kept = source.splitlines(), []
    module = ast.parse(source)
    for node in module.body:
        first, last = node.lineno, node.end_lineno
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if node.name.startswith("_"):
                continue
            kept.append("\n")
            if node.name in FOR_PEOPLE:
                last = node.body[0].end_lineno
        elif isinstance(node, ast.Import | ast.ImportFrom):
            continue
        kept.append("\n".join(lines[first - 1 : last]))
        if getattr(node, "name", "") in FOR_PEOPLE:
            kept.append("    ...")
    return "\n".join(kept)


def _shown(text: str) -> str:
    """A world file, or as much of it as there is room for."""
    if len(text) <= LONGEST_WORLD:
        return text.rstrip()
    head = text[:LONGEST_WORLD].rpartition("\n")[0]
    return f"{head}\n# ... {len(text) - len(head)} characters more: read the file"
