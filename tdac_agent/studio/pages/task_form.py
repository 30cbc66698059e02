"""The second section of the start page: start, heading, goal and the robot's size."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace

from nicegui import ui

from tdac_agent.studio.draft import (
    LEAST_RADIUS,
    RADIUS_STEP,
    Checked,
    TaskDraft,
    fitting_radius,
)
from tdac_agent.studio.source_view import SourceView
from tdac_envs.robots.robot_file import RobotFile

NAMES = "start x", "start y", "heading, rad", "goal x", "goal y"
RADIUS = 15.0
"""Of the robot on a map that names none, px."""


class TaskForm:
    """The numbers of a draft, what was found about it, and help if it is refused.

    Args:
        typed: Called when a number was typed.
        resized: Called when the slider was moved.
        named: Called when a robot was chosen.
        snap: Called to move start and goal to free places.
        fit: Called to take a radius that gets through.
    """

    def __init__(
        self,
        typed: Callable[[], Awaitable[None]],
        resized: Callable[[], Awaitable[None]],
        named: Callable[[], Awaitable[None]],
        snap: Callable[[], Awaitable[None]],
        fit: Callable[[], Awaitable[None]],
    ) -> None:
        self._numbers: dict[str, ui.number] = {}
        with ui.grid(columns=3).classes("w-full gap-2"):
            for name in NAMES:
                self._numbers[name] = (
                    ui.number(name, format="%g")
                    .on("change", typed)
                    .on("keydown.enter", typed)
                    .props("dense")
                )
        self._robot = ui.select({"": ""}, value="", label="robot", on_change=named)
        self._robot.classes("w-full").props("dense options-dense")
        self._about = ui.label().classes("note text-sm")
        with ui.column().classes("w-full gap-0") as self._sized:
            self._radius_text = ui.label("robot radius")
            self._radius = ui.slider(
                min=LEAST_RADIUS, max=40, step=RADIUS_STEP, value=RADIUS
            ).props("label aria-label='robot radius, px'")
            self._radius.on("change", resized)
        self._verdict = ui.label().classes("found text-sm").props("role=status")
        self._snap = ui.button("Use the nearest free place", on_click=snap).props(
            "outline no-caps dense"
        )
        self._fit = ui.button(on_click=fit).props("outline no-caps dense")
        self._snap.visible = self._fit.visible = False

    def written(self, draft: TaskDraft) -> TaskDraft:
        """A draft with the numbers of the page."""
        x, y, heading, goal_x, goal_y = (self._numbers[name].value for name in NAMES)
        start = None if x is None or y is None else (x, y)
        goal = None if goal_x is None or goal_y is None else (goal_x, goal_y)
        return replace(draft, start=start, goal=goal, heading=heading)

    @property
    def radius(self) -> float:
        """Where the slider is, px."""
        return float(self._radius.value)

    @property
    def robot(self) -> str | None:
        """The chosen robot; None for a disc of a size, or the world's e-puck."""
        return self._robot.value or None

    def show(self, draft: TaskDraft, view: SourceView) -> None:
        """Shows the numbers of a draft, and the robots that fit its view."""
        none = "a disc of this radius" if draft.kind == "map" else "that of the world"
        robots = {robot.name: robot for robot in view.robots}
        options = {"": none, **{name: name for name in robots}}
        self._robot.set_options(options, value=draft.robot or "")
        self._robot.visible = bool(robots)
        named = None if draft.robot is None else robots[draft.robot]
        self._about.visible = named is not None
        self._about.text = "" if named is None else _about(named)
        places = (*(draft.start or (None, None)), draft.heading)
        shown = (*places, *(draft.goal or (None, None)))
        for number, value in zip(self._numbers.values(), shown, strict=True):
            number.value = value
        self._sized.visible = draft.kind == "map"
        self._radius.visible = draft.robot is None
        self._radius.value = draft.radius or RADIUS

    def show_checked(
        self, draft: TaskDraft, checked: Checked | None, view: SourceView
    ) -> None:
        """Shows the widest radius, and what helps if the draft is refused."""
        stuck = checked is not None and checked.task is None
        fitting = fitting_radius(draft, checked) if stuck else None
        self._snap.visible = stuck and view.kind == "map" and fitting is None
        self._fit.visible = fitting is not None
        if fitting is not None:
            self._fit.text = f"Use a radius of {fitting:g} px"
        text = _radius_text(draft, view)
        widest = checked.widest if checked else None
        if widest is not None and widest > 0:
            text += f"; the largest that gets through is {widest:g} px"
        self._radius_text.text = text

    def clear(self) -> None:
        """Empties the numbers: there is no draft."""
        self._snap.visible = self._fit.visible = False
        for number in self._numbers.values():
            number.value = None
        self._radius_text.text = ""
        self._robot.visible = self._about.visible = False

    def tell(self, text: str, good: bool) -> None:
        """Shows a sentence in its colour."""
        self._verdict.text = text
        self._verdict.classes(
            add="fine" if good else "problem", remove="problem" if good else "fine"
        )


def _about(robot: RobotFile) -> str:
    """What a robot is, and how fast."""
    speed = robot.limits.max_speed or robot.limits.max_wheel_speed
    return f"{robot.description}; full speed {speed:.3g} m/s"


def _radius_text(draft: TaskDraft, view: SourceView) -> str:
    """The radius of the robot in px, and in metres where they are known."""
    named = [robot for robot in view.robots if robot.name == draft.robot]
    scale = view.resolution
    if named and scale is not None:
        radius = named[0].radius
        return f"robot radius {radius / scale:.3g} px ({radius:g} m)"
    if draft.radius is None:
        return ""
    text = f"robot radius {draft.radius:g} px"
    return text if scale is None else f"{text} ({draft.radius * scale:.3g} m)"
