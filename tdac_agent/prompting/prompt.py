"""The prompts: what stays the same first, then the repair rules, then what failed.

A prompt begins with everything that no iteration changes, so that a provider can keep
that part in its cache. That reaches up to the marker `AUTO_REPAIR_RULES_BEGIN`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import ImmutableSandboxedEnvironment

from tdac_agent.prompting.context import context_of
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.prompting.rule_answer import MAX_OPERATIONS
from tdac_agent.prompting.rules import MAX_RULE_CHARS, RepairRule, render_block
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs.core.errors import TdacError
from tdac_envs.core.intake import TEXT_BYTES, read_file

VARIANTS = ("full", "underspecified")


class PromptError(TdacError):
    """A prompt template cannot be used."""


@dataclass(frozen=True, slots=True)
class PromptTemplate:
    """The question for a new controller, as a Jinja2 template.

    Attributes:
        name: `full`, `underspecified`, or the file's path.
        text: The template; None for a shipped one.
    """

    name: str = "full"
    text: str | None = None


FULL = PromptTemplate()


def load_template(given: str) -> PromptTemplate:
    """A shipped variant by its name, or a file.

    A file may use all names of `prompt_context` and `{% include %}` the shipped
    templates; it must hold `{{ rules_block }}` once.

    Raises:
        PromptError: There is no such variant or file.
    """
    if given in VARIANTS:
        return PromptTemplate(given)
    try:
        return PromptTemplate(given, read_file(given, TEXT_BYTES).decode("utf-8"))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        known = ", ".join(VARIANTS)
        raise PromptError(
            f"no prompt {given!r}: {reason}; expected a template file or {known}"
        ) from error


@functools.cache
def _templates(env_id: str | None = None) -> jinja2.Environment:
    """The shipped templates, with those of an environment."""
    folders = [Path(__file__).with_name("templates")]
    if env_id is not None:
        folders.append(environment(env_id).folder / "prompts")
    # A template of the user's own is text to be filled in, and no program.
    return ImmutableSandboxedEnvironment(
        loader=jinja2.FileSystemLoader(folders),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def generate_prompt(
    task: Task, rules: tuple[RepairRule, ...], template: PromptTemplate = FULL
) -> str:
    """The question for a new controller (Listings 1 and 2, for `policy(obs)`).

    Args:
        task: What the controller must do.
        rules: Those in force.
        template: What to fill in.

    Raises:
        PromptError: The template is broken, asks for an unknown name, or has no block
            of rules.
    """
    context = {**context_of(task), "rules_block": render_block(rules)}
    text = _render(template, task.spec.env, context)
    if text.count(context["rules_block"]) != 1:
        raise PromptError(
            f"the prompt {template.name} must hold {{{{ rules_block }}}} once: the "
            "rules that are learnt from failures go there"
        )
    return text


def _render(template: PromptTemplate, env_id: str, context: dict[str, Any]) -> str:
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
            f"the prompt {template.name} includes {error.name!r}, which is not there"
        ) from error
    except jinja2.TemplateSyntaxError as error:
        raise PromptError(
            f"the prompt {template.name}, line {error.lineno}: {error.message}"
        ) from error
    # A template computes: what goes wrong in it may be any error.
    except Exception as error:
        if template.text is None:
            raise
        raise PromptError(f"the prompt {template.name}: {error}") from error


def repair_prompt(
    kind: str,
    prompt: str,
    controller: str,
    report: Report,
    *,
    earlier: tuple[str, ...] = (),
    rules: tuple[RepairRule, ...] = (),
    unchanged: bool = False,
) -> str:
    """The question to `edit` a controller, or to `summarise` its failures as rules.

    Args:
        kind: Which of the two.
        prompt: The question that it answered, rules of today.
        controller: Its source.
        report: What failed.
        earlier: The attempts before this one, a line each.
        rules: Those in force, with what came of them.
        unchanged: Whether the last edit gave the same code again.
    """
    return (
        _templates()
        .get_template(f"{kind}.md.j2")
        .render(
            prompt=prompt,
            controller=controller.rstrip(),
            feedback=render_feedback(report),
            earlier=earlier,
            rules=rules,
            unchanged=unchanged,
            most_operations=MAX_OPERATIONS,
            longest_rule=MAX_RULE_CHARS,
        )
    )
