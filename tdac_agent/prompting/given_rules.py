"""Rules that a run is given: learnt in earlier runs, or written by a person.

A rules file is Markdown in which each line `- [scope] text` is a rule; everything else
is for people. Without a scope, the rule is about the environment.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from pathlib import Path
from typing import get_args

from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.prompting.prompt import PromptError
from tdac_agent.prompting.rule_answer import checked_rule
from tdac_agent.prompting.rules import (
    MAX_RULE_TOKENS,
    RepairRule,
    RuleBook,
    Scope,
    render_block,
    say_the_same,
)
from tdac_envs.core.intake import TEXT_BYTES, read_file

RUN_HEADING = "What this run was given."
GIVEN = 0
"""The iteration in which given rules were born."""
SHARED: tuple[Scope, ...] = ("environment", "code")
"""Scopes of rules that can help on another task."""
_RULE = re.compile(rf"^- (?:\[({'|'.join(get_args(Scope))})\] )?(\S.*)$")


def read_given(file: Path) -> RuleBook:
    """The rules in a file, as the rules that a run begins with.

    Raises:
        PromptError: The file cannot be read, has no rule, a rule that is not allowed,
            or too many.
    """
    try:
        text = read_file(file, TEXT_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise PromptError(f"cannot read the rules in {file}: {reason}") from error
    book = RuleBook()
    for number, line in enumerate(text.splitlines(), 1):
        try:
            book = _with(book, line)
        except ValueError as error:
            raise PromptError(f"{file}, line {number}: {error}") from error
    if not book.rules:
        raise PromptError(f"{file} has no rule: expected lines such as `- [code] ...`")
    tokens = estimate_tokens(render_block(book.in_force))
    if tokens > MAX_RULE_TOKENS:
        raise PromptError(
            f"the {len(book.rules)} rules in {file} take about {tokens} tokens of the "
            f"prompt, at most {MAX_RULE_TOKENS}: leave some out"
        )
    return book


def given_book(lines: Iterable[str]) -> RuleBook:
    """The rules that a run began with, from `given_lines`.

    Raises:
        ValueError: A line is not allowed.
    """
    return functools.reduce(_with, (f"- {line}" for line in lines), RuleBook())


def given_lines(book: RuleBook) -> tuple[str, ...]:
    """The rules of a book, each with its scope."""
    return tuple(f"[{rule.scope}] {rule.text}" for rule in book.rules)


def _with(book: RuleBook, line: str) -> RuleBook:
    """The book with the rule of a line, if it is a new one.

    Raises:
        ValueError: The rule is not allowed.
    """
    match = _RULE.match(line.rstrip())
    if match is None:
        return book
    rule, scope = checked_rule(match[2]), match[1] or "environment"
    if book.double_of(rule) is not None:
        return book
    return book.add(rule, scope, GIVEN, ())  # type: ignore[arg-type]


def shared_rules(books: Iterable[RuleBook]) -> list[RepairRule]:
    """The rules in force that can help on another task, without doubles.

    Those that made more tests fail than they cured are left out. The most useful ones
    come first, and as many are kept as a run can be given.
    """
    rules = [
        rule
        for book in books
        for rule in book.in_force
        if rule.scope in SHARED and rule.benefit >= 0
    ]
    kept: list[RepairRule] = []
    for rule in sorted(rules, key=lambda each: -each.benefit):
        block = render_block((*kept, rule))
        new = not any(say_the_same(rule.text, other.text) for other in kept)
        if new and estimate_tokens(block) <= MAX_RULE_TOKENS:
            kept.append(rule)
    return kept


def written(rules: Iterable[RepairRule], heading: str) -> str:
    """The text of a rules file.

    Args:
        rules: The rules.
        heading: A line on where they come from.
    """
    lines = [f"- {line}" for line in given_lines(RuleBook(rules=tuple(rules)))]
    return "\n".join(["# Rules", "", heading, "", *lines, ""])
