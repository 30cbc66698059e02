"""Pictures of judged episodes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.course import path_ahead
from tdac_agent.verification.diagnosis.mover import nearest_mover
from tdac_agent.verification.diagnosis.report import Diagnosis, Episode, Report
from tdac_agent.verification.diagnosis.surroundings import (
    surroundings_of,
    trajectory_on_screen,
)
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.closeup import Event, run_picture
from tdac_envs.drive.task import Pose

MAX_FACT = 240


class EpisodeFigures(NamedTuple):
    """Figures of a failed episode for its picture.

    Attributes:
        name: Its name.
        outcome: How it ended.
        d0: Remaining path at the start, px or m.
        d_min: Least remaining path, px or m.
        held_out: Whether its start is held out.
    """

    name: str
    outcome: str
    d0: float
    d_min: float
    held_out: bool = False


def figures_of(episode: Episode) -> EpisodeFigures:
    """The figures of an episode of a report."""
    return EpisodeFigures(*(getattr(episode, name) for name in EpisodeFigures._fields))


def draw_trajectories(
    task: Task,
    trajectories: dict[str, Trajectory],
    outcomes: dict[str, str],
    path: Path,
) -> None:
    """Writes a PNG of the map or world with trajectories and outcomes by episode."""
    picture = task.pictures().trajectories(
        [trajectory.poses for trajectory in trajectories.values()],
        [outcomes.get(name, "") for name in trajectories],
        list(trajectories),
        _movers_of(trajectories),
    )
    write_png(picture, path)


def _movers_of(trajectories: dict[str, Trajectory]) -> list[NDArray[np.float64]]:
    """The movers at the end of the first trajectory."""
    first = next(iter(trajectories.values()), None)
    return [] if first is None else first.ghosts(first.steps)


def draw_failures(
    task: Task, report: Report, trajectories: dict[str, Trajectory], folder: Path
) -> list[Path]:
    """Writes a picture `NAME.png` of each failed episode; returns the files.

    Args:
        task: Task whose map or world is drawn.
        report: The report with the episodes and their diagnoses.
        trajectories: Trajectories by episode name; without one there is no picture.
        folder: Existing folder to write to.
    """
    background, files = None, []
    for episode, trajectory in failed_episodes(report, trajectories):
        background = background or task.pictures().backdrop()
        diagnosis = diagnosis_of(report, episode)
        event = event_of(
            task.nominal,
            trajectory,
            figures_of(episode),
            diagnosis,
            task.setting.shown,
        )
        picture = run_picture(background, trajectory.poses, event)
        files.append(folder / f"{file_stem(episode.name)}.png")
        write_png(picture, files[-1])
    return files


def failed_episodes(
    report: Report, trajectories: dict[str, Trajectory]
) -> Iterator[tuple[Episode, Trajectory]]:
    """Yields failed episodes that have a trajectory."""
    for episode in report.episodes:
        trajectory = trajectories.get(episode.name)
        # The file may hold an episode of `run_episode` from the same start.
        if trajectory is None or trajectory.steps != episode.steps:
            continue
        if episode.outcome not in ("reached", "not run"):
            yield episode, trajectory


def diagnosis_of(report: Report, episode: Episode) -> Diagnosis | None:
    """The diagnosis of an episode, if there is one."""
    diagnoses = (failure.diagnosis for failure in report.failures)
    return next(
        (d for d in diagnoses if d is not None and d.episode == episode.name), None
    )


def file_stem(name: str) -> str:
    """Name of an episode's files without suffix: `jitter_1` for `jitter 1`."""
    return name.replace(" ", "_")


def event_of(
    task: Nominal,
    trajectory: Trajectory,
    episode: EpisodeFigures,
    diagnosis: Diagnosis | None,
    units: Units | None = None,
) -> Event:
    """What the picture of a failed episode shows; the outcome if no cause is known.

    Args:
        task: Its task.
        trajectory: Its trajectory.
        episode: Its figures.
        diagnosis: Its diagnosis, if there is one.
        units: Units of the texts, from `Setting.shown`; None for the environment's.
    """
    around = surroundings_of(task, units)
    units, shown = around.units, trajectory_on_screen(trajectory, around.units)
    end = Pose(*shown.poses[-1].tolist())
    held_out = " (held out)" if episode.held_out else ""
    title = f"{episode.name}{held_out}: {episode.outcome}"
    facts = [f"ended in step {trajectory.steps} at {units.point(*end[:2])}"]
    where = trajectory.poses[-1:, :2]
    if diagnosis is not None:
        title = f"{episode.name}: {diagnosis.cause}"
        facts = _facts(diagnosis)
        where = _where(task, trajectory, diagnosis)
    d_min, d0 = (units.scale * d for d in (episode.d_min, episode.d0))
    way = path_ahead(around, shown, trajectory.steps)
    return Event(
        title=title,
        facts=(
            *facts,
            f"grid path left: {units.amount(d_min, 0)} of {units.far(d0, 0)}",
        ),
        where=where,
        contact=contact_of(task, trajectory, episode.outcome),
        movers=trajectory.ghosts(trajectory.steps),
        way=None if way is None else np.array([units.place_of(x, y) for x, y in way]),
    )


def contact_of(
    task: Nominal, trajectory: Trajectory, outcome: str
) -> tuple[float, float] | None:
    """The point that the body touched at the end of an episode, px or m."""
    if outcome != "collision":
        return None
    around = surroundings_of(task)
    end = Pose(*around.units.on_screen(trajectory.poses[-1:])[0].tolist())
    touch = around.touch(end, around.radius + 3.0)
    shown = trajectory_on_screen(trajectory, around.units)
    mover = nearest_mover(shown, around.radius)
    if mover is not None and (touch is None or mover.gap < touch.gap):
        return around.units.place_of(*mover.place)
    return None if touch is None else around.units.place_of(*touch.wall)


def _facts(diagnosis: Diagnosis) -> list[str]:
    """The first sentence of a diagnosis and its heading error, in ASCII."""
    head = f"{diagnosis.episode}: "
    words = diagnosis.text.removeprefix(head).removeprefix(diagnosis.cause)
    sentence = words.lstrip(": ").partition(". ")[0].replace("°", " deg")
    facts = [sentence.encode("ascii", "replace").decode()[:MAX_FACT]]
    if diagnosis.heading_error is not None:
        error = math.degrees(diagnosis.heading_error)
        side = "right" if error > 0 else "left"
        facts.append(f"heading error {abs(error):.0f} deg, path to the {side}")
    return facts


def _where(
    task: Nominal, trajectory: Trajectory, diagnosis: Diagnosis
) -> NDArray[np.float64]:
    """The positions to show enlarged, shape (n, 2)."""
    places = trajectory.poses[:, :2]
    if diagnosis.cause in ("stuck", "spinning", "oscillating"):
        return places[diagnosis.step :]
    if diagnosis.cause == "missed goal":
        return np.vstack([places[diagnosis.step], places[-1], task.goal])
    return places[-1:]


def write_png(picture: Image, path: Path) -> None:
    """Writes an RGB picture as a PNG file."""
    encoded = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1]
    write_atomic(path, encoded.tobytes())
