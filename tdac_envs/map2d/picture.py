"""Pictures of TDAC-Map2D-v0: frames of an episode, and whole trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tdac_envs.drawing.canvas import GREY, INK, TRAIL, Canvas, Colour, Image
from tdac_envs.drawing.marks import (
    LEFT_RAYS,
    OUTCOMES,
    RIGHT_RAYS,
    draw_disc,
    draw_outcome,
    draw_rays,
    draw_task,
    load_sprite,
)
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.params import RobotParams

ROBOT_IMAGE = Path(__file__).parents[1] / "mapping" / "maps" / "robot.png"
SMALLEST_BODY = 3.0
SMALLEST_PICTURE = 6.0
_RUN_COLOURS: tuple[Colour, ...] = (
    TRAIL,
    (0, 136, 126),
    (206, 98, 0),
    (186, 44, 138),
    (24, 116, 205),
    (122, 118, 0),
    (146, 84, 44),
    (96, 104, 118),
)
_ROW = 22


class Status(NamedTuple):
    """What the strip below the map says.

    Attributes:
        step: Steps so far.
        horizon: Steps at most.
        distance: Distance to the goal, px.
        outcome: "reached", "collision", "out of time", or empty while it runs.
    """

    step: int
    horizon: int
    distance: float
    outcome: str = ""


def ending(reached: bool, collided: bool, truncated: bool) -> str:
    """The outcome that a step brings, for `Status`."""
    if reached:
        return "reached"
    if collided:
        return "collision"
    return "out of time" if truncated else ""


class Scene:
    """What stays the same in an episode's frames, drawn once.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        start: Pose (x, y, heading).
        goal: Point (x, y), px.
        goal_tolerance: px.
        robot: Its body radius and its sensor.
        path: Reference path, shape (n, 2).
        robot_image: Picture of the robot looking right; where it is missing, or the
            robot too small for it, a disc with a nose is drawn.
    """

    def __init__(
        self,
        cells: BoolGrid,
        start: Sequence[float],
        goal: Sequence[float],
        *,
        goal_tolerance: float,
        robot: RobotParams,
        path: ArrayLike = (),
        robot_image: Path = ROBOT_IMAGE,
    ) -> None:
        self._canvas = Canvas(cells)
        self._robot = robot
        self._radius = max(robot.radius * self._canvas.scale, SMALLEST_BODY)
        self._sprite = load_sprite(robot_image, self._radius)
        draw_task(self._canvas, start, goal, goal_tolerance, path)

    def frame(
        self,
        pose: Sequence[float],
        ranges: ArrayLike = (),
        trail: ArrayLike = (),
        status: Status | None = None,
    ) -> Image:
        """The picture of one moment, uint8 RGB, both sides even.

        Args:
            pose: (x, y, heading).
            ranges: Distances along the sensor's rays, px.
            trail: Places so far, shape (n, 2).
            status: Text for the strip; its outcome also marks the robot.
        """
        canvas, robot = self._canvas.copy(), self._robot
        x, y, heading = (float(value) for value in pose)
        fan, fov = np.asarray(ranges, np.float64), radians(robot.field_of_view_deg)
        draw_rays(canvas, (x, y, heading), fan, fov, robot.range_max)
        canvas.line(trail, TRAIL, 2)
        if self._radius < SMALLEST_PICTURE:
            canvas.disc((x, y), 3 * self._radius, TRAIL, 0.6, 1)
        if self._sprite is None or self._radius < SMALLEST_PICTURE:
            draw_disc(canvas, (x, y, heading), self._radius)
        else:
            canvas.paste((x, y), heading, self._sprite)
        if status is not None:
            draw_outcome(canvas, (x, y), self._radius, status.outcome)
            _write_status(canvas, status)
        return canvas.image


def _write_status(canvas: Canvas, status: Status) -> None:
    width, baseline = canvas.image.shape[1], canvas.strip_top + 20
    x = canvas.text(10, baseline, f"step {status.step} / {status.horizon}", INK)
    x = canvas.text(x + 14, baseline, f"goal {status.distance:.0f} px away", INK)
    if status.outcome:
        colour = OUTCOMES.get(status.outcome, INK)
        x = canvas.text(x + 14, baseline, status.outcome, colour)
    if width - x > 190:
        at = canvas.text(width - 160, baseline, "left", LEFT_RAYS)
        at = canvas.text(at + 2, baseline, "/", GREY)
        canvas.text(at + 2, baseline, "right rays", RIGHT_RAYS)


def trajectory_picture(
    cells: BoolGrid,
    trajectories: Sequence[ArrayLike],
    start: Sequence[float],
    goal: Sequence[float],
    *,
    goal_tolerance: float,
    radius: float,
    path: ArrayLike = (),
    outcomes: Sequence[str] = (),
    labels: Sequence[str] = (),
) -> Image:
    """The map with one or more trajectories and a legend, uint8 RGB.

    Args:
        cells: Shape (height, width), bool, True = occupied.
        trajectories: Each of shape (T + 1, 3): x, y, heading.
        start: Nominal start, (x, y) or a pose.
        goal: Point (x, y), px.
        goal_tolerance: px.
        radius: Body radius, px.
        path: Reference path, shape (n, 2).
        outcomes: "reached", "collision" or "out of time" for each trajectory; sets
            the mark at its end.
        labels: A name for each trajectory.
    """
    runs = [np.asarray(run, np.float64).reshape(-1, 3) for run in trajectories]
    ends = [*outcomes, *[""] * (len(runs) - len(outcomes))]
    legend = Legend.of(
        ends, labels, path=len(np.asarray(path)) > 1, width=Canvas.frame_width(cells)
    )
    canvas = Canvas(cells, strip=legend.height)
    draw_task(canvas, start, goal, goal_tolerance, path)
    draw_runs(canvas, runs, ends, max(radius * canvas.scale, SMALLEST_BODY))
    legend.write(canvas)
    return canvas.image


def draw_runs(
    canvas: Canvas,
    runs: Sequence[NDArray[np.float64]],
    outcomes: Sequence[str],
    body: float,
) -> None:
    """Draws trajectories, each in its colour, and marks how they ended.

    Args:
        canvas: Where to draw.
        runs: Each of shape (T + 1, 3), x, y and heading, as the canvas has them.
        outcomes: One for each.
        body: Radius of the body, frame px.
    """
    for number, run in enumerate(runs):
        _draw_run(canvas, run, run_colour(number), body)
    for run, end in zip(runs, outcomes, strict=True):
        draw_outcome(canvas, run[-1, :2], body, end)


def run_colour(number: int) -> Colour:
    """Colour of a trajectory among others."""
    return _RUN_COLOURS[number % len(_RUN_COLOURS)]


def _draw_run(
    canvas: Canvas, run: NDArray[np.float64], colour: Colour, body: float
) -> None:
    """The line of a run and the outline of its body every three radii."""
    steps = np.hypot(*np.diff(run[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)]) * canvas.scale
    stops = np.searchsorted(along, np.arange(0.0, along[-1], 3 * body))
    for x, y, _ in run[stops]:
        canvas.disc((x, y), body, colour, 0.35, 1)
    canvas.line(run[:, :2], colour, 2, 0.9)
    canvas.disc(run[-1, :2], body, colour, 0.25)
    canvas.disc(run[-1, :2], body, colour, 1.0, 1)


class Legend(NamedTuple):
    """What the lines of trajectories mean: rows of (x, colour, text)."""

    rows: list[list[tuple[int, Colour, str]]]

    @classmethod
    def of(
        cls, outcomes: Sequence[str], labels: Sequence[str], *, path: bool, width: int
    ) -> Legend:
        """The legend of some trajectories.

        Args:
            outcomes: One for each; may be empty.
            labels: Their names, as far as they have one.
            path: Whether the shortest path is drawn, too.
            width: Columns that there are.
        """
        entries = [(GREY, "shortest path")] if path else []
        for k, end in enumerate(outcomes):
            name = labels[k] if k < len(labels) else f"run {k + 1}"
            entries.append((run_colour(k), f"{name}: {end}" if end else name))
        return cls(_legend_rows(entries, width))

    @property
    def height(self) -> int:
        """Rows that it takes, frame px."""
        return 10 + _ROW * len(self.rows)

    def write(self, canvas: Canvas) -> None:
        """Writes it into the strip."""
        _write_legend(canvas, self.rows)


def _legend_rows(
    entries: list[tuple[Colour, str]], width: int
) -> list[list[tuple[int, Colour, str]]]:
    """Entries with their x, broken into rows as wide as the frame."""
    rows: list[list[tuple[int, Colour, str]]] = [[]]
    x = 10
    for colour, text in entries:
        taken = 46 + Canvas.text_width(text)
        if rows[-1] and x + taken > width:
            rows.append([])
            x = 10
        rows[-1].append((x, colour, text))
        x += taken
    return rows


def _write_legend(canvas: Canvas, rows: list[list[tuple[int, Colour, str]]]) -> None:
    for row, entries in enumerate(rows):
        baseline = canvas.strip_top + 21 + _ROW * row
        for x, colour, text in entries:
            canvas.image[baseline - 6 : baseline - 3, x : x + 18] = colour
            canvas.text(x + 24, baseline, text, INK)
