"""Pictures of failures on worlds of `dev`, for models that see."""

from __future__ import annotations

from pathlib import Path

from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.runs.episode_pictures import failure_pictures
from tdac_agent.verification.diagnosis.model_picture import FailurePicture
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.store import TRAJECTORIES
from tdac_envs.ladder.task_sets import TaskSet


def world_picture(
    tasks: TaskSet, report: EpisodeReport, folder: Path
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
