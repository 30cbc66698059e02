"""Prompt variables of tasks on maps."""

from __future__ import annotations

from typing import Any

from tdac_agent.environments.map2d.moving import sentence_on
from tdac_agent.environments.map2d.setting import Map2DSetting, map_setting
from tdac_agent.prompting.manual import interface_of, needed_part
from tdac_agent.prompting.params_text import params_text
from tdac_agent.prompting.robot_lines import robot_lines
from tdac_agent.tasks.task import SENSORS_FILE, Task
from tdac_envs.drive.task import radii_text
from tdac_envs.map2d.terrain import widest_connected_radius

HOW_THE_MAP_WAS_MADE = {
    *("source", "source_sha256", "method", "threshold", "cleanup", "opening"),
    *("score", "score_terms", "notes"),
}
"""Fields of `params.json` that no controller needs."""
FROM_A_SCANNER = ("ray_ends",)
"""Those that only a controller needs whose rays do not start at the centre."""
CONVERSIONS = ("to_pixels", "to_cell", "to_point")
"""Functions of `sensors.py` that only a controller in metres needs."""
METRES = """\
The world is an occupancy grid made from a map image. Places and lengths are metres in
the frame of the map (that of ROS `map.yaml`): the outer corner of the lower-left pixel
is at `origin`, and without a rotation of this origin x points right and y points UP on
the picture. Headings are measured from +x towards +y, so a positive turn is
counter-clockwise. The map itself is an array of pixels, `occ[j, i]`; `sensors.to_cell`,
`to_pixels` and `to_point` convert. Everything outside the map is occupied. The robot
moves along the exact arc of its wheel speeds, which are constant during a step. The
disc swept along this arc is tested exactly against the occupied squares, so no step can
jump through a thin wall."""
RAYS = """\
Ray i points at `ray_angles[i]` from the heading (rad, counter-clockwise; see
params.json). {}o hit gives `range_max`."""


def facts_of(task: Task) -> dict[str, Any]:
    """Returns the template variables of a task on a map."""
    setting = map_setting(task.setting)
    nominal = setting.nominal
    terrain, grid = nominal.terrain, nominal.terrain.grid
    start = (nominal.start.x, nominal.start.y)
    written = setting.params.written()
    params = {k: v for k, v in written.items() if k not in HOW_THE_MAP_WAS_MADE}
    return {
        "robot_text": "a differential-drive robot over a 2-D map",
        "files_text": "`params.json`, `occupancy.npy`, `occupancy.png`, `robot.png`",
        "loaders_text": (
            "`load_params() -> dict`, `load_occupancy() -> bool array [y, x]`"
        ),
        "params_text": params_text(params),
        "widest": widest_connected_radius(terrain.clear, start, nominal.goal),
        "movers_text": sentence_on(setting.movers),
        "number": 6,
        "speed_unit": "px/s",
        "full_speed": "max_wheel_speed",
        "width": grid.width,
        "height": grid.height,
        "tolerance": nominal.goal_tolerance,
        "tolerance_radii": radii_text(nominal.goal_tolerance, nominal.body_radius),
        "radius": nominal.body_radius,
        "sensors_text": needed_part(
            SENSORS_FILE.read_text(encoding="utf-8"),  # raw read: shipped
            _not_needed(setting),
        ),
        "length": setting.task_units.length,
        "robot_lines": _robot_lines(task, setting),
        "frame": setting.params.frame,
        **({} if setting.view is None else _in_metres(setting)),
    }


def _not_needed(setting: Map2DSetting) -> tuple[str, ...]:
    """Functions of `sensors.py` that a controller of this task does not need."""
    without = CONVERSIONS if setting.view is None else ()
    return without if setting.nominal.robot.scanner_offset else without + FROM_A_SCANNER


def _in_metres(setting: Map2DSetting) -> dict[str, str]:
    """What differs if a controller observes metres."""
    table = interface_of(setting.observed()).observation.partition("\n\n")[0]
    offset = setting.nominal.robot.scanner_offset
    rays = RAYS.format("N" if offset else "Rays start at the centre; n")
    return {
        "env_description": METRES,
        "observation_table": f"{table.replace('px', 'm')}\n\n{rays}",
    }


def _robot_lines(task: Task, setting: Map2DSetting) -> list[str]:
    """Sentences on what not every robot has: limits, scanner, errors."""
    lines = robot_lines(setting.nominal.robot, setting.task_units)
    if task.says_disturbances:
        own = task.own_disturbance()
        lines.append(f"When the controller is confirmed, there are also: {own}.")
    return lines
