"""AUTO_REPAIR_RULES: what failed before, as rules that stay in the prompt.

A rule is a record: it knows which failures it came from, and what came of the
controllers that were written under it. Rules that were dropped are remembered, so that
they do not come back.
"""

from __future__ import annotations

import re
import unicodedata
from typing import Literal

from pydantic import ConfigDict, Field

from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.storage.printable_record import PrintableRecord

BEGIN, END = "AUTO_REPAIR_RULES_BEGIN", "AUTO_REPAIR_RULES_END"
_MARKER = re.compile(f"{BEGIN}|{END}")
MAX_RULE_CHARS = 200
MAX_RULE_TOKENS = 800
"""Of all rules in force together, estimated."""
SIMILAR = 0.8
"""Share of common words (Jaccard) from which on two texts are the same rule."""

Scope = Literal["task", "environment", "code"]
Status = Literal["in force", "dropped", "made room"]


class _Record(PrintableRecord):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RepairRule(_Record):
    """One rule, and its life."""

    id: str = Field(
        pattern=r"^R[0-9]{1,9}$",
        description="`R1`, `R2` ..., never used twice in a run.",
    )
    text: str = Field(max_length=MAX_RULE_CHARS)
    scope: Scope = Field("task", description="Where it holds.")
    born: int = Field(description="Iteration k that it comes from.")
    evidence: tuple[str, ...] = Field(description="Tests that had failed.")
    edits: tuple[str, ...] = Field((), description="`k=3: was ...`, oldest first.")
    tried: int = Field(0, description="First candidates written under it.")
    cured: int = Field(0, description="Of these, those that passed all its evidence.")
    passes: tuple[int, ...] = Field(
        (), description="How often they passed each test of its evidence, in its order."
    )
    worse: int = Field(0, description="Those that failed more tests than before it.")
    status: Status = "in force"
    ended: int | None = Field(None, description="Iteration k of its end.")
    reason: str = Field("", description="Of its end.")

    @property
    def effect_told(self) -> str:
        """What came of it, for people and models."""
        if not self.tried:
            return "not tried yet"
        passes = self.passes_each
        always = sum(count == self.tried for count in passes)
        now_and_then = sum(0 < count < self.tried for count in passes)
        told = f"cured {always} of {len(passes)} test{'s' * (len(passes) != 1)}"
        if self.tried > 1:
            told += f" in {self.tried} tries"
        if now_and_then:
            told += f", {now_and_then} more in some of them"
        if self.worse:
            told += "; more tests failed than before"
            told += f" in {self.worse} of them" if self.tried > 1 else ""
        return told

    @property
    def passes_each(self) -> tuple[int, ...]:
        """How often each test of its evidence passed, in the order of the evidence."""
        if len(self.passes) == len(self.evidence):
            return self.passes
        # A record that does not tell the tests apart tells how often all of them did.
        return (self.cured,) * len(self.evidence)

    @property
    def benefit(self) -> float:
        """What it did good, tests by their share, less how often it did harm."""
        return sum(self.passes_each) / max(1, len(self.evidence)) - self.worse

    @property
    def in_force(self) -> bool:
        """Whether it stands in the prompt."""
        return self.status == "in force"

    @property
    def rejected(self) -> bool:
        """Whether it may not come back: it was dropped, or did more harm than good."""
        return self.status == "dropped" or (not self.in_force and self.benefit < 0)


class RuleBook(_Record):
    """`rules.json`: all rules of a run, also those that are no longer in force."""

    schema_version: Literal[1] = 1
    rules: tuple[RepairRule, ...] = ()

    @property
    def in_force(self) -> tuple[RepairRule, ...]:
        """Those that stand in the prompt, oldest first."""
        return tuple(rule for rule in self.rules if rule.in_force)

    def get(self, name: str) -> RepairRule | None:
        """The rule in force with an id."""
        return next((rule for rule in self.in_force if rule.id == name), None)

    def double_of(self, text: str, but: str = "") -> RepairRule | None:
        """A rule in force, or a rejected one, that says the same.

        Args:
            text: Of the rule in question.
            but: Id of a rule that does not count.
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
        """With one rule more; the text must be clean and no double."""
        number = max((int(rule.id[1:]) for rule in self.rules), default=0) + 1
        new = RepairRule(
            id=f"R{number}", text=text, scope=scope, born=k, evidence=evidence
        )
        return self.model_copy(update={"rules": (*self.rules, new)})

    def change(self, name: str, **fields: object) -> RuleBook:
        """With other fields of one rule."""
        rules = (
            rule.model_copy(update=fields) if rule.id == name else rule
            for rule in self.rules
        )
        return self.model_copy(update={"rules": tuple(rules)})

    def bounded(self, k: int) -> RuleBook:
        """With as many rules in force as fit: the worst make room, then the oldest."""
        book, newest = self, max((rule.born for rule in self.in_force), default=0)
        while estimate_tokens(render_block(book.in_force)) > MAX_RULE_TOKENS:
            rules = book.in_force
            # What was just learnt has had no chance yet.
            old = [rule for rule in rules if rule.born < newest] or rules
            worst = min(old, key=lambda rule: rule.benefit)
            reason = f"{worst.effect_told}; no room for more rules"
            book = book.change(worst.id, status="made room", ended=k, reason=reason)
        return book

    def observed(self, failed: tuple[str, ...], before: int) -> RuleBook:
        """With what came of a first candidate that was written under these rules.

        Args:
            failed: Tests that it failed.
            before: How many tests the last candidate of the iteration before failed.
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
    """A rule's text on one line, without what would end the block of rules."""
    return " ".join(_MARKER.sub("…", text).split())


def say_the_same(one: str, other: str) -> bool:
    """Whether two texts have nearly the same words, and the same numbers."""
    (words, numbers), (words_2, numbers_2) = _words(one), _words(other)
    if numbers != numbers_2:
        return False
    union = words | words_2
    return not union or len(words & words_2) / len(union) >= SIMILAR


def _words(text: str) -> tuple[set[str], set[str]]:
    """Words and numbers of a text, however they are spelled."""
    plain = unicodedata.normalize("NFKC", text).casefold()
    # Numbers decide what a rule says, so a decimal point is not punctuation.
    numbers = re.findall(r"\d+(?:\.\d+)?", plain)
    return set(re.findall(r"[^\W\d]+", plain)), set(numbers)


def render_block(rules: tuple[RepairRule, ...]) -> str:
    """The block of the prompt that holds the rules."""
    lines = [f"- {rule.text} [{rule.id}]" for rule in rules] or ["(none yet)"]
    return "\n".join([f"# === {BEGIN} ===", *lines, f"# === {END} ==="])
