"""Pictures of failures on worlds of `dev`, for models that see."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.evaluation.kept_sets import TRAJECTORIES
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.figures import EpisodeFigures, event_of
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
    picture_of_event,
)
from tdac_agent.verification.judge.set_job import WorldEpisode, shown_units
from tdac_envs.ladder.picture import backdrop_of
from tdac_envs.ladder.task_sets import AnyTask, TaskSet


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
    for episode in report.episodes:
        file = folder / TRAJECTORIES / f"{episode.index}.npz"
        if episode.success or episode.text is None or not file.is_file():
            continue
        trajectory = Trajectory.load(file)
        if trajectory.steps:
            task = tasks.task("dev", episode.index)
            return _drawn(tasks, task, episode, trajectory)
    return None


def _drawn(
    tasks: TaskSet, task: AnyTask, episode: WorldEpisode, trajectory: Trajectory
) -> FailurePicture:
    units, rollout = shown_units(tasks.file, task), _rollout(task, episode, trajectory)
    distances = rollout.distances().tolist()
    figures = EpisodeFigures(
        rollout.name, rollout.outcome, distances[0], min(distances)
    )
    found = diagnose(rollout, task, units)
    event = event_of(task, trajectory, figures, found, units)
    if tasks.file.frame == "start":
        heading = task.start.heading
        # Headings turn from x to y, on maps and in worlds.
        event = replace(event, axes=(heading, heading + math.pi / 2.0))
    return picture_of_event(backdrop_of(task), trajectory, event, units, LARGEST_SIDE)


def _rollout(task: AnyTask, episode: WorldEpisode, trajectory: Trajectory) -> Rollout:
    """The episode as it was diagnosed."""
    return Rollout(
        name=f"world {episode.index}",
        held_out=False,
        outcome=episode.outcome,
        trajectory=trajectory,
        goal=task.goal,
        radius=task.body_radius,
        tolerance=task.goal_tolerance,
        error=episode.error,
        timed_out=episode.cause == "time-out",
        contact=episode.contact,
    )
