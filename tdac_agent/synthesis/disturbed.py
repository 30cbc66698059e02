"""Disturbed episodes of candidates for a task: their seeds, and what they show."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

from tdac_agent.prompting.feedback import Feedback, cut
from tdac_agent.runs.improvement_record import goals_text
from tdac_agent.runs.run_record import Run
from tdac_agent.storage.hashes import number_of
from tdac_agent.synthesis.candidates import Figures
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import UNITS, Units
from tdac_agent.verification.confirmation import CONFIRMATION
from tdac_agent.verification.diagnosis.gap import too_close_text
from tdac_agent.verification.diagnosis.measures import least_steps
from tdac_agent.verification.diagnosis.report import Diagnosis, Failure, Report
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.verdict import confirmed_text
from tdac_envs.drive.scores import time_score

PURPOSES = ("improve", "comparison")
"""What the episodes are for, in the order of their seeds."""
FIRST_SEED = 2**33
"""Greater than the seeds that `tdac verify -n` chooses by default."""
SEEDS = 2**32
"""Number of seeds for each purpose."""
MOST_TOLD = 3
"""Failures whose diagnosis is told."""
RANKED = {"robustness": "goals reached", "time": "mean time score"}


def named(number: int) -> str:
    """Name of an episode in texts, by its number from 1."""
    return f"disturbed episode {number}"


def seeds_for(run: Run, purpose: str, count: int) -> range:
    """The seeds of the episodes of a run for a purpose."""
    first = number_of(f"disturbed|{run.seed}|{run.index}") % (SEEDS - MOST_EPISODES)
    first += FIRST_SEED + PURPOSES.index(purpose) * SEEDS
    return range(first, first + count)


def reached_of(row: EpisodeRow) -> float:
    """1 if an episode reached the goal, else 0."""
    return float(row.success)


def time_of(row: EpisodeRow) -> float:
    """Time score of an episode."""
    return row.time_score


def successes_of(rows: Sequence[EpisodeRow]) -> list[float]:
    """1 for each episode that reached the goal, else 0."""
    return list(map(reached_of, rows))


def told(driven: EpisodeReport) -> str:
    """The result in one line."""
    return goals_text(driven.successes, driven.count)


def disturbed_feedback(driven: EpisodeReport) -> str | None:
    """Causes of failures, and diagnoses of some; None without a failure."""
    if not driven.failures:
        return None
    counts = ", ".join(f"{count} {cause}" for cause, count in driven.causes.items())
    texts = [
        each.text.replace(f"seed {each.seed}", named(number), 1)
        for number, each in enumerate(driven.episodes, 1)
        if each.text
    ]
    line = told(driven)
    parts = [f"{line[0].upper()}{line[1:]}; {counts}."]
    parts += [f"{n}. {cut(text)}" for n, text in enumerate(texts[:MOST_TOLD], 1)]
    return "\n\n".join(parts)


def confirmation_feedback(report: Report, driven: EpisodeReport) -> Feedback:
    """What the models are told about a confirmation that failed.

    Args:
        report: The report of the suite, which the candidate passed.
        driven: The confirmation. Another one will have other starts.
    """
    line = f"all tests passed, but {confirmed_text(driven)}"
    bad = [each for each in driven.episodes if each.too_close or not each.success]
    units = UNITS[driven.provenance.unit]
    failures = tuple(_as_failure(each, units) for each in bad)
    found = disturbed_feedback(driven) or f"{confirmed_text(driven)}."
    text = (
        "All tests passed. Then it drove blind, from other starts, with "
        f"{driven.provenance.disturbance}. {found}"
    )
    as_failed = report.model_copy(update={"failures": failures})
    return Feedback(text, line, (CONFIRMATION,), as_failed)


def _as_failure(episode: EpisodeRow, units: Units) -> Failure:
    """A drive that failed or came too close, as a failed test of the suite."""
    text = episode.text or episode.error or episode.outcome
    cause = episode.cause or "error"
    if episode.too_close:
        assert episode.smallest_gap is not None
        text, cause = (
            f"it came {too_close_text(episode.smallest_gap, units)}",
            "collision",
        )
    diagnosis = Diagnosis(cause=cause, text=text)
    return Failure(
        test=f"{CONFIRMATION}::drive",
        group="end to end",
        message=text,
        diagnosis=diagnosis,
    )


def task_figures(task: Task, report: Report, rows: Sequence[EpisodeRow]) -> Figures:
    """Share of goals, mean time score, time of the nominal episode, clearance.

    Args:
        task: The task.
        report: The report that verified the candidate.
        rows: Its disturbed episodes.
    """
    nominal = next(each for each in report.episodes if each.name == "nominal")
    least = least_steps(task.nominal)
    figures = {
        "robustness": fmean(successes_of(rows)),
        "time": fmean(map(time_of, rows)),
        "nominal": time_score(nominal.outcome == "reached", nominal.steps, least),
        "clearance": fmean(each.gap_left for each in rows),
    }
    return Figures(figures, RANKED)
