"""Pictures of failed episodes on the worlds of a task set, for people and agents."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.tasks.setting import Nominal
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.figures import EpisodeFigures, event_of
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.set_worlds import shown_units
from tdac_envs.drawing.closeup import Event, bounded_picture
from tdac_envs.ladder.picture import backdrop_of
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.task_sets import AnyTask, TaskSet
from tdac_envs.mapping.map_folder import png


def world_pictures(
    tasks: TaskSet,
    episodes: Iterable[tuple[str, EpisodeRow]],
    trajectories: Path,
    side: int,
) -> Iterator[tuple[str, bytes]]:
    """Yields names and PNG files of failed episodes on worlds of `dev`.

    Only those that drove and have a diagnosis are drawn.

    Args:
        tasks: The task set.
        episodes: Episodes, each with the name that is printed.
        trajectories: Folder of their trajectories.
        side: Most width and height, px.
    """
    for name, episode in episodes:
        file = trajectories / f"{episode.number}.npz"
        if episode.success or episode.text is None or not file.is_file():
            continue
        trajectory = Trajectory.load(file)
        if trajectory.steps:
            task = tasks.task("dev", episode.number)
            event = event_on(tasks.file, task, name, episode, trajectory)
            poses = trajectory.poses
            yield name, png(bounded_picture(backdrop_of(task), poses, event, side))


def event_on(
    level: SetFile,
    task: AnyTask,
    name: str,
    episode: EpisodeRow,
    trajectory: Trajectory,
) -> Event:
    """What the picture of a failed episode on a world shows.

    Args:
        level: The level of the world.
        task: The task on it.
        name: The name that is printed.
        episode: The episode.
        trajectory: Its trajectory.
    """
    units = shown_units(level, task)
    rollout = _rollout(task, name, episode, trajectory)
    distances = rollout.distances().tolist()
    figures = EpisodeFigures(name, rollout.outcome, distances[0], min(distances))
    found = diagnose(rollout, task, units)
    event = event_of(task, trajectory, figures, found, units)
    if level.frame != "start":
        return event
    heading = task.start.heading
    # Headings turn from x to y, on maps and in worlds.
    return replace(event, axes=(heading, heading + math.pi / 2.0))


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
