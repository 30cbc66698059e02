"""The provider `builtin`: no language model, a template tuned by what failed."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Generic

from tdac_agent.builtin.parameters import (
    EPuckParameters,
    P,
    Parameters,
    read_parameters,
)
from tdac_agent.builtin.repair import (
    learn_bounds,
    read_rules,
    repair,
    write_rules,
)
from tdac_agent.builtin.templates import render_controller, render_epuck
from tdac_agent.models.provider import Provider, Reply, Request
from tdac_agent.tasks.setting import Setting

__all__ = [
    "Builtin",
    "EPuckParameters",
    "Parameters",
    "builtin_for",
    "read_parameters",
    "render_controller",
    "render_epuck",
]


def builtin_for(setting: Setting) -> Provider:
    """The provider for a task's setting."""
    if setting.suite == "epuck":
        from tdac_agent.environments.epuck.task import EPuckSetting

        assert isinstance(setting, EPuckSetting)
        return Builtin(EPuckParameters, partial(render_epuck, task=setting.nominal))
    from tdac_agent.environments.map2d.task import map_setting

    own = map_setting(setting)
    robot, dt = own.params.robot, own.nominal.dt
    return Builtin(Parameters, partial(render_controller, robot=robot, dt=dt))


class Builtin(Generic[P]):
    """Learner and optimizer that fill in and tune a parametrised controller.

    It sees what a model sees: the question, the rules, the controller and the
    report. Everything it learns passes through the rules.

    Args:
        kind: Of the parameters; its defaults are the first values.
        render: Source of the controller with some parameters.
    """

    name = "builtin"
    paid = False

    def __init__(self, kind: type[P], render: Callable[[P], str]) -> None:
        self.kind = kind
        self.render = render

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        if request.kind == "generate":
            parameters, _ = read_rules(request.rules, self.kind)
            return Reply(self._file(parameters), notes=(_describe(parameters),))
        if request.report is None:
            raise ValueError(f"a request to {request.kind} needs a report")
        remembered, bounds = read_rules(request.rules, self.kind)
        known = read_parameters(request.controller or "", self.kind)
        failed = remembered if known is None else known
        bounds = learn_bounds(bounds, failed, request.report)
        _, k, j = request.sample
        parameters, changes = repair(failed, request.report, bounds, 100 * k + j)
        notes = [str(change) for change in changes]
        if known is None:
            notes.insert(0, "the controller is not from the template: replaced by it")
        if not changes:
            notes.append("no parameter answers these failures")
        if request.kind == "summarise":
            rules = write_rules(parameters, changes, bounds, k)
            return Reply(_operations(rules), notes=tuple(notes))
        return Reply(self._file(parameters), notes=tuple(notes))

    def _file(self, parameters: P) -> str:
        return f"```python\n{self.render(parameters)}```\n"


def _operations(rules: list[str]) -> str:
    """The answer of an optimizer that adds rules for this task."""
    operations = [{"op": "add", "scope": "task", "text": rule} for rule in rules]
    return f"```json\n{json.dumps(operations, indent=1)}\n```\n"


def _describe(parameters: P) -> str:
    neutral = parameters == type(parameters)()
    return "neutral parameters" if neutral else f"{parameters}"
