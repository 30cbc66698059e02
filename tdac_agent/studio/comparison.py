"""Two runs beside each other: their figures, their settings, and their controllers."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tdac_agent.library.listing import row_of
from tdac_agent.models.budget import format_usd
from tdac_agent.runs.run_record import Run, load_run
from tdac_agent.storage.plain import printable
from tdac_agent.tasks.units import UNITS
from tdac_agent.verification.diagnosis.gap import gap_text
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs.core.intake import RECORD_BYTES, TEXT_BYTES, parse_yaml, read_file

Line = tuple[str, str, str]
NONE = "–"
MOST_VALUE = 300
"""Characters of a value that are shown."""


def lines_of(one: Mapping[str, str], other: Mapping[str, str]) -> list[Line]:
    """Name and values of each figure of two runs; what one lacks is a dash."""
    names = dict.fromkeys([*one, *other])
    return [(name, one.get(name, NONE), other.get(name, NONE)) for name in names]


def figures_of(folder: Path) -> dict[str, str]:
    """What came of a run.

    Raises:
        RunError: It cannot be read.
    """
    run, row = load_run(folder), row_of(folder)
    last = run.attempts[-1] if run.attempts else None
    return {
        "status": str(row["status"]),
        "iterations": f"{row['k']} of at most {row['iterations']}",
        "candidates": str(len(run.attempts)),
        "failed tests of the last one": str(len(last.failed_tests)) if last else NONE,
        "nominal drive": _nominal_drive(folder),
        "time": f"{run.seconds:.1f} s",
        "tokens": f"{run.tokens_in:,} in, {run.tokens_out:,} out",
        "cost": NONE if run.cost is None else format_usd(run.cost),
    }


def settings_of(folder: Path) -> dict[str, str]:
    """The settings that a run was begun with: its own, and those of its task.

    Raises:
        RunError: It cannot be read.
    """
    run = load_run(folder)
    settings = {"task": run.task, **_of_loop(run)}
    for name in ("task.yaml", "set.yaml"):
        try:
            content = parse_yaml(read_file(folder / name, TEXT_BYTES))
        except (OSError, ValueError):
            continue
        settings |= dict(_flat(content, name.partition(".")[0]))
    settings.pop("task: profile", None)  # it is the form of the controller
    return settings


def difference(one: Path, other: Path) -> str | None:
    """What differs between the controllers of two runs, as a unified diff.

    Returns:
        An empty text if they are the same; None if a run has none.
    """
    sources = [_controller(folder) for folder in (one, other)]
    if None in sources:
        return None
    before, after = (source.splitlines() for source in sources if source is not None)
    names = str(one), str(other)
    return "\n".join(difflib.unified_diff(before, after, *names, lineterm=""))


def _of_loop(run: Run) -> dict[str, str]:
    yes = {True: "yes", False: "no"}
    limit = NONE if run.max_cost is None else format_usd(run.max_cost)
    return {
        "writer": run.learner,
        "repaired by": run.optimizer,
        "form of the controller": run.profile,
        "prompt": run.prompt,
        "maximum iterations": str(run.iterations),
        "maximum repairs per iteration": str(run.patience),
        "candidates side by side": str(run.candidates),
        "failures become rules": yes[run.refine],
        "rules given at the start": str(len(run.given_rules)),
        "maximum tokens per answer": str(run.max_output or NONE),
        "cost limit": limit,
        "begun with a controller": yes[run.given_sha256 is not None],
        "seed of the starts": NONE if run.seed is None else str(run.seed),
        "version of tdac": run.version or NONE,
    }


def _flat(value: Any, name: str) -> Iterator[tuple[str, str]]:
    """The values of nested mappings, each with the names that lead to it."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{name}: {key}")
    else:
        values = value if isinstance(value, list) else [value]
        text = ", ".join(NONE if each in (None, "") else str(each) for each in values)
        yield printable(name)[:MOST_VALUE], printable(text)[:MOST_VALUE] or NONE


def _nominal_drive(folder: Path) -> str:
    """How the last candidate drove from the fixed start, if it did."""
    try:
        data = read_file(folder / "report.json", RECORD_BYTES)
        report = Report.model_validate_json(data)
    except (OSError, ValueError):
        return NONE
    units, episodes = UNITS[report.provenance.unit], report.episodes
    first = next((each for each in episodes if each.name == "nominal"), None)
    if first is None:
        return NONE
    text, gap = f"{first.outcome}, {first.steps:,} steps", first.smallest_gap
    return text if gap is None else f"{text}, smallest gap {gap_text(gap, units)}"


def _controller(folder: Path) -> str | None:
    """The controller of a run: the verified one, or else the last candidate."""
    candidates = sorted(folder.glob("iterations/*/*/controller.py"))
    for path in (folder / "controller.py", *reversed(candidates)):
        try:
            return printable(read_file(path, TEXT_BYTES).decode("utf-8", "replace"))
        except OSError:
            continue
    return None
