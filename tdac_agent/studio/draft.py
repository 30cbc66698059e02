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
from tdac_envs.drive.stepping import wrap_angle
from tdac_envs.grid.plan import path_length
from tdac_envs.map2d.source import has_resolution
from tdac_envs.map2d.task import Map2DTask

DIGITS = {"px": 1, "m": 3}
"""Decimals of clicked places."""
LEAST_RADIUS, RADIUS_STEP = 1.0, 0.5
"""Of the slider for the robot's radius, px."""
ELSEWHERE = 0.5
"""By how much half of a passage must be less than the widest radius, px, if that gets
through elsewhere: it is measured between walls, the radius from pixel to pixel."""


@dataclass(frozen=True, slots=True)
class TaskDraft:
    """What has been chosen so far.

    Attributes:
        kind: Whether the source is a map or a world.
        source: Bundled name, or path of a file, relative to the studio's folder.
        start: Start, px or m.
        goal: Goal.
        heading: Start heading, rad, from +x towards +y; None for that of the file.
        radius: Body radius, px; of a map only. A named robot has its own.
        polarity: Which pixels of the map are obstacles; None to infer it.
        robot: Name of a robot; None for a disc of this radius, or the world's e-puck.
    """

    kind: Kind
    source: str
    start: Place | None = None
    goal: Place | None = None
    heading: float | None = None
    radius: float | None = None
    polarity: str | None = None
    robot: str | None = None

    @classmethod
    def of(
        cls, view: SourceView, source: str, polarity: str | None = None
    ) -> TaskDraft:
        """The task of the file itself, as far as it has one."""
        start = None if view.start is None else (view.start[0], view.start[1])
        heading = None if view.start is None else view.start[2]
        return cls(view.kind, source, start, view.goal, heading, view.radius, polarity)

    def words(self) -> list[str]:
        """The flags of the command line that name this task."""
        words = [f"--{self.kind}", self.source]
        for flag, place in (("--start", self.start), ("--goal", self.goal)):
            if place is not None:
                words += [flag, *(f"{value:g}" for value in place)]
        if self.heading is not None and self.start is not None:
            words += ["--heading", f"{self.heading:g}"]
        if self.robot is not None:
            words += ["--robot", self.robot]
        elif self.radius is not None:
            words += ["--robot-radius", f"{self.radius:g}"]
        if self.kind == "map" and has_resolution(self.source):
            words += ["--frame", "pixels"]
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

    def turned(self, angle: float) -> TaskDraft:
        """The draft with another start heading.

        Args:
            angle: How far it turns, rad, from +x towards +y.
        """
        wrapped = wrap_angle((self.heading or 0.0) + angle)
        return replace(self, heading=round(wrapped, 3))

    def task_file(self) -> TaskFile:
        """The same as a task file."""
        start: tuple[float, ...] | None = self.start
        if start is not None and self.heading is not None:
            start = (*start, self.heading)
        values: dict[str, Any] = {"start": start, "goal": self.goal}
        if self.robot is not None:
            values["robot"] = {"file": self.robot}
        elif self.radius is not None:
            values["robot"] = {"radius": self.radius}
        if self.kind == "world":
            values |= {"env": "TDAC-EPuck-v0", "world": self.source}
            return TaskFile(**values)
        values |= {"map": self.source}
        return TaskFile(**values, polarity=self.polarity)


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


def fitting_radius(draft: TaskDraft, checked: Checked | None) -> float | None:
    """The largest radius of the slider that gets through; None if that is no help."""
    if checked is None or checked.widest is None or draft.radius is None:
        return None
    if draft.robot is not None:
        return None
    fitting = math.floor(checked.widest / RADIUS_STEP) * RADIUS_STEP
    return fitting if LEAST_RADIUS <= fitting < draft.radius else None


def sentence_of(checked: Checked, view: SourceView) -> tuple[str, bool]:
    """What was found, and whether it is good."""
    if checked.task is None:
        return checked.problem, False
    reach = checked.task.nominal.goal_tolerance
    text = (
        f"A path of {path_length(checked.path):.4g} {view.unit}; the goal is reached "
        f"within {reach:.3g} {view.unit} (green disc)"
    )
    return f"{text}.{_about_passage(checked, view.unit)}", True


def _about_passage(checked: Checked, unit: str) -> str:
    """How wide the narrowest passage of the path is, and for which robots."""
    narrowest, widest = checked.narrowest, checked.widest
    if narrowest is None:
        return ""
    if narrowest.at != "path":
        away = narrowest.width / 2.0
        text = f"It is narrowest at the {narrowest.at}, {away:.3g} {unit} from a wall"
    else:
        text = f"Its narrowest passage (bar) is {narrowest.width:.3g} {unit} wide"
    if widest is None:
        return f" {text}."
    if narrowest.width / 2.0 > widest - ELSEWHERE:
        return f" {text}: room for a radius of {widest:g} {unit}."
    return f" {text}; another path has room for a radius of {widest:g} {unit}."


def _rounded(place: Place, unit: str) -> Place:
    digits = DIGITS[unit]
    return round(float(place[0]), digits), round(float(place[1]), digits)
