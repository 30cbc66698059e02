"""The repair table: which parameters answer which failure, and rules to remember it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Literal

import numpy as np

from tdac_agent.builtin.parameters import Parameters, unit_of
from tdac_agent.report import Cause, Report

MARGIN = "inflation_margin"
_MARGIN_STEP = 2.0
_MARGIN_RESOLUTION = 0.25
_NAMES = tuple(item.name for item in fields(Parameters))


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


@dataclass(frozen=True, slots=True)
class Bounds:
    """Margins that failed, px: too small ones and too large ones."""

    above: float = 0.0
    below: float = math.inf


@dataclass(frozen=True, slots=True)
class Remedy:
    """How one cause of failure changes the parameters.

    Attributes:
        margin: The way in which to search for a better inflation margin.
        add: Amount added to a parameter.
        scale: Factor of a parameter; one that is off (0) stays off.
        switch_on: Value of a parameter that was off.
    """

    margin: Literal["wider", "narrower"] | None = None
    add: Mapping[str, float] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    switch_on: Mapping[str, float] = field(default_factory=dict)

    def apply(self, parameters: Parameters, bounds: Bounds) -> Parameters:
        """The parameters after this remedy, within their limits."""
        values = {n: getattr(parameters, n) * f for n, f in self.scale.items()}
        values |= {n: getattr(parameters, n) + d for n, d in self.add.items()}
        off = {n: v for n, v in self.switch_on.items() if not getattr(parameters, n)}
        margin = parameters.inflation_margin
        if self.margin == "wider":
            values[MARGIN] = _wider(margin, bounds)
        elif self.margin == "narrower":
            values[MARGIN] = _narrower(margin, bounds)
        return parameters.changed(**(values | off))


def _wider(margin: float, bounds: Bounds) -> float:
    if bounds.below == math.inf:
        return margin + _MARGIN_STEP
    gap = bounds.below - margin
    return margin + 0.5 * gap if gap > _MARGIN_RESOLUTION else margin


def _narrower(margin: float, bounds: Bounds) -> float:
    gap = margin - bounds.above
    return margin - 0.5 * gap if gap > _MARGIN_RESOLUTION else margin


_HELD_UP = Remedy(
    scale={"unstick_after": 0.5, "lookahead": 0.5}, switch_on={"unstick_after": 100.0}
)
_RESTLESS = Remedy(scale={"turn_gain": 0.6, "turn_in_place": 1.5})

REMEDIES: Mapping[Cause, Remedy] = MappingProxyType(
    {
        "collision": Remedy(
            margin="wider",
            add={"turn_gain": 0.3, "slow_dist": 10.0, "stop_dist": 4.0},
            scale={"lookahead": 0.5, "turn_in_place": 0.5},
        ),
        "no motion": Remedy(margin="narrower", scale={"stop_dist": 0.5}),
        "stuck": _HELD_UP,
        "looping": _HELD_UP,
        "spinning": _RESTLESS,
        "oscillating": _RESTLESS,
        "missed goal": Remedy(scale={"lookahead": 0.5, "turn_in_place": 0.5}),
        "too slow": Remedy(
            scale={
                "cruise_speed": 1.4,
                "turn_in_place": 1.4,
                "slow_dist": 0.5,
                "stop_dist": 0.5,
            }
        ),
        "time-out": Remedy(scale={"lookahead": 0.5}),
        "held out": Remedy(
            margin="wider",
            add={"turn_gain": 0.15},
            scale={"lookahead": 0.7, "turn_in_place": 0.7},
        ),
    }
)
"""Most telling cause first: of two that want the same parameter the first wins."""

_MEANING: Mapping[str, Cause] = MappingProxyType(
    {"test_progress": "too slow", "test_policy_is_fast_enough": "time-out"}
)


def repair(
    parameters: Parameters, report: Report, bounds: Bounds, attempt: int
) -> tuple[Parameters, list[Change]]:
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
    for cause, remedy in REMEDIES.items():
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
    parameters: Parameters, wanted: Parameters, test: str, cause: Cause
) -> list[Change]:
    pairs = [(n, getattr(parameters, n), getattr(wanted, n)) for n in _NAMES]
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


def _random_step(parameters: Parameters, seed: int) -> Parameters:
    """Half-way to a random point within the limits."""
    random = np.random.default_rng(seed)
    values = {
        item.name: 0.5 * getattr(parameters, item.name)
        + 0.5 * random.uniform(item.metadata["low"], item.metadata["high"])
        for item in fields(parameters)
    }
    return parameters.changed(**values)


def write_rules(
    parameters: Parameters, changes: Iterable[Change], bounds: Bounds, iteration: int
) -> list[str]:
    """Rules that lead to these parameters, for a person and for `read_rules`.

    They read `set LOOKAHEAD = 60 px (k = 1: collision in test_no_collisions)` and
    `keep INFLATION_MARGIN > 2 px (k = 1: collision)`. All that is not neutral is said
    again, so that older rules may be forgotten.

    Args:
        parameters: What the next controller shall have.
        changes: Why; other parameters are said to be kept.
        bounds: Margins known to fail.
        iteration: k, which also keeps a rule from being taken for an older one.
    """
    reasons = {change.name: f"{change.cause} in {change.test}" for change in changes}
    neutral, rules = Parameters(), []
    for name in _NAMES:
        value = getattr(parameters, name)
        if value != getattr(neutral, name) or name in reasons:
            reason = reasons.get(name, "as before")
            rules.append(f"{_say('set', name, '=', value)} (k = {iteration}: {reason})")
    if bounds.above > 0.0:
        rules.append(
            f"{_say('keep', MARGIN, '>', bounds.above)} (k = {iteration}: collision)"
        )
    if bounds.below < math.inf:
        rules.append(
            f"{_say('keep', MARGIN, '<', bounds.below)} (k = {iteration}: no motion)"
        )
    return rules


def _say(verb: str, name: str, relation: str, value: float) -> str:
    return f"{verb} {name.upper()} {relation} {value:g} {unit_of(name)}".rstrip()


_RULE = re.compile(r"^(set|keep) ([A-Z_]+) ([=<>]) (\d+(?:\.\d+)?)\b")


def read_rules(rules: Iterable[str]) -> tuple[Parameters, Bounds]:
    """What `write_rules` wrote, the latest rule winning; other rules are skipped."""
    values: dict[str, float] = {}
    above, below = 0.0, math.inf
    for rule in rules:
        match = _RULE.match(rule.strip())
        if match is None or match[2].lower() not in _NAMES:
            continue
        name, value = match[2].lower(), float(match[4])
        if match[3] == "=":
            values[name] = value
        elif match[3] == ">":
            above = max(above, value)
        else:
            below = min(below, value)
    return Parameters().changed(**values), Bounds(above, below)


def learn_bounds(bounds: Bounds, parameters: Parameters, report: Report) -> Bounds:
    """The margins known to fail after one more report."""
    causes, margin = first_tests(report), parameters.inflation_margin
    above, below = bounds.above, bounds.below
    if "collision" in causes:
        above = max(above, margin)
    if "no motion" in causes:
        below = min(below, margin)
    return Bounds(above, below) if above < below else Bounds(above)
