"""The finished evaluation in a folder, which is not run again nor overwritten."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.evaluation.evaluation_report import (
    EvaluatedPolicy,
    EvaluatedTask,
    Evaluation,
    Result,
    Timing,
)
from tdac_agent.storage.csv_file import read_rows
from tdac_agent.verification.diagnosis.measures import Measured
from tdac_envs.core.intake import RECORD_BYTES, one_line, parse_json, read_file

RESULTS, EPISODE_TABLE, TIMING = "evaluation.json", "episodes.csv", "timing.csv"


def finished_evaluation(out: Path, wanted: dict[str, Any]) -> Evaluation | None:
    """The evaluation in a folder, if it is complete and the wanted one.

    Args:
        out: The folder.
        wanted: `variation`, `seed`, `episodes`, `tasks`, `policies` and `versions`, as
            in `Evaluation`.

    Returns:
        None if the folder has no evaluation, or files of the wanted one are missing.

    Raises:
        RunError: The folder has another evaluation, or one that cannot be read.
    """
    if not (out / RESULTS).is_file():
        return None
    try:
        record = parse_json(read_file(out / RESULTS, RECORD_BYTES))
        found = Evaluation.model_validate({**record, "results": (), "timings": ()})
    except (OSError, ValueError, TypeError) as error:
        reason = f"cannot be read ({one_line(error)[:120]})"
        raise RunError(
            f"{out / RESULTS} {reason}; give another folder with --out"
        ) from error
    if other := ", ".join(_differences(found, wanted)):
        raise RunError(
            f"{out} already has an evaluation, of {_summary(found)}; it differs in "
            f"{other}: give another folder with --out"
        )
    files = (EPISODE_TABLE, TIMING, *(f"{task.name}.png" for task in found.tasks))
    if not all((out / name).is_file() for name in files):
        return None
    try:
        results, timings = _results(out, found), _timings(out)
    except (OSError, ValueError, KeyError):
        return None
    return found.model_copy(update={"results": results, "timings": timings})


def _differences(found: Evaluation, wanted: dict[str, Any]) -> Iterator[str]:
    """What differs from the wanted evaluation, in words."""
    if _names(found.policies) != _names(wanted["policies"]):
        yield "policies"
    elif found.policies != wanted["policies"]:
        yield "the files of the policies"
    if _names(found.tasks) != _names(wanted["tasks"]):
        yield "tasks"
    elif found.tasks != wanted["tasks"]:
        yield "the settings of the tasks"
    for name in ("episodes", "variation", "seed"):
        if getattr(found, name) != wanted[name]:
            yield f"--{name}"
    if found.versions != wanted["versions"]:
        yield "package versions"


def _names(entries: tuple[EvaluatedPolicy | EvaluatedTask, ...]) -> list[str]:
    return [entry.name for entry in entries]


def _summary(found: Evaluation) -> str:
    policies, tasks = (", ".join(_names(e)) for e in (found.policies, found.tasks))
    count = found.episodes
    return (
        f"{policies} on {tasks} ({count} episode{'s' if count > 1 else ''} each, "
        f"{found.variation}, seed {found.seed})"
    )


def _rows(file: Path) -> Iterator[dict[str, Any]]:
    """The rows of a CSV file; an empty value is None."""
    for row in read_rows(file):
        yield {name: value or None for name, value in row.items()}


def _results(out: Path, found: Evaluation) -> tuple[Result, ...]:
    """The results with their episodes.

    Raises:
        ValueError: Episodes are missing, or a value is invalid.
    """
    episodes: dict[tuple[str, str], list[Measured]] = {}
    for row in _rows(out / EPISODE_TABLE):
        figures = {name: row[name] for name in Measured.model_fields}
        key = (row["task"], row["policy"])
        episodes.setdefault(key, []).append(Measured.model_validate(figures))
    results = tuple(
        Result(
            task=row.task,
            policy=row.policy,
            knows=row.knows,
            episodes=tuple(episodes.get((row.task, row.policy), ())),
            sandbox=row.sandbox,
            controller_sha256=row.controller_sha256,
            note=row.note,
        )
        for row in found.rows
    )
    if any(len(result.episodes) != found.episodes for result in results):
        raise ValueError("episodes are missing")
    return results


def _timings(out: Path) -> tuple[Timing, ...]:
    return tuple(Timing.model_validate(row) for row in _rows(out / TIMING))
