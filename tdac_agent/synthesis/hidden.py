"""The one evaluation of a selected controller on hidden worlds, with a fresh salt."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import identity_of
from tdac_agent.runs.selection_record import HIDDEN_FILE
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.terms import Terms
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.salt import SEALED, drawn_salt
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet


def hidden_report(tasks: TaskSet, candidate: Candidate, terms: Terms) -> EpisodeReport:
    """The verdict of a sequential test on hidden worlds; the recorded one, if any.

    The controller and the set are on record before the salt is drawn.

    Args:
        tasks: The task set.
        candidate: The selected candidate.
        terms: What the trials share.
    """
    recorder, folder = terms.recorder, terms.folder
    same = identity_of(episodes_of(tasks))
    about = {"controller_sha256": candidate.sha256, **same}
    recorder.event("hidden.start", **about)
    known = recorder.vouches(folder / HIDDEN_FILE)
    report = _recorded(folder, about) if known else None
    if report is None:
        report = verify_episodes(
            candidate.raw,
            tasks,
            split="hidden",
            # A salt in a folder from elsewhere may be known.
            salt_file=drawn_salt(folder / SEALED, reuse=terms.trusts_record),
            lineage=recorder.run.id,
            tier=terms.tier,
            judge=terms.judge,
            watch=terms.watch(what="hidden"),
        )
        write_atomic(folder / HIDDEN_FILE, report.model_dump_json(indent=2) + "\n")
        recorder.vouch(folder / HIDDEN_FILE)
    recorder.event("hidden.end", passed=report.passed, worlds=report.count, **about)
    return report


def read_hidden_report(folder: Path) -> EpisodeReport:
    """The verdict in a run folder.

    Raises:
        OSError: There is none.
        ValueError: It is damaged.
    """
    content = parse_json(read_file(folder / HIDDEN_FILE, RECORD_BYTES))
    return EpisodeReport.model_validate(content)


def _recorded(folder: Path, about: dict[str, str]) -> EpisodeReport | None:
    try:
        report = read_hidden_report(folder)
    except (OSError, ValueError, ValidationError):
        return None
    known = report.provenance
    same = all(getattr(known, name) == value for name, value in about.items())
    return report if same and known.split == "hidden" else None
