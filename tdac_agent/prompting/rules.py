"""AUTO_REPAIR_RULES: rules in the prompt, learned from earlier failures.

A rule records the failures it was made for, and the results of the controllers that
were written while it was in force. Dropped rules are kept so that they do not return.
"""

from __future__ import annotations

import re
import unicodedata
from typing import Literal

from pydantic import Field

from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.storage.printable_record import StrictRecord

BEGIN, END = "AUTO_REPAIR_RULES_BEGIN", "AUTO_REPAIR_RULES_END"
_MARKER = re.compile(f"{BEGIN}|{END}")
MAX_RULE_CHARS = 200
MAX_RULE_TOKENS = 800
"""Estimated tokens of all rules in force together."""
SIMILAR = 0.8
"""Fraction of common words (Jaccard) at which two texts are the same rule."""

Scope = Literal["task", "environment", "code"]
Status = Literal["in force", "dropped", "made room"]


class RepairRule(StrictRecord):
    """A rule and its history."""

    id: str = Field(
        pattern=r"^R[0-9]{1,9}$",
        description="`R1`, `R2` ..., never used twice in a run.",
    )
    text: str = Field(max_length=MAX_RULE_CHARS)
    scope: Scope = Field("task", description="Where the rule applies.")
    born: int = Field(description="Iteration k that added it; 0 if it was given.")
    evidence: tuple[str, ...] = Field(
        description="Failed tests it was made for; none if it was given."
    )
    edits: tuple[str, ...] = Field((), description="`k=3: was ...`, oldest first.")
    tried: int = Field(0, description="First candidates written under it.")
    cured: int = Field(0, description="Of these, how many passed all its evidence.")
    passes: tuple[int, ...] = Field(
        (), description="How often they passed each test of its evidence, in order."
    )
    worse: int = Field(0, description="How many failed more tests than before it.")
    status: Status = "in force"
    ended: int | None = Field(None, description="Iteration k that ended it.")
    reason: str = Field("", description="Why it ended.")

    @property
    def effect_text(self) -> str:
        """The effect of the rule in words, for people and models."""
        if not self.tried:
            return "not tried yet"
        if not self.evidence:
            tries = f"{self.tried} {'try' if self.tried == 1 else 'tries'}"
            return f"given; more tests failed than before in {self.worse} of {tries}"
        passes = self.passes_each
        always = sum(count == self.tried for count in passes)
        sometimes = sum(0 < count < self.tried for count in passes)
        text = f"cured {always} of {len(passes)} test{'s' * (len(passes) != 1)}"
        if self.tried > 1:
            text += f" in each of {self.tried} tries"
        if sometimes:
            text += f", {sometimes} more in some of them"
        if self.worse:
            text += "; more tests failed than before"
            text += f" in {self.worse} of them" if self.tried > 1 else ""
        return text

    @property
    def passes_each(self) -> tuple[int, ...]:
        """How often each test of its evidence passed, in the order of the evidence."""
        if len(self.passes) == len(self.evidence):
            return self.passes
        # A record without `passes` only knows how often all tests passed together.
        return (self.cured,) * len(self.evidence)

    @property
    def benefit(self) -> float:
        """Mean number of passes of its evidence, minus how often more tests failed."""
        return sum(self.passes_each) / max(1, len(self.evidence)) - self.worse

    @property
    def in_force(self) -> bool:
        """Whether it is in the prompt."""
        return self.status == "in force"

    @property
    def rejected(self) -> bool:
        """Whether it must not return: it was dropped, or did more harm than good."""
        return self.status == "dropped" or (not self.in_force and self.benefit < 0)


