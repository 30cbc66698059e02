"""Variables of the snippets that tell a fact; `facts/README.md` explains them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection
from typing import Any

from tdac_agent.prompting.facts import FACTS, FactsPrompt, is_told
from tdac_agent.prompting.params_text import params_text
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs.epuck.infrared import ELEVATION, LARGEST, PLACES, RANGE, TABLE
from tdac_envs.epuck.observed import ENCODER_STEP
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.shown import in_shown_units
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.mapping.params import RobotParams
from tdac_envs.worlds.world import JOINT_DISTANCE

MEANINGS = {
    "pose": "x, y, heading of the robot",
    "goal": "x, y of the goal",
    "wheel_speeds": "speeds of the wheels",
    "odometry": "measured motion of the last step",
    "ranges": "distances to obstacles around",
    "ps": "infra-red sensors",
    "encoders": "angles of the wheels",
}
"""What is observed, in words that carry no fact."""
KEYS: dict[str, tuple[str, ...]] = {
    "schema_version": (),
    "observed": (),
    "map": (),
    "frame": ("axes",),
    "resolution": ("units", "worlds"),
    "dt": ("speed",),
    "goal_tolerance": ("tolerance",),
    "disturbances": ("disturbances",),
    "cpu": ("budget",),
    "robot": (),
}
"""The facts that a key of `params.json` belongs to; it is printed if all are told."""
_SPEED = (
    *("max_wheel_speed", "wheel_radius", "max_speed", "max_turn_rate"),
    *("max_acceleration", "max_turn_acceleration", "stopping_distance"),
)
ROBOT_KEYS: dict[str, tuple[str, ...]] = {
    "radius": ("radius",),
    "axle_length": ("axle",),
    **dict.fromkeys(_SPEED, ("speed",)),
    "n_rays": ("rays",),
    "field_of_view_deg": ("rays",),
    "ray_angles": ("rays", "turning", "units"),
    "range_max": ("range",),
    "range_min": ("range",),
    "below_min": ("range",),
    "sensor_range": ("range",),
    "scanner_offset": ("range", "axes"),
    "kind": ("radius", "speed", "axle", "rays", "range"),
}
"""The same of the keys of `robot` in it: `kind` gives its sizes away."""


def fact_context(tasks: TaskSet, prompt: FactsPrompt) -> dict[str, Any]:
    """Returns the variables of a question that is made of facts.

    Args:
        tasks: The task set.
        prompt: Which facts it tells.
    """
    file, told = in_shown_units(tasks.file), prompt.told
    units = "units" in told
    return {
        "told": told,
        "wording": prompt.wording,
        "meanings": [
            (key, _shape(file, key), MEANINGS[key]) for key in sorted(file.observed)
        ],
        "length_unit": f" {file.shown_unit}" if units else "",
        "angle_unit": " rad" if units else "",
        "positive": _positive(file),
        "d": _disturbances(file),
        "params_text": told_params(level_params(tasks.file), told),
        **(_infrared() if file.is_epuck else _scan(tasks.file)),
    }


def told_params(params: dict[str, Any], told: Collection[str]) -> str:
    """The contents of `params.json` that are told; empty if none belongs to a fact.

    Args:
        params: The contents.
        told: The facts that are told.
    """
    robot = _told(params["robot"], ROBOT_KEYS, told)
    shown = _told({**params, "robot": robot}, KEYS, told)
    if not robot:
        del shown["robot"]
    return params_text(shown) if any(KEYS.get(key) for key in shown) or robot else ""


def _told(
    values: dict[str, Any], keys: dict[str, tuple[str, ...]], told: Collection[str]
) -> dict[str, Any]:
    # A key that belongs to no listed fact may give any of them away.
    return {
        key: value
        for key, value in values.items()
        if is_told(keys.get(key, FACTS), told)
    }


def _shape(file: SetFile, key: str) -> str:
    robot = file.robot
    rays = len(PLACES) if isinstance(robot, EPuckRobotParams) else robot.n_rays
    sizes = {"pose": 3, "ranges": rays, "ps": rays}
    return f"({sizes.get(key, 2)},)"


def _positive(file: SetFile) -> dict[str, str]:
    """Where positive turns go."""
    if file.shown_unit == "m":
        return {
            "side": "left",
            "clock": "counter-clockwise",
            "faster": "right",
            "slower": "left",
        }
    return {"side": "right", "clock": "clockwise", "faster": "left", "slower": "right"}


def _disturbances(file: SetFile) -> dict[str, float]:
    """The size of each disturbance, 0 if there is none; lengths in the shown unit."""
    robot = file.robot
    own: dict[str, float] = {"sensor_noise": 0.0, **file.disturbances.model_dump()}
    if isinstance(robot, EPuckRobotParams):
        own |= robot.errors
    # The size for a step of dt, under a name that is true for it.
    return {**own, "slip": file.slip}


def _scan(file: SetFile) -> dict[str, Any]:
    """The rays of a robot on maps; `file` is in px."""
    robot = file.robot
    assert isinstance(robot, RobotParams)
    ahead, aside = (file.per_unit * each for each in robot.scanner_offset or (0, 0))
    scanner = {"ahead": ahead, "aside": abs(aside), "side": _side(aside)}
    return {"fan": _fan(robot), "scanner": scanner if robot.scanner_offset else None}


def _fan(robot: RobotParams) -> dict[str, Any] | None:
    """An even fan of rays in degrees; None if the rays are not one."""
    turns = [math.degrees(angle) for angle in robot.angles().tolist()]
    steps = [(b - a + 180) % 360 - 180 for a, b in itertools.pairwise(turns)]
    step = steps[0] if steps else 0.0
    if any(abs(each - step) > 1e-6 for each in steps):
        return None
    return {
        "first": abs(turns[0]),
        "first_side": _side(turns[0]),
        "last": abs(turns[-1]),
        "last_side": _side(turns[-1]),
        "step": abs(step),
        "towards": _side(step),
    }


def _side(aside: float) -> str:
    """The side of a length or an angle that is positive to the right."""
    if abs(aside) < 1e-9:
        return ""
    return "right" if aside > 0 else "left"


def _infrared() -> dict[str, Any]:
    """The sensors of an e-puck, and other numbers of it."""
    return {
        "limits": [],
        "sensors": [
            {
                "name": f"ps{number}",
                "ahead": x,
                "aside": abs(y),
                "side": _side(-y),
                "degrees": abs(math.degrees(azimuth)),
                "towards": _side(-azimuth),
            }
            for number, (x, y, azimuth) in enumerate(PLACES.tolist())
        ],
        "readings": [
            {"distance": distance, "reading": reading, "spread": spread}
            for distance, reading, spread in TABLE.tolist()
        ],
        "rise": math.degrees(ELEVATION),
        "ray_length": RANGE,
        "largest": LARGEST,
        "encoder_step": ENCODER_STEP,
        "joint_distance": JOINT_DISTANCE,
        # Those of `tdac_envs/ladder/generators/plates.py`, m.
        "box_sides": (0.025, 0.07),
        "cylinder_radii": (0.012, 0.035),
    }
