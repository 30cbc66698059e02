"""Figures of baselines show the tables that they are made from, and those agree."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tdac_agent.metrics.exact import exact_interval
from tdac_agent.plots.baselines import (
    plot_generalisation,
    plot_learning_curves,
    plot_success_by_policy,
)
from tdac_agent.plots.style import ENTRANTS
from tdac_agent.tasks.task_file import bundled_tasks

RESULTS = Path(__file__).parents[3] / "results" / "baselines"


def read(name):
    return pd.read_csv(RESULTS / f"{name}.csv")


def curve(task, algo, seed, rates):
    return [
        {
            "task": task,
            "algo": algo,
            "seed": seed,
            "steps": 100 * (n + 1),
            "success_rate": rate,
        }
        for n, rate in enumerate(rates)
    ]


def test_learning_curves_are_mean_and_range_of_the_seeds():
    """A panel per task; each seed, and what they come to where all of them are."""
    rows = curve("maze", "ppo", 0, [0.0, 1.0, 1.0]) + curve("maze", "ppo", 1, [0, 0.5])
    rows += curve("cave", "ppo", 0, [1.0]) + curve("cave", "sac", 0, [0.25])
    figure = plot_learning_curves(pd.DataFrame(rows))
    maze, cave = [axes for axes in figure.axes if axes.get_visible()]
    *seeds, mean = maze.lines
    assert [line.get_ydata().tolist() for line in seeds] == [[0, 1, 1], [0, 0.5]]
    assert mean.get_xdata()[-1] == 200
    assert mean.get_ydata()[-1] == 0.75
    edge = maze.collections[0].get_paths()[0].vertices
    assert edge[:, 1].max() == 1.0
    assert edge[edge[:, 0] == 200.0][:, 1].min() == 0.5
    assert cave.lines[-1].get_label() == "SAC"
    assert cave.lines[-1].get_ydata()[-1] == 0.25


def test_dots_are_rates_with_exact_intervals():
    """A dot for each seed; a dash where there is no policy."""
    rows = [
        {"task": "maze", "policy": "PPO", "knows": "+ guidance", "reached": r}
        | {"episodes": 100, "training": f"ppo-maze-{seed}"}
        for seed, r in enumerate((90, 100))
    ]
    rows.append({"task": "maze", "policy": "recorded model", "knows": "+ map"})
    figure = plot_success_by_policy(pd.DataFrame(rows))
    (axes,) = figure.axes
    assert "one dot per training seed" in figure.get_supxlabel()
    assert "–: no such policy" in figure.get_supxlabel()
    found = [bar.lines[0].get_xdata()[0] for bar in axes.containers]
    assert found == [0.9, 1.0]
    ends = axes.containers[0].lines[2][0].get_segments()[0][:, 0]
    np.testing.assert_allclose(ends, exact_interval(90, 100))
    assert [text.get_text() for text in axes.texts if text.get_text()] == ["95", "–"]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["PPO (+ guidance)", "recorded model (+ map)"]
    assert axes.containers[0].lines[0].get_marker() == ENTRANTS["learned"].marker


def test_cells_are_means_of_seeds_and_say_what_was_seen():
    """Rates in per cent, a frame where a policy was trained."""
    rows = [
        {"trained_on": "maze", "evaluated_on": place, "reached": reached}
        | {"seen": place == "maze", "episodes": 100, "seed": seed}
        for place, counts in {"maze": (100, 90), "cave": (10, 0)}.items()
        for seed, reached in enumerate(counts)
    ]
    (axes,) = plot_generalisation(pd.DataFrame(rows)).axes
    assert [text.get_text() for text in axes.texts] == ["95", "5"]
    (frame,) = axes.patches
    assert frame.get_xy() == (-0.5, -0.5)


def test_the_published_tables_agree():
    """Trainings have their curves, rates their intervals, policies their trainings."""
    trainings, curves = read("trainings"), read("curves")
    assert set(curves["training"]) == set(trainings["training"])
    best = trainings.merge(
        curves, left_on=["training", "best_steps"], right_on=["training", "steps"]
    )
    assert len(best) == len(trainings)
    assert (best["success_rate_x"] == best["success_rate_y"]).all()
    for name in ("evaluation", "generalisation"):
        table = read(name)
        known = table.dropna(subset=["episodes"])
        assert set(known["training"].dropna()) <= set(trainings["training"])
        for row in known.itertuples():
            ends = exact_interval(int(row.reached), int(row.episodes))
            assert (row.low, row.high) == pytest.approx(ends, abs=1e-6)
    missing = read("evaluation").query("episodes.isna()")
    assert missing["note"].str.contains("tdac synth").all()
    places = read("generalisation")
    assert set(places["evaluated_on"]) <= set(bundled_tasks())
    seen = [r.evaluated_on in r.trained_on.split() for r in places.itertuples()]
    assert places["seen"].tolist() == seen
