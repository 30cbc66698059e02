"""A failed report in words, for the one who repairs."""

from __future__ import annotations

from collections import Counter

from tdac_agent.report import Failure, Report

MAX_GROUPS = 3
MAX_CHARS = 1500


def render_feedback(report: Report) -> str:
    """The failures, grouped by what happened.

    Three groups of each part of the suite are told in full, the rest by name. Episodes
    that are held out appear with pass or fail only.
    """
    groups: dict[tuple[str, str], list[Failure]] = {}
    for failure in report.failures:
        groups.setdefault((failure.group, _cause(failure)), []).append(failure)
    parts = [f"{len(report.failures)} of {report.verdict.expected} tests failed."]
    told, named = Counter[str](), list[str]()
    for (part, _), members in groups.items():
        if told[part] < MAX_GROUPS:
            told[part] += 1
            parts.append(f"{told.total()}. {_tell(members)}")
        else:
            named += [member.test for member in members]
    if named:
        parts.append(f"Also failed: {', '.join(named)}")
    return "\n\n".join(parts)


def _tell(members: list[Failure]) -> str:
    """Failures with one cause: names, messages, and what happened."""
    lines = [", ".join(member.test for member in members)]
    diagnosis = members[0].diagnosis
    if diagnosis is None or diagnosis.cause != "held out":
        messages = dict.fromkeys(member.message for member in members)
        lines += [_cut(message) for message in list(messages)[:4]]
    if diagnosis is not None:
        lines.append(f"What happened: {_cut(diagnosis.text)}")
    return "\n   ".join(lines)


def _cause(failure: Failure) -> str:
    if failure.diagnosis is not None:
        return failure.diagnosis.text
    return failure.message


def _cut(text: str) -> str:
    """Head and tail of a long text, with what was left out counted."""
    if len(text) <= MAX_CHARS:
        return text
    half = MAX_CHARS // 2
    left_out = len(text) - 2 * half
    return f"{text[:half]} … {left_out} characters left out … {text[-half:]}"
