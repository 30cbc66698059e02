"""A failed report in words, for the one who repairs."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tdac_agent.storage.plain import plain
from tdac_agent.verification.diagnosis.report import GROUPS, Diagnosis, Failure, Report

MAX_GROUPS = 3
MAX_NAMES = 6
MAX_MESSAGES = 4
MAX_LINES = 9
"""Of causes that are told in a line each."""
LINE_CHARS = 200
MAX_CHARS = 1500
"""Of one message, or of one account of an episode."""

_NOT_RUN = "not run, since"
_ERROR = re.compile(r"\b([A-Z]\w+) at [^:]*?(?: \(line \d+\))?: (.*)", re.DOTALL)
_ABSENT = re.compile(r"missing (?:constants|at the top level): |no `(?:def|if) ")
_SYNTAX = "the source does not parse"


@dataclass(frozen=True, slots=True)
class Group:
    """Failures with one root cause.

    Attributes:
        cause: What they have in common.
        members: In the order of the suite.
    """

    cause: str
    members: tuple[Failure, ...]

    @property
    def held_out(self) -> bool:
        """Whether nothing more may be told of it."""
        return any(_is_held_out(failure) for failure in self.members)

    @property
    def happened(self) -> list[str]:
        """What happened in its episodes, the first ones, each bounded."""
        return _first([f.diagnosis.text for f in self.members if f.diagnosis])

    @property
    def messages(self) -> list[str]:
        """What its tests say that no diagnosis quotes, likewise."""
        if self.held_out:
            return []
        quoted = "\n".join(f.diagnosis.text for f in self.members if f.diagnosis)
        told = (f.message for f in self.members)
        return _first([m for m in told if plain(m) not in quoted])


def render_feedback(report: Report) -> str:
    """The failures by root cause: three in full, the others in a line each.

    Where several parts of the suite failed, each part has its say first. Episodes that
    are held out appear with pass or fail only.
    """
    groups, not_run = group_failures(report)
    chosen = choose(groups)
    parts = [f"{len(report.failures)} of {report.verdict.expected} tests failed."]
    parts += [f"{n}. {_tell(group)}" for n, group in enumerate(chosen, 1)]
    others = [group for group in groups if group not in chosen]
    if others:
        parts.append("\n".join(["Also failed:", *_lines(others, report)]))
    if not_run:
        parts.append(f"{not_run[0].message}: {_names(not_run)}")
    return "\n\n".join(parts)


def group_failures(report: Report) -> tuple[list[Group], list[Failure]]:
    """Failures by root cause in the order of the suite; those of tests not run."""
    members: dict[str, list[Failure]] = {}
    not_run = []
    for failure in report.failures:
        if failure.message.startswith(_NOT_RUN) and failure.diagnosis is None:
            not_run.append(failure)
        else:
            members.setdefault(_root(failure), []).append(failure)
    groups = [Group(cause, tuple(found)) for cause, found in members.items()]
    return sorted(groups, key=lambda g: GROUPS.index(g.members[0].group)), not_run


def choose(groups: list[Group]) -> list[Group]:
    """Those to be told in full: the first of each part, then the next ones."""
    heads = {group.members[0].group: group for group in reversed(groups)}
    firsts = [group for group in groups if heads[group.members[0].group] is group]
    others = [group for group in groups if group not in firsts]
    kept = [*firsts, *others][:MAX_GROUPS]
    return [group for group in groups if group in kept]


def tell_attempt(k: int, j: int, report: Report) -> str:
    """A failed attempt in one line: how many tests, which causes, which figures."""
    groups, _ = group_failures(report)
    causes = "; ".join(_short(g, report.provenance.unit) for g in choose(groups))
    count = f"{len(report.failures)} of {report.verdict.expected} tests failed"
    return " ".join(f"k={k} j={j}: {count}: {causes}".split())


def cut(text: str, limit: int = MAX_CHARS) -> str:
    """Head and tail of a long text, with what was left out counted."""
    if len(text) <= limit:
        return text
    half = limit // 2
    left_out = len(text) - 2 * half
    return f"{text[:half]} … {left_out} characters left out … {text[-half:]}"


def _root(failure: Failure) -> str:
    """What failures with one root cause have in common."""
    diagnosis, message = failure.diagnosis, failure.message
    if diagnosis is not None and diagnosis.cause not in ("error", "contract"):
        return diagnosis.cause
    told = message if diagnosis is None else diagnosis.text
    error = _ERROR.search(told)
    if _SYNTAX in told or (error is not None and error[1] == "SyntaxError"):
        return "syntax"
    if _ABSENT.match(told) or "module 'controller' has no attribute" in told:
        return "names that are not there"
    if error is not None:
        return f"{error[1]}: {error[2].rstrip('.')}"
    called = re.match(r"(\w+)\(", told)
    return called[1] if called else told


def _tell(group: Group) -> str:
    """Failures with one cause: names, messages, and what happened."""
    lines = [_names(list(group.members)), *group.messages]
    lines += [f"What happened: {line}" for line in group.happened]
    return "\n   ".join(lines)


def _lines(groups: list[Group], report: Report) -> list[str]:
    """A line for each cause: tests, and what is wrong; the last ones by name only."""
    unit = report.provenance.unit
    lines = [
        f"- {_names(list(group.members))}: {_short(group, unit, LINE_CHARS)}"
        for group in groups[:MAX_LINES]
    ]
    rest = [failure for group in groups[MAX_LINES:] for failure in group.members]
    return [" ".join(line.split()) for line in lines] + (
        [f"- and {', '.join(failure.test for failure in rest)}"] if rest else []
    )


def _first(texts: list[str]) -> list[str]:
    """The first of the texts that differ, each bounded, and how many more there are."""
    texts = list(dict.fromkeys(texts))
    more = len(texts) - MAX_MESSAGES
    return [cut(text) for text in texts[:MAX_MESSAGES]] + (
        [f"… and {more} more like these"] if more > 0 else []
    )


def _names(failures: list[Failure]) -> str:
    names = [failure.test for failure in failures]
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")


def _short(group: Group, unit: str, limit: int = 100) -> str:
    """A root cause with its figures, in some words."""
    first = group.members[0]
    if first.diagnosis is None or first.diagnosis.cause in ("error", "contract"):
        return cut(first.message, limit)
    if group.held_out:
        return f"{len(group.members)} of the starts that are held out"
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


def _is_held_out(failure: Failure) -> bool:
    return failure.diagnosis is not None and failure.diagnosis.cause == "held out"
