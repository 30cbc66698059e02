"""Provider `builtin`: tunes a template after failures, without a language model."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Generic

from tdac_agent.builtin.repair import learn_bounds, read_rules, repair, write_rules
from tdac_agent.builtin.template import P, Template, read_parameters
from tdac_agent.builtin.variation import varied, varied_parameters
from tdac_agent.errors import ProviderError
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import Reply, Request
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Setting

if TYPE_CHECKING:
    from tdac_agent.builtin.level import LevelController


def make_builtin(words: str, options: Options) -> Builtin[Any] | LevelController:
    """Returns the provider for a task or for a task set.

    Raises:
        ProviderError: `words` is not empty.
    """
    if words:
        raise ProviderError(f"'builtin' takes no model name; got 'builtin:{words}'")
    assert options.setting is not None
    if isinstance(options.setting, Setting):
        return Builtin(template_of(options.setting))
    # Task sets need much that a task does not.
    from tdac_agent.builtin.level import LevelController

    return LevelController(options.setting)


def template_of(setting: Setting) -> Template[Any]:
    """Returns the controller template for a task's setting."""
    return environment(setting.nominal.env_id).template(setting)


class Builtin(Generic[P]):
    """Learner and optimizer that tune the parameters of a controller template.

    Like a model, it sees only the prompt, the rules, the controller and the report.
    Between iterations, only the rules carry what it has learned.

    Args:
        template: The controller template.
    """

    name = "builtin"
    paid = False

    def __init__(self, template: Template[P]) -> None:
        self.template = template

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        if request.kind == "generate":
            parameters, _ = read_rules(request.rules, self.template.kind)
            return Reply(self._file(parameters), notes=(_describe(parameters),))
        if request.kind == "improve":
            return self._varied(request)
        if request.report is None:
            raise ValueError(f"a request to {request.kind} needs a report")
        remembered, bounds = read_rules(request.rules, self.template.kind)
        known = read_parameters(request.controller or "", self.template.kind)
        failed = remembered if known is None else known
        bounds = learn_bounds(bounds, failed, request.report)
        _, k, j = request.sample
        parameters, changes = repair(failed, request.report, bounds, 100 * k + j)
        notes = [str(change) for change in changes]
        if known is None:
            notes.insert(0, "replaced the controller: it is not from the template")
        if not changes:
            notes.append("no parameter addresses these failures")
        if request.kind == "summarise":
            rules = write_rules(parameters, changes, bounds, k)
            return Reply(_operations(rules), notes=tuple(notes))
        return Reply(self._file(parameters), notes=tuple(notes))

    def _varied(self, request: Request) -> Reply:
        """Another controller near one that works."""
        source = request.controller or ""
        known = read_parameters(source, self.template.kind)
        if known is None:  # it is not from the template
            changed, notes = varied(source, request.sample)
            return Reply(f"```python\n{changed}```\n", notes=notes)
        parameters, notes = varied_parameters(known, request.sample)
        return Reply(self._file(parameters), notes=notes)

    def _file(self, parameters: P) -> str:
        return f"```python\n{self.template.render(parameters)}```\n"


def _operations(rules: list[str]) -> str:
    operations = [{"op": "add", "scope": "task", "text": rule} for rule in rules]
    return f"```json\n{json.dumps(operations, indent=1)}\n```\n"


def _describe(parameters: P) -> str:
    neutral = parameters == type(parameters)()
    return "neutral parameters" if neutral else f"{parameters}"
