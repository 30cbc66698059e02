"""AUTO_REPAIR_RULES: what failed before, as rules that stay in the prompt."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

BEGIN, END = "AUTO_REPAIR_RULES_BEGIN", "AUTO_REPAIR_RULES_END"
_MARKER = re.compile(f"{BEGIN}|{END}")
MAX_RULES = 24
MAX_RULE_CHARS = 200


@dataclass(frozen=True, slots=True)
class RepairRule:
    """One rule.

    Attributes:
        id: `R1`, `R2` …, never used twice in a run.
        text: At most 200 characters.
        born: Iteration k that it comes from.
        evidence: Tests that had failed.
    """

    id: str
    text: str
    born: int
    evidence: tuple[str, ...]


def add_rules(
    rules: tuple[RepairRule, ...], texts: list[str], k: int, evidence: tuple[str, ...]
) -> tuple[RepairRule, ...]:
    """The rules with new ones added: no doubles, and the oldest make room.

    Args:
        rules: Rules in force.
        texts: Texts of new rules; cut at 200 characters.
        k: Iteration they come from.
        evidence: Tests that had failed.
    """
    known = {_key(rule.text) for rule in rules}
    number = max((int(rule.id[1:]) for rule in rules), default=0)
    added = []
    for text in texts:
        clean = " ".join(_MARKER.sub("…", text).split())[:MAX_RULE_CHARS]
        if clean and _key(clean) not in known:
            known.add(_key(clean))
            number += 1
            added.append(RepairRule(f"R{number}", clean, k, evidence))
    return (*rules, *added)[-MAX_RULES:]


def _key(text: str) -> str:
    plain = unicodedata.normalize("NFKC", text).casefold()
    # Numbers decide what a rule says, so a decimal point is not punctuation.
    return " ".join(re.findall(r"[a-z_]+|\d+(?:\.\d+)?", plain))


def parse_rules(reply: str) -> list[str]:
    """Texts of the rules in an answer: its lines that start with `- `."""
    lines = (line.strip() for line in reply.splitlines())
    return [line[2:].strip() for line in lines if line.startswith("- ")]


def render_block(rules: tuple[RepairRule, ...]) -> str:
    """The block of the prompt that holds the rules."""
    lines = [f"- {rule.text}" for rule in rules] or ["(none yet)"]
    return "\n".join([f"# === {BEGIN} ===", *lines, f"# === {END} ==="])
