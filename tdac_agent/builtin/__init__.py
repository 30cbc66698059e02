"""The provider `builtin`: no language model, a template tuned by what failed."""

from __future__ import annotations

from tdac_agent.builtin.parameters import (
    Parameters,
    read_parameters,
    render_controller,
)
from tdac_agent.builtin.repair import (
    learn_bounds,
    read_rules,
    repair,
    write_rules,
)
from tdac_agent.provider import Reply, Request
from tdac_envs.params import MapParams
from tdac_envs.task2d import Map2DTask

__all__ = ["Builtin", "Parameters", "read_parameters", "render_controller"]


class Builtin:
    """Learner and optimizer that fill in and tune a parametrised controller.

    It sees what a model sees: the question, the rules, the controller and the
    report. Everything it learns passes through the rules.

    Args:
        task: Gives the duration of a step.
        params: The map's `params.json`; gives the robot.
    """

    name = "builtin"
    paid = False

    def __init__(self, task: Map2DTask, params: MapParams) -> None:
        self.dt = task.dt
        self.robot = params.robot

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        if request.kind == "generate":
            parameters, _ = read_rules(request.rules)
            return Reply(self._file(parameters), notes=(_describe(parameters),))
        if request.report is None:
            raise ValueError(f"a request to {request.kind} needs a report")
        remembered, bounds = read_rules(request.rules)
        known = read_parameters(request.controller or "")
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
            return Reply("\n".join(f"- {rule}" for rule in rules), notes=tuple(notes))
        return Reply(self._file(parameters), notes=tuple(notes))

    def _file(self, parameters: Parameters) -> str:
        source = render_controller(parameters, self.robot, self.dt)
        return f"```python\n{source}```\n"


def _describe(parameters: Parameters) -> str:
    neutral = Parameters()
    return "neutral parameters" if parameters == neutral else f"{parameters}"
