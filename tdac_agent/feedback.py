"""A failed report in words, for the one who repairs."""

from __future__ import annotations

from tdac_agent.report import Failure, Report

MAX_GROUPS = 3
MAX_CHARS = 1500


def render_feedback(report: Report) -> str:
    """The failures, grouped by what happened; three groups in full, the rest by name.

    Episodes that are held out appear with pass or fail only.
    """
    groups: dict[str, list[Failure]] = {}
    for failure in report.failures:
        groups.setdefault(_cause(failure), []).append(failure)
    parts = [f"{len(report.failures)} of {report.verdict.expected} tests failed."]
    for index, members in enumerate(groups.values()):
        names = ", ".join(failure.test for failure in members)
        if index >= MAX_GROUPS:
            parts.append(f"Also failed: {names}")
            continue
        diagnosis = members[0].diagnosis
        lines = [f"{index + 1}. {names}"]
        if diagnosis is None or diagnosis.cause != "held out":
            messages = dict.fromkeys(member.message for member in members)
            lines += [f"   {_cut(message)}" for message in list(messages)[:4]]
        if diagnosis is not None:
            lines.append(f"   What happened: {_cut(diagnosis.text)}")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


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
