"""What of the template can be tuned, and the way into a controller and back."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field, fields, replace
from importlib.resources import files
from typing import Any

import jinja2

from tdac_envs.params import RobotParams


def _tunable(neutral: float, low: float, high: float, unit: str, meaning: str) -> float:
    """A field with its bounds, as metadata, for the template and the repair table."""
    about = {"low": low, "high": high, "unit": unit, "meaning": meaning}
    value: float = field(default=neutral, metadata=about)
    return value


@dataclass(frozen=True, slots=True)
class Parameters:
    """Constants of the controller; the defaults are the neutral first values."""

    inflation_margin: float = _tunable(
        0.0, 0.0, 12.0, "px", "room wanted beside the body where the map has it"
    )
    lookahead: float = _tunable(
        120.0,
        20.0,
        240.0,
        "px",
        "length of way in which a point to aim at is looked for",
    )
    cruise_speed: float = _tunable(
        1.0, 0.25, 1.0, "", "share of the wheel limit on a free way"
    )
    slow_dist: float = _tunable(
        0.0, 0.0, 80.0, "px", "free length ahead below which it slows down"
    )
    stop_dist: float = _tunable(
        0.0, 0.0, 40.0, "px", "free length ahead below which it lines up before driving"
    )
    turn_gain: float = _tunable(
        0.3, 0.1, 1.0, "", "share of the heading error that a step corrects"
    )
    turn_in_place: float = _tunable(
        0.8, 0.05, 1.2, "rad", "heading error above which it turns in place"
    )
    unstick_after: float = _tunable(
        0.0, 0.0, 400.0, "steps", "without progress until an unstick manoeuvre; 0: none"
    )

    def __post_init__(self) -> None:
        for item in fields(self):
            value, about = getattr(self, item.name), item.metadata
            if not about["low"] <= value <= about["high"]:
                raise ValueError(
                    f"expected {item.name} in [{about['low']:g}, {about['high']:g}], "
                    f"got {value!r}"
                )

    def changed(self, **values: float) -> Parameters:
        """A copy with some values replaced, each moved into its bounds."""
        bounded = {
            item.name: _bounded(values[item.name], item.metadata)
            for item in fields(self)
            if item.name in values
        }
        return replace(self, **bounded)


def _bounded(value: float, about: Any) -> float:
    return round(min(max(value, float(about["low"])), float(about["high"])), 3)


def unit_of(name: str) -> str:
    """Unit of a parameter, empty for a plain number."""
    return next(str(f.metadata["unit"]) for f in fields(Parameters) if f.name == name)


def render_controller(parameters: Parameters, robot: RobotParams, dt: float) -> str:
    """Source of the controller with these parameters.

    Args:
        parameters: Values of the tuning constants.
        robot: Values of the robot's constants.
        dt: Duration of a step, s.
    """
    template = files("tdac_agent.builtin").joinpath("controller_map2d.py.j2")
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
    source = environment.from_string(template.read_text(encoding="utf-8"))
    return str(source.render(robot=robot, dt=dt, fields=tuning))


def read_parameters(source: str) -> Parameters | None:
    """The parameters of a controller made from the template; None of another one."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return None
    names = {item.name.upper(): item.name for item in fields(Parameters)}
    found: dict[str, float] = {}
    for node in tree.body:
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Constant(value=float() | int() as value),
            ) if name in names:
                found[names[name]] = float(value)
    if len(found) < len(names):
        return None
    return Parameters().changed(**found)
