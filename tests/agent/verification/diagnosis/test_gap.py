"""Promises of the smallest gap in records, reports and texts."""

from dataclasses import replace
from io import StringIO
from xml.etree import ElementTree

import numpy as np
import pytest
from driving import always, drive, judged
from rich.console import Console

from tdac_agent.cli.junit import write_set_junit
from tdac_agent.cli.report_view import episode_table
from tdac_agent.tasks.units import METRES, PIXELS
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.gap import (
    Gap,
    gap_figure,
    gap_text,
    too_close_text,
)
from tdac_agent.verification.diagnosis.nearest import gap_of
from tdac_agent.verification.diagnosis.report import Episode, Report
from tdac_agent.verification.episode_report import EpisodeProvenance, summarise
from tdac_agent.verification.judge.confirming import ConfirmingTest
from tdac_agent.verification.judge.episode_row import EpisodeRow, driven_row
from tdac_agent.verification.verdict import confirmed_text, word_of
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.map2d.env import Map2DEnv

FACTS = {"seed": 3, "length": 30.0, "least_steps": 9.0, "barn_steps": 9.0}


def corridor_env(room):
    """A robot of 5 px radius that passes a wall below it with some room."""
    cells = np.zeros((60, 90), np.bool_)
    cells[40:, 40:50] = True  # its upper edge is at 39.5
    y = 39.5 - 5.0 - room
    return Map2DEnv(cells, (20.0, y, 0.0), (70.0, y), robot_radius=5.0)


def row_of(env, rollout, **options):
    terms = {"units": PIXELS, "shown": None, "told": True, "cpu_seconds": 0.0}
    return driven_row(rollout, env.nominal, FACTS, **{**terms, **options})


def test_a_row_has_the_gap_its_share_and_its_place():
    """Between the ends of two steps, too, and in units and radii."""
    env = corridor_env(0.125)
    row = row_of(env, drive(env, always(1.0, 1.0)))
    gap = row.smallest_gap
    assert row.success
    assert gap.gap == pytest.approx(0.125, abs=1e-6)
    assert gap.radii == pytest.approx(0.025)
    assert gap.required == 0.25
    assert gap.thing == "wall"
    assert 39.4 < gap.x < 49.6
    assert gap.y == env.nominal.start.y
    assert 1 <= gap.step <= row.steps
    assert row.too_close
    assert EpisodeRow.model_validate_json(row.model_dump_json()) == row


def test_a_larger_gap_is_not_too_close():
    """At or above the required gap, nothing is said."""
    env = corridor_env(1.0)
    row = row_of(env, drive(env, always(1.0, 1.0)))
    assert row.smallest_gap.gap == pytest.approx(1.0, abs=1e-6)
    assert not row.too_close


def test_a_contact_is_a_gap_of_0_and_a_failure():
    """It is not said to have reached the goal too close."""
    env = corridor_env(-1.0)
    row = row_of(env, drive(env, always(1.0, 1.0)))
    assert row.outcome == "collision"
    assert row.smallest_gap.gap == 0.0
    assert not row.too_close


def test_the_place_in_hidden_worlds_is_not_told():
    """The gap alone may be told, as the cause of a failure may."""
    env = corridor_env(0.125)
    row = row_of(env, drive(env, always(1.0, 1.0)), told=False)
    gap = row.smallest_gap
    assert gap.gap == pytest.approx(0.125, abs=1e-6)
    assert {gap.step, gap.x, gap.y, gap.heading, gap.thing} == {None}


def test_an_episode_without_a_step_has_no_gap():
    """A controller that cannot be imported comes near to nothing."""
    env = corridor_env(1.0)
    rollout = replace(drive(env, always(0.0, 0.0), steps=1), smallest_gap=None)
    assert gap_of(rollout, env.nominal) is None


