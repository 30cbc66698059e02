"""Sentences about what a policy survives, and how it fails."""

from __future__ import annotations

from collections.abc import Sequence

from tdac_agent.runs.falsification import (
    Counterexample,
    Direction,
    Envelope,
    Falsification,
)
from tdac_agent.tasks.deviation import DEVIATIONS
from tdac_agent.verification.diagnosis.gap import gap_text

NO_PROOF = (
    "This is a search of {} episodes, not a proof: there may be smaller failures. The "
    "blind drives of a verification bound how often it fails with the starts and the "
    "noise that they draw, not with a robot that differs."
)
_JOINED = {"pose error": ("pose_x", "pose_y"), "start": ("start_x", "start_y")}
_JOINED |= {"obstacles": ("obstacles_x", "obstacles_y")}


def plain_text(envelope: Envelope, found: Falsification) -> str:
    """How the drive without a deviation ended."""
    row = envelope.base
    if not row.success:
        return f"{row.outcome} after {row.steps} steps"
    text = f"reached after {row.steps} steps"
    if row.smallest_gap is None:
        return text
    return f"{text}, smallest gap {gap_text(row.smallest_gap, found.units)}"


def range_text(own: Sequence[Direction], found: Falsification) -> str:
    """What is survived of one part: `-1.5 px to +2 px`, `2 steps`, `± 15 %`."""
    texts = [
        _survived_alone(each, found) for each in sorted(own, key=lambda each: each.sign)
    ]
    if len(set(texts)) == 1:
        return texts[0]
    if len(own) == 2 and texts[0][1:] == texts[1][1:] and own[0].survives:
        return f"± {texts[1][1:]}"
    return " to ".join(texts)


def rows_of(
    envelope: Envelope, found: Falsification
) -> list[tuple[str, str, str, str, str]]:
    """Part, words, what is survived, where it fails, and why, of each part alone."""
    rows = []
    for part in found.space:
        own = [each for each in envelope.directions if each.part == part]
        if own:
            failed = [each for each in own if each.fails is not None]
            values = [found.value(part, each.fails or 0.0) for each in failed]
            causes = dict.fromkeys(each.cause or "" for each in failed)
            words, survived = DEVIATIONS[part].words, range_text(own, found)
            rows.append((part, words, survived, ", ".join(values), ", ".join(causes)))
    return rows


def _survived_alone(own: Direction, found: Falsification) -> str:
    text = found.value(own.part, own.survives)
    if own.fails is not None:
        return text
    if own.impossible:
        return f"{text} (no room for more)"
    if not own.survives:
        return "not tried"
    whole = abs(own.survives) > 0.999 * abs(own.limit) or _next_is_beyond(own, found)
    return f"{text} and more" if whole else f"{text} so far"


def _next_is_beyond(own: Direction, found: Falsification) -> bool:
    """Whether the next value would have been beyond the limit."""
    return abs(own.survives) + found.space[own.part] > abs(own.limit) + 1e-9


def summary_of(found: Falsification) -> str:
    """What is survived in every world, and the smallest failure, in one line."""
    plain = [each.number for each in found.envelopes if not each.base.success]
    if plain and found.split is None:
        return "fails without a deviation: there is nothing to search for"
    lines = [survived_text(found)] if any(e.directions for e in found.envelopes) else []
    if plain:
        worlds = ", ".join(map(str, plain))
        lines.append(f"fails without a deviation in world {worlds}")
    failed = [
        each.counterexample
        for each in found.envelopes
        if each.base.success and each.counterexample
    ]
    if failed:
        least = min(failed, key=lambda each: each.norm)
        where = "" if found.split is None else f" in world {least.number}"
        cause = least.row.cause or least.row.outcome
        words = found.in_words(least.deviation)
        lines.append(f"smallest failure found{where}: {words} ({cause})")
    elif any(each.base.success for each in found.envelopes):
        lines.append("no failure was found")
    return "; ".join(lines)


def survived_text(found: Falsification) -> str:
    """What is survived of the parts that can make it fail, alone."""
    own = [d for each in found.envelopes for d in each.directions]
    texts, done = [], set()
    for part in found.space:
        name, parts = next(
            ((n, p) for n, p in _JOINED.items() if part in p),
            (DEVIATIONS[part].words, (part,)),
        )
        if name in done:
            continue
        done.add(name)
        mine = [d for d in own if d.part in parts]
        if any(each.fails is not None for each in mine):
            failing = [each for each in mine if each.fails is not None]
            least = min(failing, key=lambda each: abs(each.survives))
            texts.append(
                f"{name} {found.value(least.part, abs(least.survives)).lstrip('+')}"
            )
    if not texts and all(each.survives or each.impossible for each in own):
        return "survives each deviation alone, as far as it was tried"
    if not texts:
        return "not each deviation was tried"
    return f"survives, alone, {', '.join(texts)}"


def failure_text(failed: Counterexample, found: Falsification) -> str:
    """The smallest failure in a sentence, with its place and step."""
    row = failed.row
    size = f"{failed.norm:.2g} sizes" if failed.norm else "no deviation"
    told: str = row.cause or row.outcome
    if row.text:  # what happened, without the name of the case and what led to it
        told = row.text.partition(": ")[2].partition(". ")[0].rstrip(".")
    return f"{found.in_words(failed.deviation)} ({size}): {told}"
