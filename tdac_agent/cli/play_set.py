"""`tdac play --set`: shows an episode on a world of a task set."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from tdac_agent.cli.flags import check_tier
from tdac_agent.cli.play import check_video, show
from tdac_agent.environments.epuck.pictures import WorldPictures
from tdac_agent.environments.map2d.pictures import MapPictures
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.evaluation.policies import entrants_of, fitted
from tdac_agent.evaluation.replay import check_shown, drive_episode
from tdac_agent.planners.planner import planner_names, planner_on
from tdac_agent.problems.episodes import Part, episodes_of
from tdac_envs.drawing.canvas import Image
from tdac_envs.ladder.task_sets import AnyTask, TaskSet, load_set
from tdac_envs.map2d.task import Map2DTask


def run(
    controller: str,
    name: str,
    split: str,
    index: int,
    video: Path | None,
    speed: float | None,
    tier: str,
) -> int:
    """Plays an episode; returns 0 if the goal was reached, else 1."""
    check_tier(tier)
    check_shown(split)
    check_video(video)
    tasks = load_set(name)
    episodes_of(tasks).compile()
    with tempfile.TemporaryDirectory(prefix="tdac-play-") as folder:
        (named,) = entrants_of([_file_of(controller, tasks, folder)])
        task = tasks.task(split, index)
        part, entrant = Part((index,), split), fitted(named, tasks)
        rollout = drive_episode(entrant, tasks, part, tier).rollout
    title = f"{tasks.name}, {split} {index}"
    return show(rollout, partial(_frames, task, rollout), title, video, speed)


def _file_of(controller: str, tasks: TaskSet, folder: str) -> str:
    """A file with a classical planner of that name; else the word itself."""
    if controller not in planner_names() or Path(controller).exists():
        return controller
    path = Path(folder) / f"{controller}.py"
    path.write_text(planner_on(controller, tasks).source, encoding="utf-8")
    return str(path)


def _frames(task: AnyTask, rollout: Rollout, stride: int) -> Iterator[Image]:
    if isinstance(task, Map2DTask):
        return MapPictures(task).frames(rollout, stride)
    return WorldPictures(task).frames(rollout, stride)
