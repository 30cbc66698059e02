"""Pictures of failed episodes on the worlds of a task set."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from tdac_agent.runs.episode_pictures import Scene, failure_pictures
from tdac_agent.verification.diagnosis.model_picture import FailurePicture
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.set_worlds import shown_units
from tdac_envs.ladder.picture import backdrop_of
from tdac_envs.ladder.task_sets import TaskSet


def world_pictures(
    tasks: TaskSet,
    episodes: Iterable[tuple[str, EpisodeRow]],
    trajectories: Path,
    side: int,
) -> Iterator[tuple[str, FailurePicture]]:
    """Yields names and pictures of failed episodes on worlds of `dev`.

    Args:
        tasks: The task set.
        episodes: As in `failure_pictures`.
        trajectories: Folder of their trajectories.
        side: Most width and height, px.
    """
    return failure_pictures(partial(_scene, tasks), episodes, trajectories, side)


def _scene(tasks: TaskSet, number: int) -> Scene:
    """The scene of an episode on world `number` of `dev`."""
    task = tasks.task("dev", number)
    axes, heading = None, task.start.heading
    if tasks.file.frame == "start":
        # Headings turn from x to y, on maps and in worlds.
        axes = heading, heading + math.pi / 2.0
    return Scene(task, shown_units(tasks.file, task), backdrop_of(task), axes)
