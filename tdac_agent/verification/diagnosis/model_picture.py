"""The picture of a failed episode that goes to a model."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

from PIL import Image as PilImage

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.figures import (
    EpisodeFigures,
    diagnosis_of,
    event_of,
    failed_episodes,
    figures_of,
)
from tdac_agent.verification.diagnosis.report import Diagnosis, Report
from tdac_envs.drawing.backdrop import Backdrop
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.closeup import Event, bounded_picture


@dataclass(frozen=True, slots=True, eq=False)
class FailurePicture:
    """The picture of a failed episode.

    Attributes:
        png: PNG file, without a time or name in it.
        caption: Name and cause of the episode.
        event: What it shows.
        place: Unit of the printed places.
        y_up: Whether their y axis points up, not down.
    """

    png: bytes
    caption: str
    event: Event
    place: str
    y_up: bool


def failure_picture(
    task: Task, report: Report, trajectories: dict[str, Trajectory], side: int
) -> FailurePicture | None:
    """The picture of the first failed episode whose start is not held out.

    Args:
        task: Task whose map or world is drawn.
        report: The report with the episodes and their diagnoses.
        trajectories: Trajectories by episode name.
        side: Most width and height, px.

    Returns:
        None if no such episode drove.
    """
    for episode, trajectory in failed_episodes(report, trajectories):
        if not episode.held_out and trajectory.steps:
            figures, diagnosis = figures_of(episode), diagnosis_of(report, episode)
            return episode_picture(task, figures, diagnosis, trajectory, side)
    return None


def episode_picture(
    task: Task,
    episode: EpisodeFigures,
    diagnosis: Diagnosis | None,
    trajectory: Trajectory,
    side: int,
) -> FailurePicture:
    """The picture of a failed episode of a task.

    Args:
        task: Task whose map or world is drawn.
        episode: Figures of the episode.
        diagnosis: Its diagnosis, if there is one.
        trajectory: Its trajectory.
        side: Most width and height, px.
    """
    units = task.setting.units
    event = event_of(task.nominal, trajectory, episode, diagnosis, units)
    background = task.pictures().backdrop()
    return picture_of_event(background, trajectory, event, units, side)


def picture_of_event(
    background: Backdrop, trajectory: Trajectory, event: Event, units: Units, side: int
) -> FailurePicture:
    """The picture of an episode.

    Args:
        background: Background of its task.
        trajectory: The episode.
        event: What to show.
        units: Units of the texts.
        side: Most width and height, px.
    """
    turn = units.heading_of(1.0) - units.heading_of(0.0)
    y_up = math.remainder(turn, math.tau) < 0.0
    picture = bounded_picture(background, trajectory.poses, event, side)
    place = units.printed_place
    return FailurePicture(_png(picture), event.title, event, place, y_up)


def _png(picture: Image) -> bytes:
    """A picture as a PNG file; a palette would mix up the colours of its legend."""
    stream = io.BytesIO()
    PilImage.fromarray(picture).save(stream, "PNG", optimize=True)
    return stream.getvalue()
