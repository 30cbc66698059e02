"""A task that is being put together by clicks, and whether a robot can drive it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.runs.ownership import load_task
from tdac_agent.studio.bottleneck import Bottleneck, bottleneck_on
from tdac_agent.studio.source_view import Kind, Place, SourceView
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import TaskFile
from tdac_envs.core.errors import TdacError
from tdac_envs.map2d.task import Map2DTask

DIGITS = {"px": 1, "m": 3}
"""Decimals of clicked places."""


@dataclass(frozen=True, slots=True)
class TaskDraft:
    """What has been chosen so far.

    Attributes:
        kind: Whether the source is a map or a world.
        source: Bundled name, or path of a file, relative to the studio's folder.
        start: Start, px or m.
        goal: Goal.
        heading: Start heading, rad, from +x towards +y; None for that of the file.
        radius: Body radius, px; of a map only.
        polarity: Which pixels of the map are obstacles; None to infer it.
    """

    kind: Kind
    source: str
    start: Place | None = None
    goal: Place | None = None
    heading: float | None = None
    radius: float | None = None
    polarity: str | None = None

    @classmethod
    def of(
        cls, view: SourceView, source: str, polarity: str | None = None
    ) -> TaskDraft:
        """The task of the file itself, as far as it has one."""
        start = None if view.start is None else (view.start[0], view.start[1])
        heading = None if view.start is None else view.start[2]
        radius = view.radius or (15.0 if view.kind == "map" else None)
        return cls(view.kind, source, start, view.goal, heading, radius, polarity)

    def words(self) -> list[str]:
        """The flags of the command line that name this task."""
        words = [f"--{self.kind}", self.source]
        for flag, place in (("--start", self.start), ("--goal", self.goal)):
            if place is not None:
                words += [flag, *(f"{value:g}" for value in place)]
        if self.heading is not None and self.start is not None:
            words += ["--heading", f"{self.heading:g}"]
        if self.radius is not None:
            words += ["--robot-radius", f"{self.radius:g}"]
        if self.polarity is not None:
            words += ["--polarity", self.polarity]
        return words

    def with_start(self, place: Place, unit: str) -> TaskDraft:
        """The draft with a clicked start."""
        return replace(self, start=_rounded(place, unit))

    def with_goal(self, place: Place, unit: str) -> TaskDraft:
        """The draft with a clicked goal."""
        return replace(self, goal=_rounded(place, unit))

    def facing(self, place: Place) -> TaskDraft:
        """The draft with a robot that faces a place; without a start, unchanged."""
        if self.start is None or place == self.start:
            return self
        over, down = place[0] - self.start[0], place[1] - self.start[1]
        return replace(self, heading=round(math.atan2(down, over), 3))

    def task_file(self) -> TaskFile:
        """The same as a task file."""
        start: tuple[float, ...] | None = self.start
        if start is not None and self.heading is not None:
            start = (*start, self.heading)
        given: dict[str, Any] = {"start": start, "goal": self.goal}
        if self.kind == "world":
            given |= {"env": "TDAC-EPuck-v0", "world": self.source}
            return TaskFile(**given)
        given |= {"map": self.source, "robot": {"radius": self.radius}}
        return TaskFile(**given, polarity=self.polarity)


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """Whether a robot can drive a draft.

    Attributes:
        task: The task, if it can.
        problem: Why not.
        path: Shortest path, shape (n, 2).
        narrowest: Its narrowest passage.
        widest: Largest body radius that gets through on any path, px; None if it is not
            known.
        picture: The map as it was read for this task.
    """

    task: Task | None
    problem: str = ""
    path: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    narrowest: Bottleneck | None = None
    widest: float | None = None
    picture: bytes | None = None


def check(draft: TaskDraft, view: SourceView, place: Path) -> Checked:
    """Loads the task of a draft, as the command would.

    Args:
        draft: The draft; it must have a goal, and a start unless the world has one.
        view: Its view.
        place: Folder of the studio.
    """
    widest = None
    if view.widest is not None and draft.start and draft.goal:
        widest = view.widest(draft.start, draft.goal)
    try:
        task = load_task(draft.task_file(), base=place)
    except (TdacError, ValueError) as error:
        return Checked(None, " ".join(str(error).split()), widest=widest)
    nominal = task.nominal
    path = np.asarray(nominal.shortest_path(nominal.start), np.float64)
    narrowest = bottleneck_on(nominal, path)
    picture = None
    if view.laid_over is not None and isinstance(nominal, Map2DTask):
        picture = view.laid_over(nominal.terrain.grid.cells)
    return Checked(task, "", path, narrowest, widest, picture)


def snapped(draft: TaskDraft, place: Path) -> TaskDraft:
    """The draft with start and goal at the nearest free places.

    Raises:
        TdacError: There are none.
    """
    file = draft.task_file().model_copy(update={"snap": True})
    nominal = load_task(file, base=place).nominal
    start, goal = nominal.start, nominal.goal
    return replace(
        draft,
        start=(float(start[0]), float(start[1])),
        goal=(float(goal[0]), float(goal[1])),
    )


def _rounded(place: Place, unit: str) -> Place:
    digits = DIGITS[unit]
    return round(float(place[0]), digits), round(float(place[1]), digits)
