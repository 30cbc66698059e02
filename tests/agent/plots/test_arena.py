"""Figures of a bench show the values of its tables."""

import math
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from tdac_agent.plots.arena import (
    BINS,
    DIFFICULTY,
    mean_scores,
    plot_difficulty,
    plot_scores,
    plot_training,
)
from tdac_agent.plots.style import ENTRANTS, figure_bytes, save_dark, shade


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
    """A dot with its value for each that drove; the best mean is at the top."""
    mean, known, lost = plot_scores(rows).axes
    names = [label.get_text() for label in mean.get_yticklabels()]
    assert names == ["our own program (builtin)", "PPO", "DWA"]
    assert marks(mean) == [(0.75, 3), (0.675, 2)]
    assert marks(known) == [(0.9, 3), (0.7, 2), (0.5, 1)]
    assert marks(lost) == [(0.6, 3), (0.65, 2)]
    assert [text.get_text() for text in lost.texts] == ["0.60", "0.65"]


def test_the_mean_of_some_sets(rows):
    """Those that drove on all of these have a mean, its interval from all of them."""
    means = mean_scores(rows, ["known", "lost"])
    assert means.index.tolist() == ["builtin", "ppo"]
    half = math.hypot(0.05, 0.05) / 2, math.hypot(0.02, 0.02) / 2
    assert means.loc["ppo", ["low", "high"]].tolist() == pytest.approx(
        [0.675 - half[0], 0.675 + half[1]]
    )
    figure = plot_scores(rows, ["known"], told=True)
    assert marks(figure.axes[0]) == [(0.9, 3), (0.7, 2), (0.5, 1)]
    title = figure.legends[0].get_title().get_text()
    assert (
        title == "On new worlds: our own program (builtin) 0.90 · PPO 0.70 · DWA 0.50"
    )
    assert (
        ElementTree.fromstring(figure_bytes(figure))[0].text == f"Time scores. {title}"
    )


def test_one_set_has_no_mean(rows):
    assert len(plot_scores(rows[rows["set"] == "known"]).axes) == 1


def test_on_dark_pages(rows, tmp_path):
    """The same figure on a dark ground, with nothing left in black."""
    figure = plot_scores(rows, told=True)
    save_dark(figure, tmp_path / "dark.svg")
    dark = (tmp_path / "dark.svg").read_text()
    for colour in ("#ffffff", "#333333", "#000000"):
        assert colour not in dark
    assert "#0d1117" in dark


def test_training(rows):
    """Steps of one training, beside the best entrant that did not learn."""
    known, lost = plot_training(rows).axes[:2]
    assert marks(known) == [(2.0, 0.7)]
    assert marks(lost) == [(2.0, 0.65)]
    assert known.lines[-1].get_ydata()[0] == 0.9


def test_an_entrant_looks_alike_on_all_sets(rows):
    """Also where others are missing."""
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


def test_difficulty():
    """Groups of as many worlds by each figure; one that does not vary is left out."""
    count = 40
    worlds = pd.DataFrame(
        {
            "set": "known",
            "entrant": "a",
            "index": np.arange(count),
            "gap": np.arange(count)[::-1] / count,
            "success": np.arange(count) < 10,
            "density": np.linspace(0.1, 0.3, count),
            **dict.fromkeys(("least_steps", "detour", "in_sight", "movers"), 1.0),
        }
    )
    figure = plot_difficulty(worlds, "known", {"a": "planner"})
    gap, density = figure.axes[:2]
    assert gap.get_title(loc="left") == "gap, body diameters"
    assert [text.get_text() for text in gap.texts] == ["0"] * (BINS - 1) + ["100"]
    assert [text.get_text() for text in density.texts] == ["100"] + ["0"] * (BINS - 1)
    last = gap.get_xticklabels()[-1].get_text()
    assert float(last) == pytest.approx(worlds["gap"][:10].mean(), rel=1e-2)
    (mark,) = gap.lines
    assert mark.get_marker() == ENTRANTS["planner"].marker
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "classical planner"
    ]


def test_files_of_an_entrant_share_the_groups():
    """A world is in one group, however many files drove it; gaps stay empty."""
    worlds = pd.DataFrame(
        [
            {"set": "known", "entrant": name, "index": k, "gap": k, "success": k < n}
            for name, n in (("a", 10), ("b", 5), ("b", 20))
            for k in range(20)
            if name == "a" or k >= 5
        ]
    ).assign(**dict.fromkeys(set(DIFFICULTY) - {"gap"}, 1.0))
    (gap,) = [
        axes for axes in plot_difficulty(worlds, "known").axes if axes.get_visible()
    ]
    words = [text.get_text() for text in gap.texts]
    assert words == ["100", "100", "0", "0", "50", "50", "50"]


def test_a_figure_says_what_it_is(rows):
    """Its SVG has a title and a description, in plain characters."""
    svg = ElementTree.fromstring(figure_bytes(plot_training(rows)))
    title, description = svg[0], svg[1]
    assert title.tag.endswith("title")
    assert "learned policies" in title.text
    assert description.tag.endswith("desc")
    assert "dashed line" in description.text


def test_kinds_are_told_apart_without_colour():
    """Each kind of entrant has a shape and a colour of its own."""
    for part in ("words", "colour", "marker"):
        assert len({getattr(look, part) for look in ENTRANTS.values()}) == len(ENTRANTS)
    pink = ENTRANTS["learned"].colour
    assert len({shade(pink, number) for number in range(3)}) == 3
    assert shade(pink, 0) == pink.lower()
