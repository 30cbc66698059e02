"""Figures of runs and metrics, with matplotlib: vector, legible, colour-blind safe."""

from tdac_agent.plots.metrics import plot_cumulative_success, plot_success_rates
from tdac_agent.plots.runs import plot_breakdown, plot_failures, plot_timeline
from tdac_agent.plots.style import figure_bytes, save_figure

__all__ = [
    "figure_bytes",
    "plot_breakdown",
    "plot_cumulative_success",
    "plot_failures",
    "plot_success_rates",
    "plot_timeline",
    "save_figure",
]