class RuleBook(StrictRecord):
    """`rules.json`: all rules of a run, including those no longer in force."""

    schema_version: Literal[1] = 1
    rules: tuple[RepairRule, ...] = ()

    @property
    def in_force(self) -> tuple[RepairRule, ...]:
        """The rules in the prompt, oldest first."""
        return tuple(rule for rule in self.rules if rule.in_force)

    def get(self, name: str) -> RepairRule | None:
        """Returns the rule in force with an id, or None."""
        return next((rule for rule in self.in_force if rule.id == name), None)

    def double_of(self, text: str, but: str = "") -> RepairRule | None:
        """Returns a rule in force, or a rejected one, with nearly the same text.

        Args:
            text: Text to compare with.
            but: Id of a rule to ignore.
        """
        same = (
            rule
            for rule in self.rules
            if rule.id != but
            and (rule.in_force or rule.rejected)
            and say_the_same(rule.text, text)
        )
        return next(same, None)

    def add(
        self, text: str, scope: Scope, k: int, evidence: tuple[str, ...]
    ) -> RuleBook:
        """Returns a copy with a new rule; its text must be clean and not a double."""
        number = max((int(rule.id[1:]) for rule in self.rules), default=0) + 1
        new = RepairRule(
            id=f"R{number}", text=text, scope=scope, born=k, evidence=evidence
        )
        return self.model_copy(update={"rules": (*self.rules, new)})

    def change(self, name: str, **fields: object) -> RuleBook:
        """Returns a copy in which fields of one rule are changed."""
        rules = (
            RepairRule.model_validate({**dict(rule), **fields})
            if rule.id == name
            else rule
            for rule in self.rules
        )
        return self.model_copy(update={"rules": tuple(rules)})

    def bounded(self, k: int) -> RuleBook:
        """Returns a copy with as many rules in force as fit.

        The rules of least benefit end first, the oldest of them before others.
        """
        book, newest = self, max((rule.born for rule in self.in_force), default=0)
        while estimate_tokens(render_block(book.in_force)) > MAX_RULE_TOKENS:
            rules = book.in_force
            # The newest rules have not been tried yet.
            old = [rule for rule in rules if rule.born < newest] or rules
            worst = min(old, key=lambda rule: rule.benefit)
            reason = f"{worst.effect_text}; no room for more rules"
            book = book.change(worst.id, status="made room", ended=k, reason=reason)
        return book

    def observed(self, failed: tuple[str, ...], before: int) -> RuleBook:
        """Returns a copy with the result of a first candidate written under the rules.

        Args:
            failed: Tests that the candidate failed.
            before: Number of tests that the last candidate of the previous iteration
                failed.
        """
        book, now = self, set(failed)
        for rule in self.in_force:
            passed = [test not in now for test in rule.evidence]
            each = zip(rule.passes_each, passed, strict=True)
            book = book.change(
                rule.id,
                tried=rule.tried + 1,
                cured=rule.cured + all(passed),
                passes=tuple(count + one for count, one in each),
                worse=rule.worse + (len(now) > before),
            )
        return book


def clean(text: str) -> str:
    """Returns a rule's text in one line, without markers of the block of rules."""
    return " ".join(_MARKER.sub("…", text).split())


def say_the_same(one: str, other: str) -> bool:
    """Whether two texts have nearly the same words, and the same numbers."""
    (words, numbers), (words_2, numbers_2) = _words(one), _words(other)
    if numbers != numbers_2:
        return False
    union = words | words_2
    return not union or len(words & words_2) / len(union) >= SIMILAR


def _words(text: str) -> tuple[set[str], set[str]]:
    """Returns the normalized words and numbers of a text."""
    plain = unicodedata.normalize("NFKC", text).casefold()
    # Numbers determine a rule's meaning, so a decimal point is not punctuation.
    numbers = re.findall(r"\d+(?:\.\d+)?", plain)
    return set(re.findall(r"[^\W\d]+", plain)), set(numbers)


def render_block(rules: tuple[RepairRule, ...]) -> str:
    """Returns the block of the prompt with the rules."""
    lines = [f"- {rule.text} [{rule.id}]" for rule in rules] or ["(none yet)"]
    return "\n".join([f"# === {BEGIN} ===", *lines, f"# === {END} ==="])
