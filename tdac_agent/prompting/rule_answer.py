"""An optimizer's answer about the rules: at most three operations, strictly parsed."""

from __future__ import annotations

import json
import re
from typing import Annotated, Literal, NamedTuple

from pydantic import (
    AfterValidator,
    Field,
    TypeAdapter,
    ValidationError,
)

from tdac_agent.prompting.fences import fenced_blocks
from tdac_agent.prompting.plain_answer import plain_text, without_thinking
from tdac_agent.prompting.rules import (
    MAX_RULE_CHARS,
    RepairRule,
    RuleBook,
    Scope,
    clean,
)
from tdac_envs.core.errors import first_problem
from tdac_envs.core.strict_model import StrictModel

MAX_OPERATIONS = 3
_FOREIGN = re.compile(r"```|~~~|https?://")


def checked_rule(text: str) -> str:
    """The text of a rule in one line.

    Raises:
        ValueError: It is empty or too long, or has a code block or a URL.
    """
    tidy = clean(text)
    if not re.search(r"\w", tidy):
        raise ValueError("a rule needs words")
    if len(tidy) > MAX_RULE_CHARS:
        raise ValueError(f"{len(tidy)} characters, at most {MAX_RULE_CHARS}")
    if _FOREIGN.search(tidy):
        raise ValueError("a rule must not contain a code block or a URL")
    return tidy


Text = Annotated[str, AfterValidator(checked_rule)]


class Add(StrictModel, strict=True):
    """A new rule."""

    op: Literal["add"]
    scope: Scope
    text: Text


class Edit(StrictModel, strict=True):
    """A new text for a rule in force."""

    op: Literal["edit"]
    id: str
    text: Text


class Drop(StrictModel, strict=True):
    """Permanent removal of a rule in force."""

    op: Literal["drop"]
    id: str
    reason: str = ""


Operation = Annotated[Add | Edit | Drop, Field(discriminator="op")]
_FORM = Annotated[list[Operation], Field(max_length=MAX_OPERATIONS)]
_Operations: TypeAdapter[list[Operation]] = TypeAdapter(_FORM)


class RuleAnswerError(ValueError):
    """An answer cannot be used; the message explains the problem to the model."""


class Applied(NamedTuple):
    """The rules after an answer, and a line about each operation's result."""

    book: RuleBook
    notes: tuple[str, ...]


def parse_operations(reply: str) -> list[Add | Edit | Drop]:
    """Returns the operations in an answer: one fenced JSON block, or only JSON.

    Raises:
        RuleAnswerError: There is no such block, or its contents are invalid.
    """
    reply = without_thinking(plain_text(reply)) or ""
    blocks = fenced_blocks(reply, frozenset({"json", ""}))
    if not blocks and reply.lstrip().startswith("["):
        blocks = [reply]
    if len(blocks) != 1:
        count = f"{len(blocks)} blocks" if blocks else "no block"
        raise RuleAnswerError(f"expected one fenced ```json block, got {count}")
    try:
        return _Operations.validate_python(json.loads(blocks[0]))
    except ValidationError as error:
        raise RuleAnswerError(first_problem(error, _FORM)) from error
    except (ValueError, RecursionError) as error:
        reason = str(error).partition("\n")[0]
        raise RuleAnswerError(f"the block is not JSON: {reason}") from error


def apply(
    book: RuleBook,
    operations: list[Add | Edit | Drop],
    k: int,
    evidence: tuple[str, ...],
) -> Applied:
    """Applies operations to the rules; an impossible operation changes nothing.

    Args:
        book: The rules before.
        operations: The operations.
        k: Iteration.
        evidence: Failed tests.
    """
    notes = []
    for operation in operations:
        if isinstance(operation, Add):
            book, note = _add(book, operation, k, evidence)
        elif isinstance(operation, Edit):
            book, note = _edit(book, operation, k)
        else:
            book, note = _drop(book, operation, k)
        notes.append(note)
    return Applied(book.bounded(k), tuple(notes))


def _add(
    book: RuleBook, wanted: Add, k: int, evidence: tuple[str, ...]
) -> tuple[RuleBook, str]:
    double = book.double_of(wanted.text)
    if double is not None:
        return book, f"not added: {_repeats(double)}"
    book = book.add(wanted.text, wanted.scope, k, evidence)
    return book, f"added {book.rules[-1].id}: {wanted.text}"


def _edit(book: RuleBook, wanted: Edit, k: int) -> tuple[RuleBook, str]:
    rule, double = book.get(wanted.id), book.double_of(wanted.text, but=wanted.id)
    if rule is None:
        return book, f"not edited: no rule {wanted.id} in force"
    if double is not None:
        return book, f"not edited: {_repeats(double)}"
    edits = (*rule.edits, f"k={k}: was {rule.text!r}")
    counters = {"tried": 0, "cured": 0, "passes": (), "worse": 0}
    book = book.change(rule.id, text=wanted.text, edits=edits, **counters)
    return book, f"edited {rule.id}: {wanted.text}"


def _drop(book: RuleBook, wanted: Drop, k: int) -> tuple[RuleBook, str]:
    rule = book.get(wanted.id)
    if rule is None:
        return book, f"not dropped: no rule {wanted.id} in force"
    reason = clean(wanted.reason)[:MAX_RULE_CHARS]
    book = book.change(rule.id, status="dropped", ended=k, reason=reason)
    return book, f"dropped {rule.id}: {reason or 'no reason given'}"


def _repeats(rule: RepairRule) -> str:
    ended = "" if rule.in_force else f", which was ended in k={rule.ended}"
    return f"it repeats {rule.id}{ended}"
