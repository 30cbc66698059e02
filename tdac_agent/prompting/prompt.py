"""Prompts: first the constant part, then the repair rules, then the failures.

The part before the marker `AUTO_REPAIR_RULES_BEGIN` is the same in all iterations, so
that a provider can cache it.
"""

from __future__ import annotations

import functools
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import ImmutableSandboxedEnvironment

from tdac_agent.prompting.context import context_of
from tdac_agent.prompting.facts import WORDINGS, facts_prompt
from tdac_agent.prompting.rule_answer import MAX_OPERATIONS
from tdac_agent.prompting.rules import MAX_RULE_CHARS, RepairRule, render_block
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.task import Task
from tdac_envs.core.errors import TdacError
from tdac_envs.core.intake import TEXT_BYTES, read_file

VARIANTS = ("full", "underspecified")
ONE_TASK = "this map or world"
"""What the scope `task` of a rule means in a run on one task."""


class PromptError(TdacError):
    """A prompt template cannot be used."""


@dataclass(frozen=True, slots=True)
class PromptTemplate:
    """Jinja2 template of the prompt for a new controller.

    Attributes:
        name: `full`, `underspecified`, a prompt made of facts, or the file's path.
        text: The template; None for a shipped one.
    """

    name: str = "full"
    text: str | None = None


FULL = PromptTemplate()


def is_shipped(name: str) -> bool:
    """Whether a prompt is a shipped variant, or made of facts, and not a file.

    Raises:
        TaskError: It omits an unknown fact.
    """
    return name in VARIANTS or facts_prompt(name) is not None


def load_template(name: str) -> PromptTemplate:
    """Returns a shipped variant by its name, or the template in a file.

    A file may use all variables of `context_of` and `{% include %}` the shipped
    templates; it must contain `{{ rules_block }}` once.

    Raises:
        PromptError: There is no such variant or file.
        TaskError: A prompt made of facts omits an unknown one.
    """
    facts = facts_prompt(name)
    if facts is not None:
        return PromptTemplate(facts.name)
    if name in VARIANTS:
        return PromptTemplate(name)
    try:
        return PromptTemplate(name, read_file(name, TEXT_BYTES).decode("utf-8"))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        known = ", ".join([*VARIANTS, *WORDINGS])
        raise PromptError(
            f"no prompt {name!r}: {reason}; expected a template file or {known}"
        ) from error


@functools.cache
def _templates(env_id: str | None = None) -> jinja2.Environment:
    """Returns the shipped templates, with those of an environment."""
    folders = [Path(__file__).with_name("templates")]
    if env_id is not None:
        folders.append(environment(env_id).folder / "prompts")
    facts = jinja2.FileSystemLoader(Path(__file__).with_name("facts"))
    # A user's template must not be able to run code.
    templates = ImmutableSandboxedEnvironment(
        loader=jinja2.ChoiceLoader(
            [jinja2.FileSystemLoader(folders), jinja2.PrefixLoader({"facts": facts})]
        ),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    templates.filters |= {"g": _figure, "wrapped": _wrapped}
    return templates


def _figure(value: float, digits: int = 6) -> str:
    """A number with so many significant digits."""
    return f"{value:.{digits}g}"


def _wrapped(text: str) -> str:
    """A list whose items begin with `- ` at the start of a line, with other breaks."""
    items = f"\n{text}".split("\n- ")
    lines = [
        textwrap.fill(
            f"- {' '.join(item.split())}",
            96,
            subsequent_indent="  ",
            break_long_words=False,
            break_on_hyphens=False,
        )
        for item in items
        if item.strip()
    ]
    return "\n".join(lines)


def generate_prompt(
    task: Task, rules: tuple[RepairRule, ...], template: PromptTemplate = FULL
) -> str:
    """Returns the prompt for a new controller (Listings 1 and 2 of the paper).

    Args:
        task: The controller's task.
        rules: The rules in force.
        template: The template.

    Raises:
        PromptError: The template is broken, uses an unknown variable, or does not
            contain the rules exactly once, or is for task sets.
        TaskError: The template omits an unknown fact.
    """
    if template.text is None and facts_prompt(template.name) is not None:
        raise PromptError(
            f"the prompt {template.name!r} is for task sets; on a task, give "
            f"{' or '.join(VARIANTS)}, or a template file"
        )
    return fill_in(template, context_of(task), rules, task.spec.env)


def fill_in(
    template: PromptTemplate,
    context: dict[str, Any],
    rules: tuple[RepairRule, ...],
    env_id: str | None = None,
) -> str:
    """Returns a prompt for a new controller.

    Args:
        template: The template.
        context: Its variables.
        rules: The rules in force.
        env_id: The environment whose templates it may include, too.

    Raises:
        PromptError: As `generate_prompt` does.
    """
    context = {**context, "rules_block": render_block(rules)}
    text = _render(template, env_id, context)
    if text.count(context["rules_block"]) != 1:
        raise PromptError(
            f"the prompt {template.name} must contain {{{{ rules_block }}}} once: the "
            "repair rules are inserted there"
        )
    return text


def _render(
    template: PromptTemplate, env_id: str | None, context: dict[str, Any]
) -> str:
    templates = _templates(env_id)
    try:
        if template.text is not None:
            return templates.from_string(template.text).render(context)
        return templates.get_template(f"{template.name}.md.j2").render(context)
    except jinja2.UndefinedError as error:
        known = ", ".join(sorted(context))
        raise PromptError(
            f"the prompt {template.name}: {error.message}; known names: {known}"
        ) from error
    except jinja2.TemplateNotFound as error:
        raise PromptError(
            f"the prompt {template.name} includes {error.name!r}, which does not exist"
        ) from error
    except jinja2.TemplateSyntaxError as error:
        raise PromptError(
            f"the prompt {template.name}, line {error.lineno}: {error.message}"
        ) from error
    # Expressions in a template may raise any error.
    except Exception as error:
        if template.text is None:
            raise
        raise PromptError(f"the prompt {template.name}: {error}") from error


def informed_question(prompt: str, known: str, count: int) -> str:
    """Returns the prompt for a new controller, with what earlier ones have shown.

    Args:
        prompt: The prompt for a new controller, with the current rules.
        known: What they have shown.
        count: Their number.
    """
    template = _templates().get_template("informed.md.j2")
    return template.render(prompt=prompt.rstrip(), known=known, count=count)


def repair_question(
    kind: str,
    prompt: str,
    controller: str,
    feedback: str,
    *,
    earlier: tuple[str, ...] = (),
    rules: tuple[RepairRule, ...] = (),
    unchanged: bool = False,
    scope: str = ONE_TASK,
    aim: str = "",
) -> str:
    """Returns the prompt to edit a controller, to improve it, or to learn rules.

    Args:
        kind: `edit`, `summarise` or `improve`.
        prompt: The prompt for a new controller, with the current rules.
        controller: Source of the failed controller, or of the one to improve.
        feedback: How it failed, or how it drives.
        earlier: Earlier attempts, one line each.
        rules: The rules in force, with their effects.
        unchanged: Whether the last edit returned the same code.
        scope: What the scope `task` of a rule means.
        aim: What an improved controller shall do better.
    """
    return (
        _templates()
        .get_template(f"{kind}.md.j2")
        .render(
            prompt=prompt,
            controller=controller.rstrip(),
            feedback=feedback,
            earlier=earlier,
            rules=rules,
            unchanged=unchanged,
            scope=scope,
            aim=aim,
            most_operations=MAX_OPERATIONS,
            longest_rule=MAX_RULE_CHARS,
        )
    )