def test_a_tight_start_is_not_too_close_and_what_follows_is_named():
    """It starts nearer to a wall than required, then passes another one too close."""
    env = corridor_env(0.2)
    cells = env.nominal.terrain.grid.cells.copy()
    cells[:, :15] = True  # its right edge is at 14.5
    env = Map2DEnv(cells, (19.6, *env.nominal.start[1:]), (70.0, 29.0), robot_radius=5)
    for told in (True, False):
        row = row_of(env, drive(env, always(1.0, 1.0)), told=told)
        assert row.smallest_gap.gap == pytest.approx(0.1, abs=1e-6)
        assert row.close_gap.gap == pytest.approx(0.2, abs=1e-6)
        assert row.too_close
        rows = [row.model_copy(update={"seed": 1}), tight_start()]
        report = summarise(provenance(), rows, None, 1.0)
        assert (report.closest, report.too_close) == (2, 1)
        assert report.close_gap == row.close_gap
    leaves = row_of(env, drive(env, always(1.0, 1.0), steps=3), told=False)
    assert leaves.smallest_gap.gap == pytest.approx(0.1, abs=1e-6)
    assert not leaves.smallest_gap.too_close


def tight_start():
    """A success that was nowhere nearer to an obstacle than at its start."""
    gap = Gap(gap=0.05, radii=0.01, required=0.25, step=0)
    return EpisodeRow(seed=2, outcome="reached", steps=9, smallest_gap=gap)


def test_a_diagnosis_says_where_it_came_too_close():
    """Of an episode that failed for another reason."""
    env = corridor_env(0.125)
    rollout, found = judged(env, always(1.0, 1.0), steps=8)
    assert rollout.outcome == "stopped"
    said = "It came too close: 0.125 px (2.5 % of the radius) to the wall at ("
    assert said in found.text
    assert "; required 0.25 px." in found.text
    far = replace(rollout, close_gap=None)
    assert "too close" not in diagnose(far, env.nominal).text


def test_records_of_before_have_no_gap_and_load():
    """The least clearance at the ends of steps stands in for it."""
    row = EpisodeRow(seed=1, outcome="reached", steps=3, clearance_min=2.5)
    assert row.smallest_gap is None
    assert row.gap_left == 2.5
    assert not row.too_close
    assert not episode_in_report().too_close


def episode_in_report(**changes):
    """The figures of an episode that reached the goal."""
    numbers = ("d0", "d_min", "d0_euclidean", "d_min_euclidean", "call_ms_mean")
    flags = ("progress_passed", "progress_passed_euclidean")
    fields = {
        "name": "nominal",
        "held_out": False,
        "outcome": "reached",
        "steps": 3,
        "collisions": 0,
        "call_ms_p99": 0.0,
        **dict.fromkeys(numbers, 0.0),
        **dict.fromkeys(flags, True),
    }
    return Episode(**fields | changes)


def test_the_report_of_a_suite_names_the_closest_episode():
    """In its properties, and in its table on the terminal."""
    near, far = gap_in(0.125, step=4, x=41.0, y=20.0), gap_in(3.0)
    episodes = (
        episode_in_report(smallest_gap=far),
        episode_in_report(name="jitter 1", smallest_gap=near),
        episode_in_report(name="jitter 2"),
    )
    report = Report.model_construct(episodes=episodes)
    assert report.closest == episodes[1]
    assert report.smallest_gap == near
    assert report.too_close == (episodes[1],)
    console = Console(file=StringIO(), width=100)
    console.print(episode_table(report, PIXELS))
    nominal, first, second = console.file.getvalue().splitlines()[-4:-1]
    assert "3 px" in nominal
    assert "0.125 px" in first
    assert "–" in second
    assert Report.model_construct(episodes=()).smallest_gap is None


def test_the_table_of_a_suite_fits_on_80_columns():
    """The widest words and large figures are whole, each episode on one line."""
    lengths = dict.fromkeys(("d0", "d_min", "d0_euclidean", "d_min_euclidean"), 9999.0)
    widest = episode_in_report(
        name="held-out 10",
        outcome="out of time",
        steps=99999,
        collisions=10,
        call_ms_p99=9.0,
        call_ms_mean=123.45,
        smallest_gap=gap_in(0.0123),
        **lengths,
    )
    report = Report.model_construct(episodes=(widest,))
    console = Console(file=StringIO(), width=80)
    console.print(episode_table(report, PIXELS))
    text = console.file.getvalue()
    assert "…" not in text
    assert text.count("9999/9999") == 2
    assert text.splitlines()[-2].split()[-1] == "123.45"


