"""Figures of a campaign show what its tables say."""

import pandas as pd
import pytest

from tdac_agent.campaign.collect import Tables
from tdac_agent.campaign.figures import kind_names, write_figures
from tdac_agent.metrics import frames_from_tau, join_frames, summarise
from tdac_agent.metrics.table import KIND
from tdac_agent.plots import plot_rates

NOTHING = pd.DataFrame()


def runs(learner, tau=(1, 2, None), task="maze", most=3, **labels):
    """Runs of a kind."""
    known = {"optimizer": learner, "prompt": "full", "setting": "dual tier"} | labels
    return frames_from_tau(tau, most, learner=learner, task=task, **known)


@pytest.mark.slow
def test_each_task_has_its_curves_and_all_share_the_rates(tmp_path):
    """PNG files beside the tables; the same command writes the same bytes again."""
    frames = join_frames(
        runs("openai:x"),
        runs("scripted:weak", tau=(1, 1)),
        runs("openai:x", task="plans/my own"),
        runs("openai:x", tau=(1, None), most=1, setting="one shot"),
    )
    tables = Tables(frames, NOTHING, summarise(frames), NOTHING)
    written = write_figures(tables, tmp_path)
    assert [path.name for path in written] == [
        "success_rate.png",
        "cumulative_success-maze.png",
        "cumulative_success-plans-my-own.png",
    ]
    before = [path.read_bytes() for path in written]
    assert all(content.startswith(b"\x89PNG") for content in before)
    again = write_figures(tables, tmp_path)
    assert [path.read_bytes() for path in again] == before


def test_without_runs_there_is_nothing_to_draw(tmp_path):
    empty = frames_from_tau([], 3)
    assert write_figures(Tables(empty, NOTHING, NOTHING, NOTHING), tmp_path) == []


def test_runs_on_sets_show_how_many_are_verified(tmp_path):
    """With the exact interval of `set_summary.csv`; CS(k) is of single tasks."""
    row = dict.fromkeys(KIND, "builtin") | {"task": "set unknown", "R": 2}
    row |= {"censored": 0, "rate": 1.0, "rate_low": 0.16, "rate_high": 1.0}
    tables = Tables(frames_from_tau([], 3), NOTHING, NOTHING, pd.DataFrame([row]))
    written = write_figures(tables, tmp_path)
    assert [path.name for path in written] == ["set_verified_rate.png"]


@pytest.mark.parametrize(
    ("learners", "names"),
    [
        (["openai:x", "hf:a/b"], ["openai:x", "hf:a/b"]),
        (["builtin"], ["builtin\nno language model"]),
        (["scripted:/my/weak"], ["scripted:weak\nno language model"]),
        (["replay:demo"], ["replay:demo\nno language model"]),
        (
            ["scripted:/a/weak", "scripted:/b/weak"],
            [f"scripted:/{each}/weak\nno language model" for each in "ab"],
        ),
    ],
)
def test_learners_without_a_language_model_say_so(learners, names):
    """Kinds of different runs have different names."""
    frames = join_frames(*(runs(each) for each in learners))
    assert kind_names(summarise(frames)) == names


def test_kinds_say_in_what_they_differ():
    """Setting and prompt if there are several, the optimizer if it is another one."""
    frames = join_frames(
        runs("openai:x", prompt="full"),
        runs("openai:x", prompt="/my/short.md", optimizer="openai:y"),
    )
    assert kind_names(summarise(frames)) == [
        "openai:x\nfull",
        "openai:x\nshort.md, repairs: openai:y",
    ]


def test_dots_are_the_rates_with_their_intervals():
    """A dash where there was no trial, a dot alone where there is no interval."""
    nan = float("nan")
    rows = [
        {"kind": "a", "rate": 0.5, "low": 0.2, "high": 0.9, "censored": 0},
        {"kind": "b", "rate": 0.25, "low": nan, "high": nan, "censored": 1},
        {"kind": "c", "rate": nan, "low": nan, "high": nan, "censored": 4},
    ]
    frame = pd.DataFrame(rows).assign(task="maze", R=4, free=[True, False, False])
    (axes,) = plot_rates(frame, "SR").axes
    said = [text.get_text() for text in axes.texts]
    assert said == [
        "0.50 (R = 4)",
        "0.25 (R = 4, 1 cut short)",
        "– (R = 4, 4 cut short)",
    ]
    with_ends, alone = axes.containers
    assert with_ends.get_label() == "no language model"
    assert with_ends.lines[0].get_xdata().tolist() == [0.5]
    (ends,) = with_ends.lines[2][0].get_segments()
    assert ends[:, 0].tolist() == pytest.approx([0.2, 0.9])
    assert alone.lines[2] == ()
