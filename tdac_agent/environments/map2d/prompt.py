"""Prompt variables of tasks on maps."""

from __future__ import annotations

from typing import Any

from tdac_agent.environments.map2d.moving import sentence_on
from tdac_agent.environments.map2d.setting import map_setting
from tdac_agent.prompting.source_excerpt import needed_part
from tdac_agent.tasks.task import SENSORS_FILE, Task
from tdac_envs.map2d.terrain import widest_connected_radius

HOW_THE_MAP_WAS_MADE = {
    *("source", "source_sha256", "method", "threshold", "cleanup", "opening"),
    *("score", "score_terms", "notes"),
}
"""Fields of `params.json` that no controller needs."""


def facts_of(task: Task) -> dict[str, Any]:
    """Returns the template variables of a task on a map."""
    setting = map_setting(task.setting)
    nominal = setting.nominal
    terrain, grid = nominal.terrain, nominal.terrain.grid
    start = (nominal.start.x, nominal.start.y)
    params = setting.params.model_dump_json(indent=2, exclude=HOW_THE_MAP_WAS_MADE)
    return {
        "robot_text": "a differential-drive robot over a 2-D map",
        "files_text": "`params.json`, `occupancy.npy`, `occupancy.png`, `robot.png`",
        "loaders_text": (
            "`load_params() -> dict`, `load_occupancy() -> bool array [y, x]`"
        ),
        "params_text": params,
        "widest": widest_connected_radius(terrain.clear, start, nominal.goal),
        "movers_text": sentence_on(setting.movers),
        "number": 6,
        "speed_unit": "px/s",
        "full_speed": "max_wheel_speed",
        "width": grid.width,
        "height": grid.height,
        "tolerance": nominal.goal_tolerance,
        "radius": nominal.body_radius,
        "sensors_text": needed_part(SENSORS_FILE.read_text(encoding="utf-8")),
    }
