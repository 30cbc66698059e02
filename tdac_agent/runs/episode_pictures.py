"""Pictures of failed episodes: disturbed ones of a task, or on worlds of `dev`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.figures import EpisodeFigures, event_of
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
    picture_of_event,
)
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.worlds import shown_units
from tdac_envs.drawing.backdrop import Backdrop
from tdac_envs.ladder.picture import backdrop_of
from tdac_envs.ladder.task_sets import TaskSet


def failure_pictures(
    problem: Task | TaskSet,
    episodes: Iterable[tuple[str, EpisodeRow]],
    trajectories: Path,
    side: int,
) -> Iterator[tuple[str, FailurePicture]]:
    """Yields names and pictures of failed episodes that drove and have a diagnosis.

    Args:
        problem: The task or the task set.
        episodes: Episodes, on worlds of `dev`, each with the name that is printed.
        trajectories: Folder of their trajectories.
        side: Most width and height, px.
    """
    for name, episode in episodes:
        file = trajectories / f"{episode.number}.npz"
        if episode.success or episode.text is None or not file.is_file():
            continue
        trajectory = Trajectory.load(file)
        if trajectory.steps:
            yield name, _drawn(problem, name, episode, trajectory, side)


def _drawn(
    problem: Task | TaskSet,
    name: str,
    episode: EpisodeRow,
    trajectory: Trajectory,
    side: int,
) -> FailurePicture:
    task, units, backdrop = _scene(problem, episode.number)
    rollout = _rollout(task, name, episode, trajectory)
    distances = rollout.distances().tolist()
    figures = EpisodeFigures(name, rollout.outcome, distances[0], min(distances))
    found = diagnose(rollout, task, units)
    event = event_of(task, trajectory, figures, found, units)
    if isinstance(problem, TaskSet) and problem.file.frame == "start":
        heading = task.start.heading
        # Headings turn from x to y, on maps and in worlds.
        event = replace(event, axes=(heading, heading + math.pi / 2.0))
    return picture_of_event(backdrop, trajectory, event, units, side)


def _scene(problem: Task | TaskSet, number: int) -> tuple[Nominal, Units, Backdrop]:
    """The task of an episode, the units of its diagnosis, and the background."""
    if isinstance(problem, Task):
        setting = problem.setting
        return problem.nominal, setting.units, problem.pictures().backdrop()
    task = problem.task("dev", number)
    return task, shown_units(problem.file, task), backdrop_of(task)


def _rollout(
    task: Nominal, name: str, episode: EpisodeRow, trajectory: Trajectory
) -> Rollout:
    """The episode as it was diagnosed."""
    return Rollout(
        name=name,
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
