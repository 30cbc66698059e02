"""The blind confirmation of a candidate of a run; one on record is reused."""

from __future__ import annotations

from dataclasses import replace

from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.candidates import Candidate, Result
from tdac_agent.synthesis.disturbed import confirmation_feedback
from tdac_agent.synthesis.terms import Terms
from tdac_agent.tasks.task import Task
from tdac_agent.verification.confirmation import (
    CONFIRMATION,
    CONFIRMATION_FILE,
    confirm,
    confirming_seeds,
    kept_confirmation,
)
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.store import REPORT_FILE
from tdac_agent.verification.verdict import confirmed_text, is_verified, word_of


def drive_blind(
    terms: Terms, task: Task, candidate: Candidate, number: int
) -> EpisodeReport:
    """The confirmation of a candidate.

    Args:
        terms: What the trials share.
        task: The task.
        candidate: A candidate that passed the suite.
        number: Number of the confirmation in the run, from 1.
    """
    recorder, out = terms.recorder, candidate.folder / CONFIRMATION
    seeds, file = confirming_seeds(candidate.raw, task, number), out / REPORT_FILE
    most = {"episodes": len(seeds), "number": number}
    about = {"k": candidate.k, "j": candidate.j, "what": CONFIRMATION, **most}
    recorder.event("drive.start", **about)
    found = None
    if recorder.vouches(file):
        found = kept_confirmation(out, candidate.raw, task, number)
    if found is None:
        found = confirm(
            *(candidate.raw, task, number),
            tier=terms.tier,
            out=out,
            judge=terms.judge,
            watch=terms.watch(**about),
        )
        recorder.vouch(file)
    facts = {"reached": found.successes, "driven": found.count}
    recorder.event("drive.end", **about, **facts, word=word_of(found))
    return found


def confirmed_result(
    tested: Result, report: Report, confirmation: EpisodeReport
) -> Result:
    """The result of a candidate that drove blind.

    Args:
        tested: What the suite found.
        report: The report of the suite.
        confirmation: The confirmation.
    """
    said = confirmed_text(confirmation)
    failure, passed = tested.failure, is_verified(confirmation)
    if not passed:
        failure = confirmation_feedback(report, confirmation)
    assert failure is not None
    first, *rest = tested.rank
    return replace(
        tested,
        passed=passed,
        rank=(first + float(passed), *rest),
        failure=failure,
        summary=f"{tested.summary}; {said}",
        said=said,
        failed=failure.failed,
        confirmed=passed,
    )


def keep_confirmation(terms: Terms, candidate: Candidate) -> None:
    """Writes the confirmation of the delivered candidate beside its report."""
    file, found = terms.folder / CONFIRMATION_FILE, candidate.confirmation
    if found is None:
        file.unlink(missing_ok=True)
        return
    write_atomic(file, found.model_dump_json(indent=2) + "\n")
    terms.recorder.vouch(file)
