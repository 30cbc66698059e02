"""Repair: failures change parameters, and rules remember what they were."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

import numpy as np

from tdac_agent.builtin.parameters import P, Tuned, about, changed, names_of
from tdac_agent.builtin.remedies import MARGIN, Bounds
from tdac_agent.prompting.rules import MAX_RULE_CHARS
from tdac_agent.verification.diagnosis.report import Cause, Report


@dataclass(frozen=True, slots=True)
class Change:
    """One parameter that a failing test changed."""

    test: str
    cause: Cause
    name: str
    before: float
    after: float

    def __str__(self) -> str:
        return f"{self.test} -> {self.name} {self.before:g} -> {self.after:g}"


_MEANING: Mapping[str, Cause] = {
    "test_progress": "too slow",
    "test_policy_is_fast_enough": "time-out",
}


def repair(
    parameters: P, report: Report, bounds: Bounds, attempt: int
) -> tuple[P, list[Change]]:
    """The parameters changed as the failures ask for.

    Where no failure asks for a change that is still possible, a seeded random step
    is made, so that no candidate is tried for ever.

    Args:
        parameters: Those that failed.
        report: What failed.
        bounds: Margins known to fail.
        attempt: Seed of the random step.
    """
    changes: dict[str, Change] = {}
    tests = first_tests(report)
    for cause, remedy in parameters.remedies.items():
        if cause in tests:
            wanted = remedy.apply(parameters, bounds)
            for change in _compare(parameters, wanted, tests[cause], cause):
                changes.setdefault(change.name, change)
    if not changes and report.failures:
        unknown: dict[Cause, str] = {"error": report.failures[0].test}
        cause, test = next(iter((tests or unknown).items()))
        wanted = _random_step(parameters, attempt)
        changes = {c.name: c for c in _compare(parameters, wanted, test, cause)}
    after = {name: change.after for name, change in changes.items()}
    return changed(parameters, after), list(changes.values())


def _compare(parameters: P, wanted: P, test: str, cause: Cause) -> list[Change]:
    names = names_of(type(parameters))
    pairs = [(n, getattr(parameters, n), getattr(wanted, n)) for n in names]
    return [Change(test, cause, n, was, now) for n, was, now in pairs if was != now]


def first_tests(report: Report) -> dict[Cause, str]:
    """Each cause in a report with a test that showed it, the plainest one.

    An episode that arrived has no diagnosis; then the test itself says what is wrong.
    """
    tests: dict[Cause, str] = {}
    plainest = "::test_no_collisions"
    for failure in sorted(report.failures, key=lambda f: plainest not in f.test):
        name = failure.test.rpartition("::")[2]
        if failure.diagnosis is not None:
            tests.setdefault(failure.diagnosis.cause, failure.test)
        elif name in _MEANING:
            tests.setdefault(_MEANING[name], failure.test)
    return tests


def _random_step(parameters: P, seed: int) -> P:
    """Half-way to a random point within the limits."""
    random = np.random.default_rng(seed)
    values = {
        item.name: 0.5 * getattr(parameters, item.name)
        + 0.5 * random.uniform(item.metadata["low"], item.metadata["high"])
        for item in fields(parameters)
    }
    return changed(parameters, values)


def write_rules(
    parameters: Tuned, changes: Iterable[Change], bounds: Bounds, iteration: int
) -> list[str]:
    """Rules that lead to these parameters, for a person and for `read_rules`.

    They read `set LOOKAHEAD = 60 px; keep INFLATION_MARGIN > 2 px (k = 1: collision)`.
    All that is not neutral is said again, so that older rules may be forgotten.

    Args:
        parameters: What the next controller shall have.
        changes: Why; other parameters are said to be kept.
        bounds: Margins known to fail.
        iteration: k, which also keeps a rule from being taken for an older one.
    """
    causes = {change.name: change.cause for change in changes}
    kind = type(parameters)
    neutral, said = kind(), list[str]()
    for name in names_of(kind):
        value = getattr(parameters, name)
        if value != getattr(neutral, name) or name in causes:
            said.append(_say(kind, "set", name, "=", value))
    if bounds.above > 0.0:
        said.append(_say(kind, "keep", MARGIN, ">", bounds.above))
    if bounds.below < math.inf:
        said.append(_say(kind, "keep", MARGIN, "<", bounds.below))
    why = ", ".join(dict.fromkeys(causes.values())) or "as before"
    return _packed(said, f" (k = {iteration}: {why})")


def _packed(said: list[str], ending: str) -> list[str]:
    """As few rules as hold these words, each with the same ending."""
    rules: list[str] = []
    for words in said:
        longer = f"{rules[-1]}; {words}" if rules else ""
        if rules and len(longer + ending) <= MAX_RULE_CHARS:
            rules[-1] = longer
        else:
            rules.append(words)
    return [rule + ending for rule in rules]


def _say(kind: type[Tuned], verb: str, name: str, relation: str, value: float) -> str:
    unit = about(kind, name)["unit"]
    number = f"{value:.5f}".rstrip("0").rstrip(".")
    return f"{verb} {name.upper()} {relation} {number} {unit}".rstrip()


_RULE = re.compile(r"^(set|keep) ([A-Z_]+) ([=<>]) (\d+(?:\.\d+)?)\b")


def read_rules(rules: Iterable[str], kind: type[P]) -> tuple[P, Bounds]:
    """What `write_rules` wrote, the latest rule winning; other rules are skipped."""
    values: dict[str, float] = {}
    above, below = 0.0, math.inf
    for words in (part for rule in rules for part in rule.split(";")):
        match = _RULE.match(words.strip())
        if match is None or match[2].lower() not in names_of(kind):
            continue
        name, value = match[2].lower(), float(match[4])
        if match[3] == "=":
            values[name] = value
        elif match[3] == ">":
            above = max(above, value)
        else:
            below = min(below, value)
    return changed(kind(), values), Bounds(above, below)


def learn_bounds(bounds: Bounds, parameters: Tuned, report: Report) -> Bounds:
    """The margins known to fail after one more report."""
    causes, margin = first_tests(report), parameters.inflation_margin
    above, below = bounds.above, bounds.below
    if "collision" in causes:
        above = max(above, margin)
    if "no motion" in causes:
        below = min(below, margin)
    return Bounds(above, below) if above < below else Bounds(above)
