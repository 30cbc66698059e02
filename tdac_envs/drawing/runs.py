"""Parts of the pictures of runs: status, trajectories, legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.drawing.canvas import GREEN, GREY, INK, MOVER, TRAIL, Canvas, Colour
from tdac_envs.drawing.marks import draw_outcome

SMALLEST_BODY = 3.0
_RUN_COLOURS: tuple[Colour, ...] = (
    TRAIL,
    (0, 136, 126),
    (206, 98, 0),
    (24, 116, 205),
    (122, 118, 0),
    (146, 84, 44),
    (96, 104, 118),
    # Last, since it is nearly that of movers.
    (186, 44, 138),
)
_ROW = 22


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
) -> None:
    """Draws trajectories, each in its colour, and marks their outcomes.

    Args:
        canvas: Where to draw.
        runs: Each of shape (T + 1, 3): x, y and heading in canvas coordinates.
        outcomes: Outcome of each run.
        body: Radius of the body, frame px.
    """
    for number, run in enumerate(runs):
        _draw_run(canvas, run, run_colour(number), body)
    for run, end in zip(runs, outcomes, strict=True):
        draw_outcome(canvas, run[-1, :2], body, end)


def run_colour(number: int) -> Colour:
    """Colour of the trajectory with this index."""
    return _RUN_COLOURS[number % len(_RUN_COLOURS)]


def _draw_run(
    canvas: Canvas, run: NDArray[np.float64], colour: Colour, body: float
) -> None:
    """Draws a run as a line, with the body's outline every three radii."""
    steps = np.hypot(*np.diff(run[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)]) * canvas.scale
    stops = np.searchsorted(along, np.arange(0.0, along[-1], 3 * body))
    for x, y, _ in run[stops]:
        canvas.disc((x, y), body, colour, 0.35, 1)
    canvas.line(run[:, :2], colour, 2, 0.9)
    canvas.disc(run[-1, :2], body, colour, 0.25)
    canvas.disc(run[-1, :2], body, colour, 1.0, 1)


class Legend(NamedTuple):
    """Legend of trajectories: rows of (x, colour, text)."""

    rows: list[list[tuple[int, Colour, str]]]

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
        entries = [(GREEN, goal)] if goal else []
        entries += [(GREY, "shortest path")] if path else []
        for k, end in enumerate(outcomes):
            name = labels[k] if k < len(labels) else f"run {k + 1}"
            entries.append((run_colour(k), f"{name}: {end}" if end else name))
        if movers:
            first = f" of {labels[0]}" if len(outcomes) > 1 and labels else ""
            entries.append((MOVER, f"movers at the end{first}"))
        return cls(_legend_rows(entries, width))

    @property
    def height(self) -> int:
        """Height of the legend, frame px."""
        return 10 + _ROW * len(self.rows)

    def write(self, canvas: Canvas) -> None:
        """Draws the legend in the strip."""
        _write_legend(canvas, self.rows)


def _legend_rows(
    entries: list[tuple[Colour, str]], width: int
) -> list[list[tuple[int, Colour, str]]]:
    """Arranges entries in rows that fit the width; each entry gets its x."""
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
