"""The one evaluation of a selected controller on hidden worlds, with a fresh salt."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from tdac_agent.evaluation.salt import SEALED, drawn_salt
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.evaluation.set_verify import verify_on_set
from tdac_agent.runs.selection_record import HIDDEN_FILE
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.terms import Terms
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.ladder.task_sets import TaskSet


def hidden_report(tasks: TaskSet, candidate: Candidate, terms: Terms) -> SetReport:
    """The verdict of a sequential test on hidden worlds; the recorded one, if any.

    The controller and the set are on record before the salt is drawn.

    Args:
        tasks: The task set.
        candidate: The selected candidate.
        terms: What the trials share.
    """
    recorder, folder = terms.recorder, terms.folder
    about = {"controller_sha256": candidate.sha256, "set_sha256": tasks.sha256}
    recorder.event("hidden.start", **about)
    report = _recorded(folder, about) if terms.trusts_record else None
    if report is None:
        report = verify_on_set(
            candidate.raw,
            tasks,
            "hidden",
            # A salt in a folder from elsewhere may be known.
            salt_file=drawn_salt(folder / SEALED, reuse=terms.trusts_record),
            lineage=recorder.run.id,
            tier=terms.tier,
            judge=terms.judge,
            watch=terms.watch(what="hidden"),
        )
        write_atomic(folder / HIDDEN_FILE, report.model_dump_json(indent=2) + "\n")
    recorder.event("hidden.end", passed=report.passed, worlds=report.worlds, **about)
    return report


def read_hidden_report(folder: Path) -> SetReport:
    """The verdict in a run folder.

    Raises:
        OSError: There is none.
        ValueError: It is damaged.
    """
    content = parse_json(read_file(folder / HIDDEN_FILE, RECORD_BYTES))
    return SetReport.model_validate(content)


def _recorded(folder: Path, about: dict[str, str]) -> SetReport | None:
    try:
        report = read_hidden_report(folder)
    except (OSError, ValueError, ValidationError):
        return None
    known = report.provenance
    same = all(getattr(known, name) == value for name, value in about.items())
    return report if same and known.split == "hidden" else None
