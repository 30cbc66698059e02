"""Figures show the numbers that they are made from."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from tdac_agent import load_task
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.metrics import (
    cumulative_success,
    frames_from_tau,
    join_frames,
    success_rate,
)
from tdac_agent.plots import (
    figure_bytes,
    plot_breakdown,
    plot_cumulative_panels,
    plot_cumulative_success,
    plot_failures,
    plot_preprocessing,
    plot_success_rates,
    plot_timeline,
    plot_trajectories,
    save_figure,
)
from tdac_agent.runs.run_record import Attempt, Run
from tdac_agent.verification.verify import verify
from tdac_envs import preprocess
from tdac_envs.core.errors import TdacError


@pytest.fixture(scope="module")
def frames():
    """Two learners."""
    return join_frames(
        frames_from_tau([1, 1, 3], 5, learner="one"),
        frames_from_tau([2, None], 5, learner="two"),
    )


@pytest.fixture
def run(tmp_path):
    """A run of three candidates with its journal, the last line of which is torn."""
    attempts = [
        Attempt(k=1, j=0, valid=True, passed=False, failed_tests=("a::test_x", "a::y")),
        Attempt(k=1, j=1, valid=False, passed=False, notes=("not used: no code",)),
        Attempt(k=2, j=0, valid=True, passed=True),
    ]
    events = []
    for number, attempt in enumerate(attempts):
        kind = "edit" if attempt.j else "generate"
        at = {"k": attempt.k, "j": attempt.j}
        tokens = {"tokens_in": 100, "tokens_out": 10 * number}
        events += [
            {"event": "call.intent", "seconds": 4 * number, "kind": kind, **at},
            {"event": "call.reply", "seconds": 4 * number + 3, "kind": kind}
            | at
            | tokens,
            {"event": "verify.start", "seconds": 4 * number + 3, **at},
            {
                "event": "verify.end",
                "seconds": 4 * number + 4,
                **attempt.model_dump(mode="json"),
            },
        ]
    text = "".join(json.dumps(event) + "\n" for event in events)
    (tmp_path / "journal.jsonl").write_text(text + '{"event": "run.e')
    return Run(
        folder=tmp_path,
        task="maze",
        task_sha256="0",
        learner="one",
        optimizer="one",
        iterations=5,
        patience=1,
        seed=0,
        tokens_in=300,
        started="2026-01-01T00:00:00+00:00",
        attempts=attempts,
    )


def texts(figure):
    """All that is written in a figure."""
    return " ".join(text.get_text() for axes in figure.axes for text in axes.texts)


def test_bars_are_success_rates(frames):
    """A bar per learner, as high as its SR, with that figure over it."""
    figure = plot_success_rates({"here": frames}, provenance="made up")
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    rates = [success_rate(frames.only(learner=name)).value for name in ("one", "two")]
    assert heights == rates
    assert "0.60" in texts(figure)
    assert "made up" in texts(figure)


def test_curves_are_cumulative_success(frames):
    """A step curve per learner from (0, 0), with R in the legend."""
    figure = plot_cumulative_success(frames)
    axes = figure.axes[0]
    for line, name in zip(axes.lines, ("one", "two"), strict=True):
        curve = cumulative_success(frames.only(learner=name).runs)
        shown = dict(zip(line.get_xdata(), line.get_ydata(), strict=True))
        assert shown[0] == 0.0
        expected = dict(zip(curve["k"], curve["cs"], strict=True))
        assert {k: expected.get(k, 0.0) for k in shown} == shown
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["one (R = 3)", "two (R = 2)"]


def test_a_curve_ends_with_its_own_k():
    """Runs of one iteration say nothing of the second, and need no Kaplan-Meier."""
    both = join_frames(
        frames_from_tau([1, None], 1, learner="one shot"),
        frames_from_tau([1, 2], 3, learner="loop"),
    )
    axes = plot_cumulative_success(both).axes[0]
    assert [line.get_xdata().max() for line in axes.lines] == [1, 3]
    band = axes.collections[0].get_paths()[0].vertices
    exact = cumulative_success(both.only(learner="one shot").runs).iloc[0]
    assert exact["method"] == "Clopper-Pearson"
    assert band[:, 1].min() == pytest.approx(exact["low"])
    assert np.ptp(band[:, 0]) > 0  # it can be seen


def test_each_panel_has_its_curve_and_band(frames):
    """CS(k) over the curves of the others, and the interval behind it."""
    panels = plot_cumulative_panels(frames, most=4).axes
    for axes, name in zip(panels, ("one", "two"), strict=True):
        curve = cumulative_success(frames.only(learner=name).runs, 4)
        assert axes.lines[-1].get_ydata()[1:].tolist() == curve["cs"].tolist()
        assert len(axes.lines) == 3
        band = axes.collections[0].get_paths()[0].vertices
        assert band[:, 1].min() == pytest.approx(curve["low"].min())
        assert band[:, 1].max() == pytest.approx(curve["high"].max())


def test_bars_of_one_group_stand_in_the_middle(frames):
    """A learner that only one group has leaves no gap for the other."""
    groups = {"here": frames, "there": frames.only(learner="one")}
    bars = plot_success_rates(groups).axes[0].patches
    places = sorted(
        bar.get_x() + bar.get_width() / 2 for bar in bars if bar.get_x() > 0
    )
    assert places[-1] == pytest.approx(1.0)


def test_every_failed_test_has_its_row(run):
    """Passed, failed, or without code, in the columns of its candidates."""
    axes = plot_failures(run).axes[0]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["x", "y"]
    cells = np.asarray(axes.collections[0].get_array()).reshape(2, 3)
    assert cells.tolist() == [[1, 2, 0], [1, 2, 0]]


def test_time_and_tokens_are_those_of_the_journal(run):
    """Three seconds of each call, one of each verification; a torn line is none."""
    left, right = plot_breakdown(run).axes
    assert sum(bar.get_height() for bar in left.patches) == 12
    assert sum(bar.get_height() for bar in right.patches) == 330


def test_the_timeline_tells_what_happened(run):
    """Each candidate in order, with what failed."""
    told = texts(plot_timeline(run))
    assert told.index("2 failed") < told.index("no code") < told.index("passed")
    assert "not used: no code" in told


@pytest.mark.slow
def test_the_timeline_tells_why(run, small_task, good_source):
    """The cause of a failure is that of its report, said once for all its tests."""
    broken = good_source.replace("def policy(obs):", "def policy(obs):\n    1 / 0\n", 1)
    report = verify(broken, small_task, out=run.folder / "iterations" / "k01" / "j0")
    assert len(report.failures) > 3
    told = texts(plot_timeline(run))
    assert told.count("ZeroDivisionError") == 1


def test_rules_are_told_where_they_came_from(run):
    """By what changed, to the letter; a fault and an end without success, too."""
    rule = {
        "event": "rules",
        "seconds": 9,
        "k": 1,
        "notes": ["added R1: keep $\\away$"],
    }
    fault = {"event": "call.fault", "seconds": 9, "k": 2, "reason": "status 503"}
    end = {"event": "run.end", "seconds": 9, "status": "budget", "reason": "too dear"}
    more = [rule | {"rules": []}, fault, end]
    lines = "".join("\n" + json.dumps(one) for one in more)
    with (run.folder / "journal.jsonl").open("a") as file:
        file.write(lines + "\n")
    figure = plot_timeline(run)
    assert figure_bytes(figure)
    told = texts(figure)
    for words in ("added R1: keep $\\away$", "status 503", "budget", "too dear"):
        assert told.count(words) == 1


def test_a_run_without_journal(run):
    """One line says what is missing."""
    (run.folder / "journal.jsonl").unlink()
    with pytest.raises(RunError, match=r"journal\.jsonl"):
        plot_timeline(run)


@pytest.mark.parametrize("kind", ["svg", "pdf", "png"])
def test_a_figure_is_the_same_file_again(frames, tmp_path, kind):
    """Nothing of the clock, and nothing random, is in it."""
    one, two = tmp_path / f"1.{kind}", tmp_path / f"2.{kind}"
    save_figure(plot_cumulative_success(frames), one)
    save_figure(plot_cumulative_success(frames), two)
    assert one.read_bytes() == two.read_bytes()


def test_notebooks_show_figures_by_themselves(frames):
    """As a vector picture, without a magic command."""
    assert plot_cumulative_success(frames)._repr_svg_().startswith("<?xml")


@pytest.mark.parametrize("name", ["small", "epuck-crates"])
def test_ways_lie_where_they_were_driven(name, small_task):
    """In the unit of the task, over a picture of it that has the goal in its place."""
    task = small_task if name == "small" else load_task(name)
    start, goal = np.array(task.nominal.start[:2]), np.array(task.nominal.goal)
    poses = np.vstack([np.append(start, 0.0), np.append(goal, 0.0)])
    ends = {"one": "collision"}
    axes = plot_trajectories(task, {"one": poses, "two": poses[:, :2]}, ends).axes[0]
    lines = [line for line in axes.lines if line.get_label()[0] != "_"]
    assert [line.get_label() for line in lines] == ["one: collision", "two"]
    np.testing.assert_array_equal(lines[0].get_xydata(), poses[:, :2])
    picture = axes.images[0]
    left, right, low, high = picture.get_extent()
    rows, columns = picture.get_array().shape[:2]
    column = int((goal[0] - left) / (right - left) * columns)
    row = int((goal[1] - high) / (low - high) * rows)
    red, green, _ = picture.get_array()[row, column].astype(int)
    assert green > red + 40


def test_the_nominal_way_is_strong(small_task):
    """And above the others, which are thin; without it, all are alike."""
    way = np.array([small_task.nominal.start[:2], small_task.nominal.goal])
    axes = plot_trajectories(small_task, {"nominal": way, "jitter 1": way}).axes[0]
    nominal, other = [line for line in axes.lines if line.get_label()[0] != "_"]
    assert nominal.get_linewidth() > 2 * other.get_linewidth()
    assert nominal.get_zorder() > other.get_zorder()
    axes = plot_trajectories(small_task, {"one": way, "two": way}).axes[0]
    one, two = [line for line in axes.lines if line.get_label()[0] != "_"]
    assert one.get_linewidth() == two.get_linewidth()


def test_a_recorded_trajectory_is_drawn_by_its_poses(small_task):
    """The judge's record, as it comes from a folder."""
    poses = np.array([[30.0, 30.0, 0.0], [32.0, 31.0, 0.1]])
    none = np.zeros((1, 2), np.float32)
    way = Trajectory(poses, none, np.zeros(2), np.zeros((2, 18), np.float32), 0, 0.05)
    axes = plot_trajectories(small_task, {"nominal": way}).axes[0]
    np.testing.assert_array_equal(axes.lines[1].get_xydata(), poses[:, :2])


