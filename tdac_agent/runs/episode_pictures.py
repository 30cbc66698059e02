"""Pictures of failed episodes: disturbed ones of a task, or on worlds of a set."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
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
from tdac_envs.drawing.backdrop import Backdrop


@dataclass(frozen=True, slots=True)
class Scene:
    """Where an episode took place.

    Attributes:
        task: Its task.
        units: Units of its diagnosis.
        backdrop: The background of its picture.
        axes: Headings of the axes of the frame of the diagnosis, if it is the robot's
            at its start.
    """

    task: Nominal
    units: Units
    backdrop: Backdrop
    axes: tuple[float, float] | None = None


def scene_of(task: Task) -> Scene:
    """The scene of all episodes of a task."""
    return Scene(task.nominal, task.setting.units, task.pictures().backdrop())


def failure_pictures(
    scene: Callable[[int], Scene],
    episodes: Iterable[tuple[str, EpisodeRow]],
    trajectories: Path,
    side: int,
) -> Iterator[tuple[str, FailurePicture]]:
    """Yields names and pictures of failed episodes that drove and have a diagnosis.

    Args:
        scene: Returns the scene of an episode, by its number.
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
            yield name, _drawn(scene(episode.number), name, episode, trajectory, side)


def _drawn(
    scene: Scene,
    name: str,
    episode: EpisodeRow,
    trajectory: Trajectory,
    side: int,
) -> FailurePicture:
    task, units = scene.task, scene.units
    rollout = _rollout(task, name, episode, trajectory)
    distances = rollout.distances().tolist()
    figures = EpisodeFigures(name, rollout.outcome, distances[0], min(distances))
    found = diagnose(rollout, task, units)
    event = event_of(task, trajectory, figures, found, units)
    if scene.axes is not None:
        event = replace(event, axes=scene.axes)
    return picture_of_event(scene.backdrop, trajectory, event, units, side)


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
