"""Promises of the benches' own numbers."""

import pytest

from benchmarks.plain_grid import best_score
from benchmarks.preprocessing import RADIUS, floor_plan
from benchmarks.timing import Row, compared, duration, row_of
from tdac_envs.preprocessing import rank_candidates


def test_the_straightforward_version_does_the_same_work():
    """Its best score is ours but for how it measures clearance: within 2 px of it."""
    picture, start, goal = floor_plan(0.2)
    ours = rank_candidates(picture, start, goal, RADIUS, preset="paper")
    assert sum(c.terms is not None for c in ours) > 10
    assert best_score(picture, start, goal, RADIUS) == pytest.approx(
        ours[0].score, abs=2.5 * 2
    )


def test_ratios_are_of_the_fastest_times():
    rows = [row_of("floor", [2.0, 1.0, 9.0]), row_of("mine", [3.0, 5.0])]
    bench = compared("Title", rows, "floor", "floor", {"mine": 4.0})
    assert bench.rows == [
        Row("floor", 2.0, 1.0, 9.0, 1.0, 1.0),
        Row("mine", 4.0, 3.0, 5.0, 3.0, 3.0, 4.0),
    ]


@pytest.mark.parametrize(
    ("seconds", "text"), [(1.234, "1.23 s"), (0.0456, "45.6 ms"), (2e-9, "2 ns")]
)
def test_durations_have_a_unit(seconds, text):
    assert duration(seconds) == text
