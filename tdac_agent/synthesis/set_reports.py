"""Reports on worlds of a task set: feedback, figures, a picture; what is on record."""

from __future__ import annotations

from pathlib import Path
from statistics import fmean

from pydantic import ValidationError

from tdac_agent.evaluation.kept_sets import TRAJECTORIES
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.prompting.feedback import Feedback, cut
from tdac_agent.runs.world_pictures import failure_pictures
from tdac_agent.synthesis.candidates import Figures
from tdac_agent.tasks.provenance import sha256_of, versions
from tdac_agent.verification.diagnosis.model_picture import FailurePicture
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.ladder.task_sets import TaskSet

SET_REPORT = "set.json"
RANKED = {"time": "mean time score"}
WORST = 4
"""The worst n-th of the worlds stands for robustness."""
REFUSED = "refused"
"""What failed if a file fails the static and contract tests."""


def set_feedback(report: SetReport) -> Feedback:
    """Categories of failure with their counts, and diagnoses of up to three episodes.

    Args:
        report: A report with a failure, on worlds of `dev`.
    """
    line = summary_of(report)
    if not report.worlds:
        lines = [f"- {cut(text)}" for text in report.told]
        text = "\n".join([f"{line[0].upper()}{line[1:]}:", *lines])
        return Feedback(text, f"{line}: {cut(report.told[0], 200)}", (REFUSED,))
    assert report.scores is not None
    parts = [
        f"On {report.worlds} worlds that were new to it: {line}. Mean score "
        f"{report.scores.time:.3f} (success weighted by time)."
    ]
    parts += [f"{n}. {cut(text)}" for n, text in enumerate(report.told, 1)]
    return Feedback("\n\n".join(parts), line, tuple(report.causes))


def summary_of(report: SetReport) -> str:
    """The result in one line, such as `5 of 8 worlds reached; 2 stuck, 1 collision`."""
    if not report.worlds:
        return "the static and contract tests refused the file, so it did not drive"
    causes = ", ".join(f"{count} {name}" for name, count in report.causes.items())
    reached = f"the goal reached in {report.successes} of {report.worlds} worlds"
    return f"{reached}; {causes}" if causes else reached


def figures_of(report: SetReport) -> Figures:
    """Mean time and path scores, success, and time score on the worst worlds."""
    episodes = report.episodes
    times = sorted(each.time_score for each in episodes)
    figures = {
        "time": fmean(times),
        "path": fmean(each.path_score for each in episodes),
        "success": fmean(each.success for each in episodes),
        "worst": fmean(times[: max(1, len(times) // WORST)]),
    }
    return Figures(figures, RANKED)


def world_picture(
    tasks: TaskSet, report: SetReport, folder: Path
) -> FailurePicture | None:
    """The picture of the first failed episode of a report that has a diagnosis.

    Args:
        tasks: The task set.
        report: A report on worlds of `dev`.
        folder: Folder of the report, with the trajectories.

    Returns:
        None if no such episode drove.

    Raises:
        ValueError: The worlds are of another split.
    """
    if report.provenance.split != "dev":
        raise ValueError(f"expected worlds of dev, got {report.provenance.split}")
    named = ((f"world {each.index}", each) for each in report.episodes)
    found = failure_pictures(tasks, named, folder / TRAJECTORIES, LARGEST_SIDE)
    return next((picture for _, picture in found), None)


def read_set_report(folder: Path) -> SetReport:
    """The report in a folder.

    Raises:
        OSError: There is none.
        ValueError: It is damaged.
    """
    content = parse_json(read_file(folder / SET_REPORT, RECORD_BYTES))
    return SetReport.model_validate(content)


def kept_report(
    folder: Path, tasks: TaskSet, source: bytes, first: int, count: int
) -> SetReport | None:
    """The report in a folder if it is about this controller and these worlds."""
    try:
        report = read_set_report(folder)
    except (OSError, ValueError, ValidationError):
        return None
    about = report.provenance
    facts = (about.set_sha256, about.split, about.controller_sha256, about.versions)
    wanted = (tasks.sha256, "dev", sha256_of(source), versions())
    numbers = [episode.index for episode in report.episodes]
    # After a failed static test, there are no episodes.
    complete = numbers in ([], list(range(first, first + count)))
    return report if facts == wanted and complete else None
