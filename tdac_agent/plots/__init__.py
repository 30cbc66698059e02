"""Matplotlib figures of runs and metrics, safe for colour-blind readers."""

from tdac_agent.plots.arena import plot_difficulty, plot_scores
from tdac_agent.plots.baselines import (
    plot_generalisation,
    plot_learning_curves,
    plot_success_by_policy,
)
from tdac_agent.plots.campaign import plot_rates
from tdac_agent.plots.metrics import (
    plot_cumulative_panels,
    plot_cumulative_success,
    plot_success_rates,
)
from tdac_agent.plots.preprocessing import plot_preprocessing
from tdac_agent.plots.runs import plot_breakdown, plot_failures
from tdac_agent.plots.style import figure_bytes, save_figure
from tdac_agent.plots.timeline import plot_timeline
from tdac_agent.plots.trajectories import plot_trajectories

__all__ = [
    "figure_bytes",
    "plot_breakdown",
    "plot_cumulative_panels",
    "plot_cumulative_success",
    "plot_difficulty",
    "plot_failures",
    "plot_generalisation",
    "plot_learning_curves",
    "plot_preprocessing",
    "plot_rates",
    "plot_scores",
    "plot_success_by_policy",
    "plot_success_rates",
    "plot_timeline",
    "plot_trajectories",
    "save_figure",
]
