"""The question for a controller for a task set: its level, and nothing of a world."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

from tdac_agent.prompting.prompt import PromptError, PromptTemplate, fill_in
from tdac_agent.prompting.rules import RepairRule
from tdac_agent.sandbox import Limits
from tdac_agent.verification.judge.set_job import level_params
from tdac_agent.verification.suite.contract import ALLOWED_IMPORTS
from tdac_agent.verification.suite.hygiene import (
    FORBIDDEN_ATTRIBUTES,
    FORBIDDEN_CALLS,
    SAVERS,
    SURFACES,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.task_sets import TaskSet

SET_TEMPLATE = "set"
"""Name of the shipped template, `full` to the user."""
NOT_SUPPLIED = {"__future__", "sensors"}
"""Modules that a controller for a task set does not get, or need not import."""


def set_prompt(
    tasks: TaskSet, rules: tuple[RepairRule, ...], template: PromptTemplate
) -> str:
    """Returns the prompt for a new controller for a task set.

    Args:
        tasks: The task set.
        rules: The rules in force.
        template: The template.

    Raises:
        PromptError: The template is broken, or there is none of this name for sets.
        TaskError: The set's worlds are in files, which are too few.
    """
    if tasks.files is not None:
        raise TaskError(
            f"the worlds of {tasks.name} are in files, and too few to write a "
            "controller with; write it for generated worlds, then `tdac verify --set`"
        )
    if template.text is None:
        if template.name != "full":
            raise PromptError(
                f"the prompt {template.name!r} is for a single task; with --set, give "
                "full or a template file"
            )
        template = PromptTemplate(SET_TEMPLATE)
    return fill_in(template, set_context(tasks), rules)


def set_context(tasks: TaskSet) -> dict[str, Any]:
    """Returns the template variables of a task set."""
    file, limits = tasks.file, Limits()
    return {
        "name": tasks.name,
        "file": file,
        "robot": file.robot,
        "full_step": file.full_step,
        "turn": 2.0 * file.full_step / file.robot.axle_length,
        "observation_rows": list(_rows(file)),
        "ray_step": file.robot.field_of_view_deg / max(1, file.robot.n_rays - 1),
        "disturbances": list(_disturbances(file)),
        "side": file.largest_side,
        "params_text": json.dumps(level_params(file), indent=2),
        "allowed_imports": " ".join(sorted(ALLOWED_IMPORTS - NOT_SUPPLIED)),
        "forbidden_calls": ", ".join(sorted(FORBIDDEN_CALLS)),
        "forbidden_attributes": ", ".join(sorted(FORBIDDEN_ATTRIBUTES)),
        "savers": ", ".join(sorted(SAVERS)),
        "surfaces": ", ".join(sorted(SURFACES)),
        "memory": f"{limits.memory_bytes >> 30}",
        "wall_seconds": f"{limits.call_seconds:g}",
        "instructions": "",
    }


def _rows(file: SetFile) -> Iterator[str]:
    """Yields the rows of the table of observations."""
    robot, side = file.robot, file.largest_side
    far = math.ceil(math.hypot(side, side))
    place = f"-{far} to {far}" if file.frame == "start" else f"-0.5 to {side - 0.5:g}"
    frame = "start frame" if file.frame == "start" else "frame of the map"
    odometry = "measured arc length (negative backwards) and turn of the last step"
    rows = {
        "pose": (
            "(3,)",
            f"{place}; heading in (-pi, pi]",
            "px, px, rad",
            f"x, y, heading of the robot in the {frame}; exact",
        ),
        "goal": (
            "(2,)",
            place,
            "px",
            f"x, y of the goal in the {frame}; constant in an episode, exact",
        ),
        "wheel_speeds": (
            "(2,)",
            "-1 to 1",
            "fraction",
            "command of the left and right wheel in the last step"
            + (", after the delay" if file.disturbances.delay else ""),
        ),
        "ranges": (
            f"({robot.n_rays},)",
            f"0 to {robot.range_max:g}",
            "px",
            "distance from the robot's centre to the first obstacle along each ray",
        ),
        "odometry": ("(2,)", "small", "px, rad", f"{odometry}; (0, 0) at the start"),
    }
    for key in sorted(file.observed):
        yield f"| `{key}` | {' | '.join(rows[key])} |"


def _disturbances(file: SetFile) -> Iterator[str]:
    """Yields a line for each disturbance of the set: its distribution and size."""
    own = file.disturbances
    if own.wheel_gains:
        low, high = 1.0 - own.wheel_gains, 1.0 + own.wheel_gains
        yield (
            "Hidden wheel gains: each wheel turns at the command times "
            f"a gain of their own, each uniform in [{low:g}, {high:g}], drawn anew for "
            "each episode and constant in it; never faster than max_wheel_speed."
        )
    if own.axle_error:
        yield (
            "Hidden axle length: axle_length times 1 + e, e uniform within "
            f"±{own.axle_error:g}, constant in an episode."
        )
    if own.wheel_slip:
        yield (
            "Slip: in each step, the speed of each wheel over ground is multiplied by "
            f"a normal number with mean 1 and SD {file.slip:.3g}; again never faster "
            "than max_wheel_speed."
        )
    if own.motor_lag:
        yield (
            f"Lag: wheel speeds follow the commands with a time constant of "
            f"{own.motor_lag:g} s."
        )
    if own.delay:
        steps = "1 step" if own.delay == 1 else f"{own.delay} steps"
        yield (
            f"Delay: an action takes effect {steps} late; until the first one does, "
            "the wheels stand still."
        )
    if own.range_noise:
        yield (
            "Noise of the ranges: each ray in each step times a normal number with "
            f"mean 1 and SD {own.range_noise:g}, limited to [0, range_max]."
        )
    if own.range_dropout:
        yield (
            f"Dropouts: each ray reads range_max with probability "
            f"{own.range_dropout:g} in each step."
        )
    if own.odometry_scale:
        yield (
            "Scale errors of the odometry: distance and turn are each multiplied by "
            f"1 + e, e normal with SD {own.odometry_scale:g}, one for distance and one "
            "for turn, drawn for each episode and constant in it."
        )
    if own.odometry_noise:
        yield (
            "Noise of the odometry: distance and turn of each step are each multiplied "
            f"by a normal number with mean 1 and SD {own.odometry_noise:g}."
        )
