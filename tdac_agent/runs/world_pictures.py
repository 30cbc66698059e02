"""Pictures of failed episodes on worlds of `dev` of a task set."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.figures import EpisodeFigures, event_of
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
    picture_of_event,
)
from tdac_agent.verification.judge.set_job import WorldEpisode, shown_units
from tdac_envs.ladder.picture import backdrop_of
from tdac_envs.ladder.task_sets import AnyTask, TaskSet


def failure_pictures(
    tasks: TaskSet,
    episodes: Iterable[tuple[str, WorldEpisode]],
    trajectories: Path,
    side: int,
) -> Iterator[tuple[str, FailurePicture]]:
    """Yields names and pictures of failed episodes that drove and have a diagnosis.

    Args:
        tasks: The task set.
        episodes: Episodes on worlds of `dev`, each with the name that is printed.
        trajectories: Folder of their trajectories.
        side: Most width and height, px.
    """
    for name, episode in episodes:
        file = trajectories / f"{episode.index}.npz"
        if episode.success or episode.text is None or not file.is_file():
            continue
        trajectory = Trajectory.load(file)
        if trajectory.steps:
            yield name, _drawn(tasks, name, episode, trajectory, side)


def _drawn(
    tasks: TaskSet, name: str, episode: WorldEpisode, trajectory: Trajectory, side: int
) -> FailurePicture:
    task = tasks.task("dev", episode.index)
    units = shown_units(tasks.file, task)
    rollout = _rollout(task, name, episode, trajectory)
    distances = rollout.distances().tolist()
    figures = EpisodeFigures(name, rollout.outcome, distances[0], min(distances))
    found = diagnose(rollout, task, units)
    event = event_of(task, trajectory, figures, found, units)
    if tasks.file.frame == "start":
        heading = task.start.heading
        # Headings turn from x to y, on maps and in worlds.
        event = replace(event, axes=(heading, heading + math.pi / 2.0))
    return picture_of_event(backdrop_of(task), trajectory, event, units, side)


def _rollout(
    task: AnyTask, name: str, episode: WorldEpisode, trajectory: Trajectory
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
