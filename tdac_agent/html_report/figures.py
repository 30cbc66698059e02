"""Figures in the page: a `plot_…` of `tdac_agent.plots` as the source of an image."""

from __future__ import annotations

from matplotlib.figure import Figure

from tdac_agent.html_report.scene import data_address
from tdac_agent.plots import figure_bytes


def drawn(figure: Figure) -> str:
    """A figure as a data URL; browsers never run scripts in the SVG of an `<img>`."""
    return data_address(figure_bytes(figure), "image/svg+xml")
