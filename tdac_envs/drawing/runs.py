"""Parts of the pictures of runs: status, trajectories, legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import (
    GREEN,
    GREY,
    INK,
    MOVER,
    PAPER,
    TRAIL,
    Canvas,
    Colour,
)
from tdac_envs.drawing.marks import draw_outcome

SMALLEST_BODY = 3.0
NOMINAL = "nominal"
"""Label of the trajectory that stands out among others."""
# Okabe and Ito (2008) after the robot's own colour: distinct with any colour vision.
_RUN_COLOURS: tuple[Colour, ...] = (
    TRAIL,
    (213, 94, 0),
    (0, 158, 115),
    (86, 180, 233),
    (230, 159, 0),
    (0, 114, 178),
    (96, 104, 118),
    # Last, since it is nearly that of movers.
    (204, 121, 167),
)
_ROW = 22
_THIN, _PLAIN, _STRONG = 1, 2, 4


class Status(NamedTuple):
    """Contents of the strip below the map.

    Attributes:
        step: Number of steps so far.
        horizon: Maximum number of steps.
        distance: Distance to the goal, px or m.
        outcome: "reached", "collision", "out of time", or empty during the episode.
    """

    step: int
    horizon: int
    distance: float
    outcome: str = ""


def outcome_of(reached: bool, collided: bool, truncated: bool) -> str:
    """The outcome after a step, as in `Status`."""
    if reached:
        return "reached"
    if collided:
        return "collision"
    return "out of time" if truncated else ""


def draw_runs(
    canvas: Canvas,
    runs: Sequence[NDArray[np.float64]],
    outcomes: Sequence[str],
    body: float,
    labels: Sequence[str] = (),
) -> None:
    """Draws trajectories, each in its colour, and marks their outcomes.

    The nominal one is strong and on top of the others, which are thin. It alone shows
    the room that the body takes.

    Args:
        canvas: Where to draw.
        runs: Each of shape (T + 1, 3): x, y and heading in canvas coordinates.
        outcomes: Outcome of each run.
        body: Radius of the body, frame px.
        labels: Name of each run.
    """
    widths = run_widths(len(runs), labels)
    for number in np.argsort(widths, kind="stable").tolist():
        _draw_run(canvas, runs[number], run_colour(number), body, widths[number])
    for run, end in zip(runs, outcomes, strict=True):
        draw_outcome(canvas, run[-1, :2], body, end)


def run_colour(number: int) -> Colour:
    """Colour of the trajectory with this index."""
    return _RUN_COLOURS[number % len(_RUN_COLOURS)]


def run_widths(count: int, labels: Sequence[str]) -> list[int]:
    """Width of each trajectory's line, frame px."""
    if count < 2 or NOMINAL not in labels[:count]:
        return [_PLAIN] * count
    nominal = labels.index(NOMINAL)
    return [_STRONG if number == nominal else _THIN for number in range(count)]


def _draw_run(
    canvas: Canvas, run: NDArray[np.float64], colour: Colour, body: float, width: int
) -> None:
    """Draws a run as a line, with the body's outline every three radii if not thin."""
    steps = np.hypot(*np.diff(run[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)]) * canvas.scale
    stops = np.searchsorted(along, np.arange(0.0, along[-1], 3 * body))
    for x, y, _ in run[stops] if width > _THIN else ():
        canvas.disc((x, y), body, colour, 0.35, 1)
    canvas.line(run[:, :2], colour, width, 0.9)
    canvas.disc(run[-1, :2], body, colour, 0.25)
    canvas.disc(run[-1, :2], body, colour, 1.0, 1)


class Entry(NamedTuple):
    """An entry of a legend: a line as it is drawn, and its text."""

    colour: Colour
    text: str
    width: int = _PLAIN
    dashed: bool = False


class Legend(NamedTuple):
    """Legend of trajectories: rows of (x, entry)."""

    rows: list[list[tuple[int, Entry]]]

    @classmethod
    def of(
        cls,
        outcomes: Sequence[str],
        labels: Sequence[str],
        *,
        path: bool,
        width: int,
        movers: bool = False,
        goal: str = "",
    ) -> Legend:
        """The legend of some trajectories.

        Args:
            outcomes: Outcome of each trajectory; may be an empty string.
            labels: Names of the first trajectories; the others are numbered.
            path: Whether the shortest path is drawn, too.
            width: Available width, frame px.
            movers: Whether the movers of the first trajectory are drawn.
            goal: Text on the goal; empty for none.
        """
        entries = [Entry(GREEN, goal)] if goal else []
        entries += [Entry(GREY, "shortest path", dashed=True)] if path else []
        widths = run_widths(len(outcomes), labels)
        for k, end in enumerate(outcomes):
            name = labels[k] if k < len(labels) else f"run {k + 1}"
            text = f"{name}: {end}" if end else name
            entries.append(Entry(run_colour(k), text, widths[k]))
        if movers:
            first = f" of {labels[0]}" if len(outcomes) > 1 and labels else ""
            entries.append(Entry(MOVER, f"movers at the end{first}"))
        return cls(_legend_rows(entries, width))

    @property
    def height(self) -> int:
        """Height of the legend, frame px."""
        return 10 + _ROW * len(self.rows)

    def write(self, canvas: Canvas) -> None:
        """Draws the legend in the strip."""
        _write_legend(canvas, self.rows)


def _legend_rows(entries: list[Entry], width: int) -> list[list[tuple[int, Entry]]]:
    """Arranges entries in rows that fit the width; each entry gets its x."""
    rows: list[list[tuple[int, Entry]]] = [[]]
    x = 10
    for entry in entries:
        taken = 46 + Canvas.text_width(entry.text)
        if rows[-1] and x + taken > width:
            rows.append([])
            x = 10
        rows[-1].append((x, entry))
        x += taken
    return rows


def _write_legend(canvas: Canvas, rows: list[list[tuple[int, Entry]]]) -> None:
    for row, entries in enumerate(rows):
        baseline = canvas.strip_top + 21 + _ROW * row
        for x, (colour, text, width, dashed) in entries:
            top = baseline - 5 - width // 2
            canvas.image[top : top + width, x : x + 18] = colour
            if dashed:
                canvas.image[top : top + width, x + 7 : x + 11] = PAPER
            canvas.text(x + 24, baseline, text, INK)
