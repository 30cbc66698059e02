"""Figures of a bench show the values of its tables."""

import numpy as np
import pandas as pd
import pytest

from tdac_agent.plots.arena import BINS, plot_difficulty, plot_scores, plot_training
from tdac_agent.plots.style import line_style


@pytest.fixture
def rows():
    """Three entrants on two sets, one of which did not drive on the second."""
    found = pd.DataFrame(
        {
            "set": ["known"] * 3 + ["lost"] * 3,
            "entrant": ["builtin", "dwa", "ppo"] * 2,
            "kind": ["builtin", "planner", "learned"] * 2,
            "worlds": 50,
            "time": [0.9, 0.5, 0.7, 0.6, np.nan, 0.65],
            "steps": [np.nan, np.nan, 4e6] * 2,
            "files": [1, 1, 2] * 2,
        }
    )
    return found.assign(low=found["time"] - 0.05, high=found["time"] + 0.02)


def marks(axes):
    """The centres of the marks with intervals, x and y."""
    return [tuple(line.get_xydata()[0]) for line, *_ in axes.containers]


def test_scores(rows):
    """A dot for each that drove, at its value; the best entrant is at the top."""
    known, lost = plot_scores(rows).axes[:2]
    names = [label.get_text() for label in known.get_yticklabels()]
    assert names == ["builtin", "ppo", "dwa"]
    assert marks(known) == [(0.9, 3), (0.7, 2), (0.5, 1)]
    assert marks(lost) == [(0.6, 3), (0.65, 2)]
    assert [text.get_text() for text in lost.texts] == ["–"]


def test_training(rows):
    """Steps of one training, beside the best entrant that did not learn."""
    known, lost = plot_training(rows).axes[:2]
    assert marks(known) == [(2.0, 0.7)]
    assert marks(lost) == [(2.0, 0.65)]
    assert known.lines[-1].get_ydata()[0] == 0.9


def test_an_entrant_looks_alike_on_all_sets(rows):
    """Also where others are missing; and no two of many look alike."""
    other = rows[rows["kind"] == "learned"].assign(entrant="sac")
    both = pd.concat([rows, other])
    panels = plot_training(both[(both["set"] == "known") | (both["entrant"] == "sac")])
    known, lost = panels.axes[:2]
    looks = [
        {
            bar.get_label(): (bar[0].get_color(), bar[0].get_marker())
            for bar in axes.containers
        }
        for axes in (known, lost)
    ]
    assert looks[1].items() <= looks[0].items()
    assert looks[1].keys() == {"sac"}
    styles = [tuple(sorted(line_style(number).items())) for number in range(49)]
    assert len({*styles}) == 49


def test_difficulty():
    """Groups of as many worlds by each figure; one that does not vary is left out."""
    count = 40
    worlds = pd.DataFrame(
        {
            "set": "known",
            "entrant": "a",
            "gap": np.arange(count)[::-1] / count,
            "success": np.arange(count) < 10,
            "density": np.linspace(0.1, 0.3, count),
            **dict.fromkeys(("least_steps", "detour", "in_sight", "movers"), 1.0),
        }
    )
    gap, density = plot_difficulty(worlds, "known").axes[:2]
    assert gap.get_xlabel() == "gap, body diameters"
    assert gap.lines[0].get_ydata().tolist() == [0.0] * (BINS - 1) + [1.0]
    assert density.lines[0].get_ydata().tolist() == [1.0] + [0.0] * (BINS - 1)
    x = gap.lines[0].get_xdata()
    assert x[-1] == pytest.approx(worlds["gap"][:10].mean())
