"""Prompt variables of tasks in worlds."""

from __future__ import annotations

import math
from typing import Any

from tdac_agent.environments.epuck.setting import world_setting
from tdac_agent.tasks.task import Task
from tdac_agent.verification.suite.contract import time_step
from tdac_envs.drive.task import radii_text
from tdac_envs.epuck.infrared import TABLE
from tdac_envs.epuck.paths import widest_body
from tdac_envs.worlds.bodies import BODY_BOTTOM, BODY_TOP
from tdac_envs.worlds.world import JOINT_DISTANCE

LONGEST_WORLD = 16_000
"""Maximum number of characters of a world file in a prompt."""


def facts_of(task: Task) -> dict[str, Any]:
    """Returns the template variables of a task in a world."""
    setting = world_setting(task.setting)
    nominal, robot = setting.nominal, setting.params.robot
    start = (nominal.start.x, nominal.start.y)
    widest = widest_body(nominal.ground, start, nominal.goal)
    room = max(widest - nominal.body_radius, 0.0)
    return {
        "robot_text": "an e-puck through a Webots world",
        "files_text": "`world.wbt`, `params.json`",
        "loaders_text": "`load_params() -> dict`",
        "params_text": setting.params.model_dump_json(indent=2),
        # The ground's grid stores distances up to 100 mm.
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
        "joints": f"{JOINT_DISTANCE:g}",
        "time_step": time_step(nominal.dt),
        "sensor_range": f"{robot.sensor_range:g}",
        "tolerance_m": f"{nominal.goal_tolerance:g}",
        "tolerance_mm": f"{1e3 * nominal.goal_tolerance:g}",
        "tolerance_radii": radii_text(nominal.goal_tolerance, nominal.body_radius),
        "radius_mm": f"{1e3 * nominal.body_radius:g}",
        "body_bottom": f"{1e3 * BODY_BOTTOM:g}",
        "body_top": f"{1e3 * BODY_TOP:g}",
        "world_text": _shortened(setting.text),
    }


def _shortened(text: str) -> str:
    """Returns a world file, cut at the maximum length."""
    if len(text) <= LONGEST_WORLD:
        return text.rstrip()
    head = text[:LONGEST_WORLD].rpartition("\n")[0]
    return f"{head}\n# ... {len(text) - len(head)} characters more: read the file"
