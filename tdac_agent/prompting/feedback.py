"""Feedback: a failed report as text for the model that repairs the controller."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from tdac_agent.storage.plain import plain
from tdac_agent.verification.diagnosis.listed import first_of
from tdac_agent.verification.diagnosis.report import GROUPS, Diagnosis, Failure, Report

MAX_GROUPS = 3
MAX_NAMES = 6
MAX_MESSAGES = 4
MAX_LINES = 9
"""Number of causes that get a line of their own."""
LINE_CHARS = 200
MAX_CHARS = 1500
"""Length of a message, or of the description of an episode."""

_NOT_RUN = "not run, since"
_ERROR = re.compile(r"\b([A-Z]\w+) at [^:]*?(?: \(line \d+\))?: (.*)", re.DOTALL)
_ABSENT = re.compile(r"missing (?:constants|at the top level): |no `(?:def|if) ")
_SYNTAX = "the source does not parse"


@dataclass(frozen=True, slots=True)
class Feedback:
    """How a candidate failed, for the models.

    Attributes:
        text: Everything that they are told.
        line: The same in one line, for questions about later candidates.
        failed: Names of what failed, the evidence of rules.
        report: The report, for providers that are no language models; None if the
            candidate was not tested by a suite.
    """

    text: str
    line: str
    failed: tuple[str, ...]
    report: Report | None = None


@dataclass(frozen=True, slots=True)
class Group:
    """Failures with the same root cause.

    Attributes:
        cause: The root cause.
        members: The failures, in the order of the suite.
    """

    cause: str
    members: tuple[Failure, ...]

    @property
    def held_out(self) -> bool:
        """Whether its details must not be revealed."""
        return "held out" in (f.diagnosis.cause for f in self.members if f.diagnosis)

    @property
    def happened(self) -> list[str]:
        """Descriptions of its first episodes, of bounded length."""
        return _first([f.diagnosis.text for f in self.members if f.diagnosis])

    @property
    def messages(self) -> list[str]:
        """First messages of its tests that no diagnosis quotes, of bounded length."""
        if self.held_out:
            return []
        quoted = "\n".join(f.diagnosis.text for f in self.members if f.diagnosis)
        messages = (f.message for f in self.members)
        return _first([m for m in messages if plain(m) not in quoted])


def feedback_of(report: Report) -> Feedback:
    """What the models are told about a report."""
    failed = tuple(failure.test for failure in report.failures)
    return Feedback(render_feedback(report), _in_one_line(report), failed, report)


def render_feedback(report: Report) -> str:
    """Describes the failures by root cause: three in full, the others in a line each.

    The three cover as many parts of the suite as possible. For held-out episodes only
    pass or fail is stated.
    """
    groups, not_run = group_failures(report)
    chosen = choose(groups)
    parts = [f"{len(report.failures)} of {report.verdict.expected} tests failed."]
    parts += [f"{n}. {_describe(group)}" for n, group in enumerate(chosen, 1)]
    others = [group for group in groups if group not in chosen]
    if others:
        parts.append("\n".join(["Also failed:", *_lines(others, report)]))
    if not_run:
        parts.append(f"{not_run[0].message}: {_names(not_run)}")
    return "\n\n".join(parts)


def group_failures(report: Report) -> tuple[list[Group], list[Failure]]:
    """Returns failures by root cause, in suite order, and those of tests not run."""
    members: dict[str, list[Failure]] = {}
    not_run = []
    for failure in report.failures:
        if failure.message.startswith(_NOT_RUN) and failure.diagnosis is None:
            not_run.append(failure)
        else:
            members.setdefault(_root(failure), []).append(failure)
    groups = [Group(cause, tuple(each)) for cause, each in members.items()]
    return sorted(groups, key=lambda g: GROUPS.index(g.members[0].group)), not_run


def choose(groups: list[Group]) -> list[Group]:
    """Returns the groups to describe in full: the first of each part, then others."""
    heads = {group.members[0].group: group for group in reversed(groups)}
    firsts = [group for group in groups if heads[group.members[0].group] is group]
    others = [group for group in groups if group not in firsts]
    kept = [*firsts, *others][:MAX_GROUPS]
    return [group for group in groups if group in kept]


def _in_one_line(report: Report) -> str:
    groups, _ = group_failures(report)
    causes = "; ".join(_short(g, report.provenance.unit) for g in choose(groups))
    count = f"{len(report.failures)} of {report.verdict.expected} tests failed"
    return " ".join(f"{count}: {causes}".split())


def cut(text: str, limit: int = MAX_CHARS) -> str:
    """Shortens a long text to its head and tail, and states the omitted length."""
    if len(text) <= limit:
        return text
    half = limit // 2
    left_out = len(text) - 2 * half
    return f"{text[:half]} … {left_out} characters left out … {text[-half:]}"


def _root(failure: Failure) -> str:
    """Returns the root cause of a failure; failures that share it form a group."""
    diagnosis, message = failure.diagnosis, failure.message
    if diagnosis is not None and diagnosis.cause not in ("error", "contract"):
        return diagnosis.cause
    text = message if diagnosis is None else diagnosis.text
    error = _ERROR.search(text)
    if _SYNTAX in text or (error is not None and error[1] == "SyntaxError"):
        return "syntax"
    if _ABSENT.match(text) or "module 'controller' has no attribute" in text:
        return "missing names"
    if error is not None:
        return f"{error[1]}: {error[2].rstrip('.')}"
    called = re.match(r"(\w+)\(", text)
    return called[1] if called else text


def _describe(group: Group) -> str:
    lines = [_names(group.members), *group.messages]
    lines += [f"What happened: {line}" for line in group.happened]
    return "\n   ".join(lines)


def _lines(groups: list[Group], report: Report) -> list[str]:
    """Returns a line for each cause: tests and error; the last ones by name only."""
    unit = report.provenance.unit
    lines = [
        f"- {_names(group.members)}: {_short(group, unit, LINE_CHARS)}"
        for group in groups[:MAX_LINES]
    ]
    lines = [" ".join(line.split()) for line in lines]
    rest = [failure.test for group in groups[MAX_LINES:] for failure in group.members]
    return [*lines, f"- and {', '.join(rest)}"] if rest else lines


def _first(texts: list[str]) -> list[str]:
    """Returns the first different texts, shortened, and the number of others."""
    texts = list(dict.fromkeys(texts))
    more = len(texts) - MAX_MESSAGES
    first = [cut(text) for text in texts[:MAX_MESSAGES]]
    return [*first, f"… and {more} more like these"] if more > 0 else first


def _names(failures: Sequence[Failure]) -> str:
    return first_of([failure.test for failure in failures], MAX_NAMES)


def _short(group: Group, unit: str, limit: int = 100) -> str:
    first = group.members[0]
    if first.diagnosis is None or first.diagnosis.cause in ("error", "contract"):
        return cut(first.message, limit)
    if group.held_out:
        return f"{len(group.members)} of the held-out starts"
    return _figures(first.diagnosis, unit)


def _figures(diagnosis: Diagnosis, unit: str) -> str:
    words = [f"{diagnosis.episode or 'nominal'}: {diagnosis.cause}"]
    if diagnosis.step is not None:
        words.append(f"in step {diagnosis.step}")
    if diagnosis.x is not None and diagnosis.y is not None:
        words.append(f"at ({diagnosis.x:.4g}, {diagnosis.y:.4g})")
    if diagnosis.d0 is not None and diagnosis.d_min is not None:
        left = f"{diagnosis.d_min:.4g} of {diagnosis.d0:.4g} {unit}"
        words.append(f"with {left} left at best")
    return " ".join(words)