def provenance(**changes):
    fields = {
        "name": "maze", "sha256": "0", "controller_sha256": "0", "sandbox": "none",
        "limits": {}, "versions": {},
    }  # fmt: skip
    return EpisodeProvenance(**fields | changes)


def gap_in(gap, **place):
    found = Gap(gap=gap, radii=gap / 5.0, required=0.25, **place)
    return found.model_copy(update={"close": found if gap < 0.25 else None})


def two_rows():
    near = gap_in(0.125, step=4, x=41.0, y=20.0, heading=0.0, thing="wall")
    far = gap_in(3.0, step=1, x=2.0, y=3.0, heading=0.0, thing="wall")
    shared = {"outcome": "reached", "steps": 9}
    return [
        EpisodeRow(seed=7, smallest_gap=far, **shared),
        EpisodeRow(seed=8, smallest_gap=near, **shared),
    ]


def test_a_report_has_the_smallest_gap_of_its_episodes():
    """With the number of its episode and of those too close; hidden ones keep both."""
    report = summarise(provenance(), two_rows(), None, 1.0)
    assert report.smallest_gap.gap == 0.125
    assert report.closest == 8
    assert report.too_close == 1
    first, second = report.gap_lines(PIXELS)
    assert first == (
        "smallest gap: 0.125 px (2.5 % of the radius) to the wall at (41.0, 20.0) in "
        "step 4, seed 8"
    )
    assert second == (
        "1 of the successes came too close: 0.125 px (2.5 % of the radius) to the wall "
        "at (41.0, 20.0) in step 4; required 0.25 px"
    )
    hidden = summarise(provenance(split="hidden"), two_rows(), None, 1.0, told=False)
    assert hidden.closest is None
    assert hidden.episodes == ()


def test_a_junit_file_has_the_smallest_gap_as_a_property(tmp_path):
    """In the unit of the report, with the number of episodes too close."""
    report = summarise(provenance(split="dev"), two_rows(), None, 1.0)
    write_set_junit(report, tmp_path / "junit.xml")
    found = ElementTree.parse(tmp_path / "junit.xml").findall(".//property")
    values = {each.get("name"): each.get("value") for each in found}
    assert values == {
        "smallest_gap_px": "0.125",
        "required_gap_px": "0.25",
        "too_close": "1",
    }


def test_gaps_read_in_the_units_of_the_user():
    """Three digits, in px or mm, and on maps with a resolution in mm if small."""
    assert gap_figure(0.0004, METRES) == "0.4 mm"
    frame = MapFrame(resolution=0.05, origin=(0.0, 0.0, 0.0), height=60)
    units = PIXELS.in_metres(MapUnits(frame))
    assert gap_figure(0.125, units) == "6.25 mm"
    assert gap_figure(10.0, units) == "0.5 m"
    gap = gap_in(0.125, step=4, x=41.0, y=20.0, heading=0.0, thing="mover 2")
    assert gap_text(gap, PIXELS) == (
        "0.125 px (2.5 % of the radius) to mover 2 at (41.0, 20.0) in step 4"
    )
    assert too_close_text(gap, PIXELS).endswith("; required 0.25 px")


def test_the_verdict_names_the_smallest_gap_that_is_too_close():
    """Not that of a start, although it is smaller."""
    near = gap_in(0.125, step=4, x=41.0, y=20.0, heading=0.0, thing="wall")
    row = EpisodeRow(seed=0, outcome="reached", steps=9, smallest_gap=near)
    test = ConfirmingTest(0.95, 0.05, 1, 4)
    rows = [tight_start(), row, row, tight_start()]
    report = summarise(provenance(), rows, test, 1.0)
    assert word_of(report) == "passed"
    assert confirmed_text(report) == (
        "2 of 4 blind drives came too close: 0.125 px (2.5 % of the radius) to the "
        "wall at (41.0, 20.0) in step 4; required 0.25 px"
    )
    starts = summarise(provenance(), [tight_start()] * 4, test, 1.0)
    assert word_of(starts) == "verified"
