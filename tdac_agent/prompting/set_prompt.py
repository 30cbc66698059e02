"""The question for a controller for a task set: its level, and nothing of a world."""

from __future__ import annotations

import math
from typing import Any

from tdac_agent.prompting.context import allowed_code
from tdac_agent.prompting.fact_context import fact_context
from tdac_agent.prompting.facts import FACTS, FactsPrompt, facts_prompt
from tdac_agent.prompting.params_text import params_text
from tdac_agent.prompting.prompt import FULL, PromptTemplate, fill_in
from tdac_agent.prompting.robot_lines import robot_lines
from tdac_agent.prompting.rules import RepairRule
from tdac_agent.prompting.set_observations import (
    disturbance_lines,
    observation_rows,
)
from tdac_agent.sandbox import Limits
from tdac_agent.verification.judge.set_files import level_params
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.infrared import PLACES, TABLE
from tdac_envs.ladder.generators.plates import Plates
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.shown import in_shown_units
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.mapping.params import RobotParams

SET_TEMPLATE = "set"
"""Name of the shipped template, `full` to the user."""
FACTS_TEMPLATE = "set_facts"
"""Name of the template that is made of facts."""


def set_prompt(
    tasks: TaskSet, rules: tuple[RepairRule, ...], template: PromptTemplate
) -> str:
    """Returns the prompt for a new controller for a task set.

    Args:
        tasks: The task set.
        rules: The rules in force.
        template: The template.

    Raises:
        PromptError: The template is broken.
        TaskError: The template omits an unknown fact.
    """
    context = set_context(tasks)
    if template.text is not None:
        return fill_in(template, context, rules)
    if template.name == FULL.name:
        return fill_in(PromptTemplate(SET_TEMPLATE), context, rules)
    facts = facts_prompt(template.name) or FactsPrompt("facts", FACTS)
    context |= fact_context(tasks, facts)
    return fill_in(PromptTemplate(FACTS_TEMPLATE), context, rules)


def check_generated(tasks: TaskSet) -> None:
    """Checks that a set has enough worlds to try controllers on while they are written.

    Raises:
        TaskError: Its worlds are in files, which are too few.
    """
    if tasks.files is not None:
        raise TaskError(
            f"the worlds of {tasks.name} are in files, and too few to write a "
            "controller with; write it for generated worlds, or with the prompt that "
            "`tdac synth --set NAME --dry-run` prints, then `tdac verify --set`"
        )


def set_context(tasks: TaskSet) -> dict[str, Any]:
    """Returns the template variables of a task set."""
    file, limits = in_shown_units(tasks.file), Limits()
    return {
        "name": tasks.name,
        "file": file,
        "epuck": file.is_epuck,
        "found": tasks.files is not None,
        **_robot(tasks, file),
        "unit": file.shown_unit,
        "full_step": file.full_step,
        "observation_rows": list(observation_rows(tasks)),
        "disturbances": list(disturbance_lines(file)),
        "params_text": params_text(level_params(tasks.file)),
        **allowed_code({"__future__", "sensors"}),
        "memory": f"{limits.memory_bytes >> 30}",
        "wall_seconds": f"{limits.call_seconds:g}",
        "instructions": "",
    }


def _robot(tasks: TaskSet, file: SetFile) -> dict[str, Any]:
    """Variables of the robot and its worlds; `file` is in the shown units."""
    robot, own = file.robot, tasks.file.robot
    if not isinstance(robot, EPuckRobotParams):
        assert isinstance(own, RobotParams)
        return {
            "robot": robot,
            "turn": 2.0 * file.full_step / robot.axle_length,
            "rays": _rays(robot),
            "side": tasks.largest_side * file.per_unit,
            "limits": robot_lines(own, file.units),
        }
    floors = [each for each in file.worlds if isinstance(each, Plates)]
    table = TABLE.tolist()
    return {
        "robot": robot,
        "sizes": robot.sizes,
        "turn": 2.0 * file.full_step / robot.sizes["axle_length"],
        "sides": _band(*(each.sides for each in floors)),
        "passages": _band(*(each.passages for each in floors)),
        "places": ", ".join(
            f"ps{k} ({x:g}, {y:g}) {azimuth:g}"
            for k, (x, y, azimuth) in enumerate(PLACES.tolist())
        ),
        "readings": ", ".join(f"{1e3 * row[0]:g}: {row[1]:g}" for row in table),
        "nothing": f"{table[-1][1]:g}",
    }


def _rays(robot: RobotParams) -> str:
    """Formats where the rays of a robot point, and in which order they are."""
    turns = [math.degrees(angle) for angle in robot.angles().tolist()]
    if robot.ray_angles is not None:
        return "; `ranges` are in this order"
    step = turns[1] - turns[0] if len(turns) > 1 else 0.0
    return (
        f", at {turns[0]:g} + i * {step:.4g} degrees; `ranges[0]` is its leftmost ray, "
        "`ranges[-1]` its\n  rightmost"
    )


def _band(*bands: tuple[float, float]) -> str:
    """The smallest and the largest of some lengths: `0.22 to 0.3`."""
    return f"{min(b[0] for b in bands):g} to {max(b[1] for b in bands):g}"
