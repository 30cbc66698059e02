"""The common style of all figures."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from matplotlib import matplotlib_fname, rc_context, rcdefaults, rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
PASSED, FAILED, NOTHING = "#009E73", "#D55E00", "#D9D9D9"
PALE = "#D8EEE6"  # passed tests, where failed ones must stand out
TEXT, GRID = "#333333", "#E5E5E5"
_ON_DARK = {
    "#ffffff": "#0d1117", "#000000": "#e6edf3", "#333333": "#e6edf3",
    "#666666": "#9da7b3", "#999999": "#6e7681", "#e5e5e5": "#30363d",
    "#0072b2": "#58a6e8",
}  # fmt: skip
"""Colours of figures on dark pages; the others are seen there, too."""


class Plot(Figure):
    """A figure that notebooks show as SVG.

    It is not registered with pyplot and need not be closed.
    """

    def _repr_svg_(self) -> str:
        return figure_bytes(self).decode("utf-8")


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


def colours_of(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name, in the order of the names."""
    unique = dict.fromkeys(names)
    return {name: COLOURS[n % len(COLOURS)] for n, name in enumerate(unique)}


def line_style(number: int) -> dict[str, Any]:
    """Colour, marker and line of one of up to 49 lines, no two of them alike."""
    again, own = divmod(number, len(COLOURS))
    return {
        "color": COLOURS[own],
        "marker": MARKERS[(own + again) % len(MARKERS)],
        "linestyle": LINES[number % len(LINES)],
        "markerfacecolor": "white" if again % 2 else COLOURS[own],
    }


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

    The label of a figure (`figure.set_label`) is the title of an SVG, for those who
    cannot see it.
    """
    stream = io.BytesIO()
    stamps: dict[str, dict[str, str | None]] = {
        "svg": {"Date": None},
        "pdf": {"CreationDate": None},
    }
    if figure.get_label():
        stamps["svg"]["Title"] = str(figure.get_label())
    with rc_context({"svg.hashsalt": "tdac"}):  # for the ids of elements
        figure.savefig(stream, format=kind, dpi=150, metadata=stamps.get(kind))
    return stream.getvalue()


def spread(count: int, width: float = 0.8) -> Sequence[float]:
    """Offsets of bars that are centred side by side on a position."""
    each = width / max(1, count)
    return [each * (n - (count - 1) / 2) for n in range(count)]
