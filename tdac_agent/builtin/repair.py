"""Repair: changes parameters after failures and stores them in rules."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

import numpy as np

from tdac_agent.builtin.template import (
    MARGIN,
    MarginBounds,
    P,
    Tuned,
    metadata_of,
    names_of,
)
from tdac_agent.prompting.rules import MAX_RULE_CHARS
from tdac_agent.verification.diagnosis.report import Cause, Report


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """A parameter change, with the failed test that led to it."""

    test: str
    cause: Cause
    name: str
    before: float
    after: float

    def __str__(self) -> str:
        return f"{self.test} -> {self.name} {self.before:g} -> {self.after:g}"


_CAUSES_BY_TEST: Mapping[str, Cause] = {
    "test_progress": "too slow",
    "test_policy_is_fast_enough": "time-out",
}


def repair(
    parameters: P, report: Report, bounds: MarginBounds, attempt: int
) -> tuple[P, list[ParameterChange]]:
    """Applies the remedies for all failures; returns the parameters and the changes.

    If no remedy can change anything, a seeded random step is taken, so that the loop
    does not repeat one candidate forever.

    Args:
        parameters: Parameters of the failed controller.
        report: Its report.
        bounds: Margins not yet known to fail.
        attempt: Seed of the random step.
    """
    changes: dict[str, ParameterChange] = {}
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
    return parameters.changed(**after), list(changes.values())


def _compare(
    parameters: P, wanted: P, test: str, cause: Cause
) -> list[ParameterChange]:
    names = names_of(type(parameters))
    pairs = [(n, getattr(parameters, n), getattr(wanted, n)) for n in names]
    return [
        ParameterChange(test, cause, n, was, now) for n, was, now in pairs if was != now
    ]


def first_tests(report: Report) -> dict[Cause, str]:
    """Returns a failed test for each cause, `test_no_collisions` if possible.

    Without a diagnosis (the episode reached the goal), the test implies the cause.
    """
    tests: dict[Cause, str] = {}
    preferred = "::test_no_collisions"
    for failure in sorted(report.failures, key=lambda f: preferred not in f.test):
        name = failure.test.rpartition("::")[2]
        if failure.diagnosis is not None:
            tests.setdefault(failure.diagnosis.cause, failure.test)
        elif name in _CAUSES_BY_TEST:
            tests.setdefault(_CAUSES_BY_TEST[name], failure.test)
    return tests


def _random_step(parameters: P, seed: int) -> P:
    """Moves halfway to a random point within the bounds."""
    random = np.random.default_rng(seed)
    values = {
        item.name: 0.5 * getattr(parameters, item.name)
        + 0.5 * random.uniform(item.metadata["low"], item.metadata["high"])
        for item in fields(parameters)
    }
    return parameters.changed(**values)


def write_rules(
    parameters: Tuned,
    changes: Iterable[ParameterChange],
    bounds: MarginBounds,
    iteration: int,
) -> list[str]:
    """Returns rules that state the parameters, for people and for `read_rules`.

    Example: `set LOOKAHEAD = 60 px; keep INFLATION_MARGIN > 2 px (k = 1: collision)`.
    All parameters that are not neutral are repeated, so older rules may be dropped.

    Args:
        parameters: Parameters of the next controller.
        changes: The changes that led to them.
        bounds: Margins not yet known to fail.
        iteration: k; also makes the text differ from that of older rules.
    """
    causes = {change.name: change.cause for change in changes}
    kind = type(parameters)
    neutral, clauses = kind(), list[str]()
    for name in names_of(kind):
        value = getattr(parameters, name)
        if value != getattr(neutral, name) or name in causes:
            clauses.append(_clause(kind, "set", name, "=", value))
    if bounds.above > 0.0:
        clauses.append(_clause(kind, "keep", MARGIN, ">", bounds.above))
    if bounds.below < math.inf:
        clauses.append(_clause(kind, "keep", MARGIN, "<", bounds.below))
    why = ", ".join(dict.fromkeys(causes.values())) or "as before"
    return _packed(clauses, f" (k = {iteration}: {why})")


def _packed(clauses: list[str], ending: str) -> list[str]:
    """Joins clauses to as few rules as possible, each with the same ending."""
    rules: list[str] = []
    for clause in clauses:
        longer = f"{rules[-1]}; {clause}" if rules else ""
        if rules and len(longer + ending) <= MAX_RULE_CHARS:
            rules[-1] = longer
        else:
            rules.append(clause)
    return [rule + ending for rule in rules]


def _clause(
    kind: type[Tuned], verb: str, name: str, relation: str, value: float
) -> str:
    unit = metadata_of(kind, name)["unit"]
    number = f"{value:.5f}".rstrip("0").rstrip(".")
    return f"{verb} {name.upper()} {relation} {number} {unit}".rstrip()


_RULE = re.compile(r"^(set|keep) ([A-Z_]+) ([=<>]) (\d+(?:\.\d+)?)\b")


def read_rules(rules: Iterable[str], kind: type[P]) -> tuple[P, MarginBounds]:
    """Reads rules of `write_rules`; later values replace earlier ones. Skips others."""
    values: dict[str, float] = {}
    above, below = 0.0, math.inf
    for clause in (part for rule in rules for part in rule.split(";")):
        match = _RULE.match(clause.strip())
        if match is None or match[2].lower() not in names_of(kind):
            continue
        name, value = match[2].lower(), float(match[4])
        if match[3] == "=":
            values[name] = value
        elif match[3] == ">":
            above = max(above, value)
        else:
            below = min(below, value)
    return kind().changed(**values), MarginBounds(above, below)


def learn_bounds(
    bounds: MarginBounds, parameters: Tuned, report: Report
) -> MarginBounds:
    """Returns the margins not yet known to fail after another report."""
    causes, margin = first_tests(report), parameters.inflation_margin
    above, below = bounds.above, bounds.below
    if "collision" in causes:
        above = max(above, margin)
    if "no motion" in causes:
        below = min(below, margin)
    return MarginBounds(above, below) if above < below else MarginBounds(above)
