"""The story of a run: a small picture of each version, and what changed in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tdac_agent.html_report.animation import FINENESS
from tdac_agent.html_report.code import count_changes, is_new_file, is_rewritten
from tdac_agent.html_report.names import short_test
from tdac_agent.runs.history import CandidateHistory, RunHistory
from tdac_agent.verification.diagnosis.listed import first_of
from tdac_agent.verification.diagnosis.report import Cause, Diagnosis, Report

MOST_CARDS = 6
"""Versions that are shown: the first ones and the last one."""
MOST_NAMES = 2
"""Failed tests that are named."""
ENDINGS: dict[Cause, str] = {
    "collision": "hits something",
    "no motion": "does not move",
    "stuck": "gets stuck",
    "spinning": "spins on the spot",
    "oscillating": "swings to and fro",
    "looping": "drives in circles",
    "too slow": "is too slow",
    "missed goal": "misses the goal",
    "wrong goal": "drives to a wrong place",
    "error": "ends with an error",
    "time-out": "computes for too long",
    "contract": "returns something that is no action",
}
"""How a drive ends, by the cause of its failure."""


@dataclass(frozen=True, slots=True)
class Card:
    """A version of the controller.

    Attributes:
        one: The candidate.
        version: Its number among those with code, from 1.
        told: What its drives and tests showed, in one sentence.
        line: Its drive for `points` of an SVG polyline, px of the scene; empty without.
        end: Where that drive ends.
        contact: Where it touched something.
        changed: What changed since the version before; empty for the first.
        skipped: Versions before it that are not shown.
    """

    one: CandidateHistory
    version: int
    told: str
    line: str
    end: tuple[float, float] | None
    contact: tuple[float, float] | None
    changed: str
    skipped: int = 0


def story_of(history: RunHistory, episodes: Sequence[dict[str, Any]]) -> list[Card]:
    """The versions of a run on a task, with what changed from each to the next.

    Args:
        history: The run.
        episodes: Its recorded episodes, from `animations`.

    Returns:
        At most `MOST_CARDS`; none for fewer than two versions.
    """
    coded = [one for one in history.tried if one.source is not None and one.report]
    if len(coded) < 2:
        return []
    numbers = list(range(len(coded)))
    if len(coded) > MOST_CARDS:
        numbers = [*numbers[: MOST_CARDS - 1], numbers[-1]]
    before = [-1, *numbers]
    return [
        _card(coded[number], number, number - last - 1, episodes)
        for last, number in pairwise(before)
    ]


def _card(
    one: CandidateHistory, number: int, skipped: int, episodes: Sequence[dict[str, Any]]
) -> Card:
    assert one.report is not None
    drive, line = _drive_of(one, episodes), ""
    end = contact = None
    if drive is not None:
        points = np.cumsum(np.reshape(drive["points"], (-1, 4)), axis=0)
        places = points[:, 1:3] / FINENESS
        line = " ".join(f"{x:.0f},{y:.0f}" for x, y in places)
        end = (float(places[-1, 0]), float(places[-1, 1]))
        contact = drive["contact"] and tuple(drive["contact"])
    changed = changed_in(one) if number else ""
    told = told_of(one.report, None if drive is None else drive["dt"])
    return Card(one, number + 1, told, line, end, contact, changed, skipped)


def _drive_of(
    one: CandidateHistory, episodes: Sequence[dict[str, Any]]
) -> dict[str, Any] | None:
    """The first failed drive of a candidate, else its first one; None without."""
    own = [each for each in episodes if each["candidate"] == f"{one.k}.{one.j}"]
    failed = [each for each in own if each["outcome"] != "reached"]
    return next(iter([*failed, *own]), None)


def told_of(report: Report, dt: float | None) -> str:
    """What drives and tests of a version showed, such as `Passes all 41 tests`.

    Args:
        report: Its verification.
        dt: Duration of a step, s; None if no time is to be told.
    """
    drives = [each for each in report.episodes if each.outcome != "not run"]
    reached = sum(each.outcome == "reached" for each in drives)
    if report.verdict.passed:
        return f"Passes all {report.verdict.expected} tests."
    failures = [each.diagnosis for each in report.failures if each.diagnosis]
    shown = [each for each in failures if each.cause in ENDINGS]
    if reached < len(drives) and shown:
        text = _ending(shown[0], dt)
        several = f"; {reached} of {len(drives)} drives arrive"
        return f"{text[0].upper()}{text[1:]}{several if len(drives) > 1 else ''}."
    names = [short_test(each.test) for each in report.failures]
    listed = first_of(names, MOST_NAMES)
    tests = f"{len(names)} test{'' if len(names) == 1 else 's'}"
    arrive = f"Arrives in {reached} of {len(drives)} drives; " if drives else ""
    text = f"{arrive}fails {tests}: {listed}."
    return f"{text[0].upper()}{text[1:]}"


def _ending(diagnosis: Diagnosis, dt: float | None) -> str:
    text = ENDINGS[diagnosis.cause]
    if diagnosis.cause == "collision":
        text = f"hits {_touched(diagnosis.thing)}"
    if diagnosis.step and dt is not None:
        text += f" after {diagnosis.step * dt:.1f} s"
    return text


def _touched(thing: str | None) -> str:
    """What was touched, with its article."""
    if thing is None or thing == "wall":
        return "a wall"
    return thing if thing.startswith("mover ") else f"the {thing}"


def changed_in(one: CandidateHistory) -> str:
    """How a version differs from the one before."""
    if is_new_file(one.diff):
        return "a new file"
    added, removed = count_changes(one.diff)
    if not added and not removed:
        return "the same code"
    rules = len(one.learnt.fresh)
    learnt = f" after {rules} new rule{'' if rules == 1 else 's'}" if rules else ""
    if is_rewritten(one.diff, one.source or ""):
        return f"written anew{learnt}"
    return f"{added} line{'' if added == 1 else 's'} added, {removed} removed{learnt}"