def test_what_are_no_poses_is_refused(small_task):
    """One line tells the shape that was expected."""
    with pytest.raises(TdacError, match=r"expected poses of shape \(T \+ 1, 3\)"):
        plot_trajectories(small_task, {"flat": np.zeros(4)})


def test_the_stages_of_preprocessing():
    """The threshold, what it alone does not say, and a way through free pixels."""
    picture = np.full((60, 80), 230, np.uint8)
    picture[:, 38:42] = 20
    picture[40:, 38:42] = 230
    picture[10:12, 10:12] = 20
    grid, params = preprocess(picture, (15, 30), (65, 30), 4.0)
    figure = plot_preprocessing(picture, grid, params)
    _, threshold, cells, room = figure.axes
    assert threshold.lines[0].get_xdata()[0] == params.threshold
    assert sum(bar.get_height() for bar in threshold.patches if bar.get_height() >= 1)
    shown = np.asarray(cells.images[0].get_array())
    np.testing.assert_array_equal(np.isin(shown, (1, 3)), grid.cells)
    plain = picture <= params.threshold
    np.testing.assert_array_equal(shown == 2, plain & ~grid.cells)
    x, y = np.rint(room.lines[0].get_xydata()).astype(int).T
    assert not grid.cells[y, x].any()


@pytest.mark.slow
def test_a_style_of_the_working_directory_is_not_used(tmp_path):
    """It may be anyone's, and LaTeX would be started with its preamble."""
    foreign = "text.usetex: True\nbackend: module://foreign\n"
    (tmp_path / "matplotlibrc").write_text(foreign)
    code = (
        "import tdac_agent.plots; from matplotlib import rcParams as used;"
        "print(used['text.usetex'], used['backend'])"
    )
    words = [sys.executable, "-P", "-c", code]
    env = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    told = subprocess.run(words, cwd=tmp_path, capture_output=True, check=True, env=env)
    assert told.stdout == b"False agg\n"
