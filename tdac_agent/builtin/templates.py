"""The templates, filled in: a controller for a map, and one for the e-puck."""

from __future__ import annotations

from dataclasses import fields
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import jinja2

from tdac_agent.builtin.parameters import EPuckParameters, Parameters, Tuned
from tdac_agent.verification.suite.contract import time_step
from tdac_envs.mapping.params import RobotParams

if TYPE_CHECKING:
    from tdac_envs.epuck.task import EPuckTask


def render_controller(parameters: Parameters, robot: RobotParams, dt: float) -> str:
    """Source of the controller for a map with these parameters.

    Args:
        parameters: Values of the tuning constants.
        robot: Values of the robot's constants.
        dt: Duration of a step, s.
    """
    return _render("controller_map2d.py.j2", parameters, robot=robot, dt=dt)


def render_epuck(parameters: EPuckParameters, task: EPuckTask) -> str:
    """Source of the controller for the e-puck with these parameters.

    Args:
        parameters: Values of the tuning constants.
        task: Gives wheel limit, clock and tolerance.
    """
    return _render(
        "controller_epuck.py.j2",
        parameters,
        time_step=time_step(task.dt),
        max_wheel_speed=task.max_wheel_speed,
        goal_tolerance=task.goal_tolerance,
    )


def _render(template: str, parameters: Tuned, **context: Any) -> str:
    text = files("tdac_agent.builtin").joinpath(template).read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, keep_trailing_newline=True
    )
    tuning = [
        {
            "constant": item.name.upper(),
            "value": float(getattr(parameters, item.name)),
            "meaning": ", ".join(
                part
                for part in (item.metadata["unit"], item.metadata["meaning"])
                if part
            ),
        }
        for item in fields(parameters)
    ]
    return str(environment.from_string(text).render(fields=tuning, **context))
