"""The common style of all figures."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from matplotlib import matplotlib_fname, rc_context, rcdefaults, rcParams
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tdac_agent.storage.files import write_atomic

# That of the working directory may be anyone's, and can have LaTeX started.
if not os.path.isabs(matplotlib_fname()):
    rcdefaults()
    # This is no default: it is kept, and can be any module.
    rcParams["backend"] = os.environ.get("MPLBACKEND") or "agg"

# Okabe and Ito (2008): distinct with any colour vision and, in this order, in grey.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LINES = ("-", "--", "-.", ":")


class Look(NamedTuple):
    """How a kind of entrant is drawn in all figures."""

    words: str
    colour: str
    marker: str


ENTRANTS = {
    "builtin": Look("our own program", COLOURS[0], MARKERS[0]),
    "planner": Look("classical planner", COLOURS[1], MARKERS[1]),
    "controller": Look("controller file", COLOURS[2], MARKERS[2]),
    "learned": Look("learned policy", COLOURS[3], MARKERS[3]),
    "baseline": Look("baseline", COLOURS[4], MARKERS[4]),
    "privileged": Look("knows the true world", COLOURS[5], MARKERS[5]),
}
"""By the kind of a row of a bench."""
PASSED, FAILED, NOTHING = "#009E73", "#D55E00", "#D9D9D9"
PALE = "#D8EEE6"  # passed tests, where failed ones must stand out
TEXT, GRID = "#333333", "#E5E5E5"
START, GOAL, PATH, TRAIL = "#FAF9F5", "#0E8C5C", "#555B66", "#5848C6"
"""As in the pictures of maps and worlds: a light disc, a green ring, grey dashes, and
the nominal drive."""
_ON_DARK = {
    "#ffffff": "#0d1117", "#000000": "#e6edf3", "#333333": "#e6edf3",
    "#666666": "#9da7b3", "#999999": "#6e7681", "#e5e5e5": "#30363d",
    "#0072b2": "#58a6e8",
}  # fmt: skip
"""Colours of figures on dark pages; the others are seen there, too."""


class Plot(Figure):
    """A figure that notebooks show as SVG.

    It is not registered with pyplot and need not be closed. Its label
    (`figure.set_label`) is the title of an SVG for those who cannot see it, or else the
    title that it shows.

    Attributes:
        description: What an SVG says of itself besides: what its marks mean.
    """

    description = ""

    def _repr_svg_(self) -> str:
        return figure_bytes(self).decode("utf-8")


def shade(colour: str, number: int) -> str:
    """One of several colours of a kind of entrant: itself, and darker ones."""
    light = (1.0, 0.3, 0.6)[number % 3]
    red, green, blue = to_rgb(colour)
    return to_hex((light * red, light * green, light * blue))


def new_figure(width: float, height: float) -> tuple[Plot, Axes]:
    """A figure with one pair of axes, sizes in inches."""
    figure = new_plot(width, height)
    return figure, apply_style(figure.add_subplot())


def new_plot(width: float, height: float) -> Plot:
    """A figure without axes, sizes in inches."""
    return Plot(figsize=(width, height), layout="constrained")


def panels(
    count: int,
    width: float,
    height: float,
    *,
    left: float,
    above: float,
    narrowest: float = 0.0,
) -> tuple[Plot, list[Axes]]:
    """A figure with `count` panels, at most three in a row; sizes in inches.

    Args:
        count: Number of panels.
        width: Width of a panel.
        height: Height of a panel.
        left: What the labels at the left need.
        above: What the legend above needs.
        narrowest: Least width of the figure, which the legend needs.
    """
    columns = max(min(3, count), 1)
    rows = max(-(-count // columns), 1)
    width = max(width, (narrowest - left) / columns)
    figure = new_plot(left + width * columns, above + height * rows)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    shown = [apply_style(axes) for axes in grid.flat]
    for axes in shown[count:]:
        axes.set_visible(False)
    return figure, shown


def apply_style(axes: Axes) -> Axes:
    """Applies the common style to axes, and returns them."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color("#999999")
    axes.tick_params(colors=TEXT, labelsize=9)
    axes.grid(visible=True, axis="y", color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    return axes


def title(
    axes: Axes,
    text: str,
    provenance: str = "",
    *,
    size: float = 11.0,
    pad: float = 20.0,
    rise: float = 6.0,
    small: float = 8.5,
) -> None:
    """Sets a title at the left, with the source of the data below it.

    Args:
        axes: The axes.
        text: The title.
        provenance: The line below it.
        size: Font size of the title, pt.
        pad: Distance of the title from the axes.
        rise: Distance of the line from the axes, pt.
        small: Font size of the line, pt.
    """
    axes.set_title(text, loc="left", fontsize=size, color=TEXT, pad=pad)
    if provenance:
        axes.annotate(
            provenance,
            (0, 1),
            (0, rise),
            xycoords="axes fraction",
            textcoords="offset points",
            fontsize=small,
            color="#666666",
        )


def rows_of(
    axes: Axes,
    heading: str,
    names: Sequence[str],
    *,
    size: float = 9.5,
    pad: float = 6.0,
    labels: float = 8.0,
) -> None:
    """Gives a panel a row per name, the first one at the top, and a grid in x.

    The rows are at y = `len(names)`, …, 1.

    Args:
        axes: The panel.
        heading: Its title, at the left.
        names: Names of the rows.
        size: Font size of the title, pt.
        pad: Distance of the title from the axes, pt.
        labels: Font size of the names, pt.
    """
    axes.set_title(heading, loc="left", fontsize=size, color=TEXT, pad=pad)
    axes.set_yticks(range(len(names), 0, -1), names)
    axes.tick_params(axis="y", labelsize=labels)
    axes.set_ylim(0.4, len(names) + 0.6)
    axes.grid(visible=True, axis="x", color=GRID, linewidth=0.8)


def mark_task(
    axes: Axes,
    start: tuple[float, ...] | None,
    goal: tuple[float, float] | None,
    path: NDArray[np.float64],
) -> None:
    """Marks start, goal and path on a map, as the pictures of maps do."""
    axes.plot(path[:, 0], path[:, 1], color="w", linewidth=4.0, alpha=0.7)
    axes.plot(path[:, 0], path[:, 1], "--", color=PATH, linewidth=1.8)
    if goal is not None:
        ring: dict[str, Any] = {"mfc": "#FFFFFFAA", "mec": GOAL, "mew": 2.0}
        axes.plot(*goal[:2], "o", markersize=13, **ring)
        axes.plot(*goal[:2], "o", markersize=4, color=GOAL)
    if start is not None:
        disc: dict[str, Any] = {"mfc": START, "mec": PATH, "mew": 2.0}
        axes.plot(*start[:2], "o", markersize=9, **disc)


def colours_of(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name, in the order of the names."""
    unique = dict.fromkeys(names)
    return {name: COLOURS[n % len(COLOURS)] for n, name in enumerate(unique)}


def legend(axes: Axes, count: int) -> None:
    """Adds a legend below the axes, where it covers no data."""
    rows = -(-count // 4)
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.18),
        ncols=-(-count // max(1, rows)),
        frameon=False,
        fontsize=9,
    )


def legend_above(
    figure: Figure, panels: Sequence[Axes], columns: int, *, title: str = ""
) -> None:
    """Adds a legend of all panels above them, an entry for each label.

    Args:
        figure: The figure.
        panels: Its axes.
        columns: Most entries in a row.
        title: What the figure shows, in a sentence.
    """
    entries = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries.update(dict(zip(labels, handles, strict=True)))
    figure.legend(
        entries.values(),
        entries.keys(),
        loc="outside upper left",
        ncols=columns,
        frameon=False,
        fontsize=8.5,
        labelcolor=TEXT,
        title=title or None,
        title_fontproperties={"size": 11, "weight": "bold"},
        alignment="left",
    ).get_title().set_color(TEXT)


def describe(
    figure: Plot,
    name: str,
    description: str,
    *,
    below: str = "",
    beside: str = "",
    size: float = 9.0,
) -> None:
    """Says what a figure shows, and labels all its panels together.

    Args:
        figure: The figure.
        name: What it is called: the title of its SVG.
        description: What its marks mean: the description of its SVG.
        below: Label of the horizontal axes.
        beside: Label of the vertical axes.
        size: Font size of the labels, pt.
    """
    figure.set_label(name)
    figure.description = description
    if below:
        figure.supxlabel(below, fontsize=size, color=TEXT)
    if beside:
        figure.supylabel(beside, fontsize=size, color=TEXT)


def save_figure(figure: Figure, *paths: Path) -> None:
    """Writes a figure to each path, in the format of its suffix (svg, pdf, png)."""
    for path in paths:
        write_atomic(path, figure_bytes(figure, path.suffix.lstrip(".") or "svg"))


def save_dark(figure: Figure, path: Path) -> None:
    """Writes a figure as SVG for dark pages."""
    drawn = figure_bytes(figure).decode("utf-8")
    for light, dark in _ON_DARK.items():
        drawn = drawn.replace(light, dark)
    write_atomic(path, drawn.encode("utf-8"))


def figure_bytes(figure: Figure, kind: str = "svg") -> bytes:
    """Encodes a figure as svg, pdf or png; equal figures give equal bytes.

    An SVG has a title, and the description of a `Plot`.
    """
    stream = io.BytesIO()
    stamps: dict[str, dict[str, str | None]] = {
        "svg": {"Date": None},
        "pdf": {"CreationDate": None},
    }
    name = _name_of(figure)
    if name:
        stamps["svg"]["Title"] = name
    with rc_context({"svg.hashsalt": "tdac"}):  # for the ids of elements
        figure.savefig(stream, format=kind, dpi=150, metadata=stamps.get(kind))
    drawn, described = stream.getvalue(), getattr(figure, "description", "")
    if kind == "svg" and name and described:
        end = b"</title>"
        text = f"</title>\n <desc>{escape(described)}</desc>".encode()
        return drawn.replace(end, text, 1)
    return drawn


def _name_of(figure: Figure) -> str:
    """What a figure is called: its label, or a title that it shows."""
    shown = [axes.get_title(loc="left") for axes in figure.axes[:1]]
    names = [str(figure.get_label()), figure.get_suptitle(), *shown]
    return next((" ".join(name.split()) for name in names if name), "")


def spread(count: int, width: float = 0.8) -> Sequence[float]:
    """Offsets of bars that are centred side by side on a position."""
    each = width / max(1, count)
    return [each * (n - (count - 1) / 2) for n in range(count)]
