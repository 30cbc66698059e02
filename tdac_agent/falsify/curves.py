"""Curves of success against single deviations."""

from __future__ import annotations

from pathlib import Path

from matplotlib.ticker import MaxNLocator

from tdac_agent.metrics.exact import CONFIDENCE, exact_interval
from tdac_agent.plots.style import (
    COLOURS,
    FAILED,
    apply_style,
    figure_bytes,
    new_plot,
)
from tdac_agent.runs.falsification import Falsification, Point
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.deviation import DEVIATIONS, DeviationPart

_COLUMNS = 4


def draw_curves(found: Falsification, path: Path) -> None:
    """Writes a panel for each part: share of successes, with exact 95 % intervals."""
    parts: dict[str, list[Point]] = {}
    for point in found.curves:
        parts.setdefault(point.part, []).append(point)
    columns = min(_COLUMNS, len(parts))
    rows = -(-len(parts) // columns)
    figure = new_plot(2.6 * max(2, columns), 1.9 * rows + 0.6)
    count = max(point.count for point in found.curves)
    what = "jittered starts" if found.split is None else f"worlds of {found.split}"
    figure.suptitle(
        f"{found.policy} on {found.name}\nshare of successes in {count} {what}, exact "
        "95 % intervals; dashed: where the task's own start fails",
        fontsize=9,
        wrap=True,
    )
    for number, (name, points) in enumerate(parts.items()):
        axes = apply_style(figure.add_subplot(rows, columns, number + 1))
        part = DEVIATIONS[name]
        scale, unit = _axis(part, found)
        values = [scale * point.value for point in points]
        rates = [point.successes / point.count for point in points]
        intervals = [
            exact_interval(each.successes, each.count, CONFIDENCE) for each in points
        ]
        lows = [r - low for r, (low, _) in zip(rates, intervals, strict=True)]
        highs = [high - r for r, (_, high) in zip(rates, intervals, strict=True)]
        axes.errorbar(
            values,
            rates,
            yerr=[[max(0.0, v) for v in lows], [max(0.0, v) for v in highs]],
            color=COLOURS[0],
            marker="o",
            markersize=3,
            linewidth=1.2,
            elinewidth=0.8,
        )
        axes.axvline(0.0, color="#BBBBBB", linewidth=0.8)
        for failure in _failures(found, name):
            axes.axvline(scale * failure, color=FAILED, linewidth=0.9, linestyle="--")
        axes.set_ylim(-0.03, 1.03)
        axes.set_xlabel(f"{part.words} ({unit})", fontsize=8)
        axes.tick_params(labelsize=7)
        whole = part.unit == "steps"
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=whole))
    write_atomic(path, figure_bytes(figure, "png"))


def _failures(found: Falsification, name: str) -> list[float]:
    """Smallest values of a part that failed alone, from the task's own start."""
    return [
        each.fails
        for envelope in found.envelopes
        for each in envelope.directions
        if each.part == name and each.fails is not None
    ]


def _axis(part: DeviationPart, found: Falsification) -> tuple[float, str]:
    """Factor and unit with which values are shown."""
    if part.unit == "share":
        return 100.0, "%"
    if part.unit == "radii":
        units = found.units
        if units.shown is None:
            return found.radius * units.scale, units.length
        return found.radius * units.scale * units.shown.per_pixel, units.length
    return 1.0, part.unit
