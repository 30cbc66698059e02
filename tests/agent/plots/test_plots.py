"""Figures show the numbers that they are made from."""

import json

import numpy as np
import pandas as pd
import pytest

from tdac_agent.errors import RunError
from tdac_agent.metrics import Frames, cumulative_success, frames_from_tau, success_rate
from tdac_agent.plots import (
    plot_breakdown,
    plot_cumulative_success,
    plot_failures,
    plot_success_rates,
    plot_timeline,
    save_figure,
)
from tdac_agent.records import Attempt, Run


@pytest.fixture(scope="module")
def frames():
    """Two learners."""
    kinds = [
        frames_from_tau([1, 1, 3], 5, learner="one"),
        frames_from_tau([2, None], 5, learner="two"),
    ]
    return Frames(
        pd.concat([kind.runs for kind in kinds]),
        pd.concat([kind.candidates for kind in kinds]),
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
    assert told.index("2 failed") < told.index("no code") < told.index("verified")
    assert "not used: no code" in told


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
