"""Pictures of episodes of submissions."""

from __future__ import annotations

from pathlib import Path

from tdac_agent.environments.epuck.pictures import WorldPictures
from tdac_agent.environments.map2d.pictures import MapPictures
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.mcp.answers import Refused
from tdac_agent.problems.problem import Problem
from tdac_agent.runs.world_pictures import world_pictures
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import file_stem
from tdac_agent.verification.store import TRAJECTORIES
from tdac_envs.core.intake import IMAGE_BYTES, read_file
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.mapping.map_folder import png

FEEDBACK = "feedback-1"
"""Subfolder with the episodes of a submission for a task set."""
LARGEST_SIDE = 1024
"""Most width and height of the picture of a failure, px."""


def draw(problem: Problem, submission: Candidate, episode: str) -> bytes:
    """A PNG of an episode.

    Args:
        problem: What the submission is for.
        submission: The submission.
        episode: Name of the episode, in the words of an agent.

    Raises:
        Refused: There is no such episode, or it is not shown.
    """
    if problem.task is not None:
        return _of_task(problem.task, submission, episode)
    assert problem.tasks is not None
    return _of_world(problem.tasks, submission, episode)


def _of_task(task: Task, submission: Candidate, episode: str) -> bytes:
    report, name = submission.report, episode.strip().lower().replace("_", " ")
    assert report is not None
    driven = {each.name: each for each in report.episodes if each.outcome != "not run"}
    known = [each.name for each in driven.values() if not each.held_out]
    if name in driven and name not in known:
        raise Refused(f"{name} is a held-out start: only whether it passed is told")
    if name not in known:
        raise _unknown(episode, known)
    folder = submission.folder / "trajectories"
    drawn = folder / f"{file_stem(name)}.png"
    if drawn.is_file():  # of each failed episode
        return read_file(drawn, IMAGE_BYTES)
    trajectory = _trajectory(folder / f"{file_stem(name)}.npz", name)
    pictures, movers = task.pictures(), trajectory.ghosts(trajectory.steps)
    outcome = driven[name].outcome
    return png(pictures.trajectories([trajectory.poses], [outcome], [name], movers))


def _of_world(tasks: TaskSet, submission: Candidate, episode: str) -> bytes:
    """A failure as reports show it; a success with its whole path."""
    episodes = [each for report in submission.feedback for each in report.episodes]
    known = {str(each.number): each for each in episodes}
    figures = known.get(episode.strip().lower().removeprefix("world").strip())
    if figures is None:
        raise _unknown(episode, list(known))
    name, folder = (
        f"world {figures.number}",
        submission.folder / FEEDBACK / TRAJECTORIES,
    )
    failed = world_pictures(tasks, [(name, figures)], folder, LARGEST_SIDE)
    drawn = next((picture for _, picture in failed), None)
    if drawn is not None:
        return drawn
    trajectory = _trajectory(folder / f"{figures.number}.npz", name)
    task, movers = (
        tasks.task("dev", figures.number),
        trajectory.ghosts(trajectory.steps),
    )
    poses, ended = [trajectory.poses], [figures.outcome]
    if isinstance(task, Map2DTask):
        return png(MapPictures(task).trajectories(poses, ended, [name], movers))
    return png(WorldPictures(task).trajectories(poses, ended, [name]))


def _trajectory(path: Path, name: str) -> Trajectory:
    try:
        return Trajectory.load(path)
    except RunError as error:
        raise Refused(f"there is no record of {name}") from error


def _unknown(episode: str, known: list[str]) -> Refused:
    if not known:
        return Refused("there is no picture: no episode was driven")
    names = ", ".join(known)
    return Refused(f"there is no episode {episode[:80]!r}; expected one of {names}")
