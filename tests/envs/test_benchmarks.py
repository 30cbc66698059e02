"""Promises of the benches' own numbers."""

import pytest

from benchmarks.plain_grid import best_score
from benchmarks.preprocessing import RADIUS, floor_plan
from benchmarks.timing import Row, compared, duration, in_turn
from tdac_envs.mapping.preprocessing import rank_candidates


@pytest.mark.slow
def test_the_straightforward_version_does_the_same_work():
    """Its best score is ours but for how it measures clearance: within 2 px of it."""
    picture, start, goal = floor_plan(0.2)
    ours = rank_candidates(picture, start, goal, RADIUS, preset="paper")
    assert sum(c.terms is not None for c in ours) > 10
    assert best_score(picture, start, goal, RADIUS) == pytest.approx(
        ours[0].score, abs=2.5 * 2
    )


def test_ratios_are_between_times_of_the_same_round():
    """What disturbs a round disturbs both of its times."""
    times = {"floor": [1.0, 2.0, 50.0], "mine": [2.0, 4.0, 100.0]}
    bench = compared("Title", times, "floor", "floor", {"mine": 4.0}, {"mine": "note"})
    assert bench.rows == [
        Row("floor", 2.0, 1.0, 50.0, 1.0, 1.0, 1.0, 1.0),
        Row("mine", 4.0, 2.0, 100.0, 2.0, 0.5, 0.5, 0.5, 4.0, "note"),
    ]


@pytest.mark.parametrize("rounds", [1, 2])
def test_cases_of_other_rounds_are_compared_by_their_medians(rounds):
    """One round is enough."""
    bench = compared("Title", {"a": [6.0] * rounds, "b": [3.0]}, "a", "a")
    assert bench.rows[1] == Row("b", 3.0, 3.0, 3.0, 0.5, 2.0, 2.0, 2.0)


def test_each_case_is_timed_in_each_round():
    """A call that returns a number made so many steps; the first is not seen."""
    calls = []
    cases = {name: lambda n=name: calls.append(n) for name in "ab"}
    times = in_turn({**cases, "many": lambda: 10**9}, 2)
    assert calls == list("ababab")
    assert [len(seconds) for seconds in times.values()] == [2, 2, 2]
    assert max(times["many"]) < 1e-6


@pytest.mark.parametrize(
    ("seconds", "text"), [(1.234, "1.23 s"), (0.0456, "45.6 ms"), (2e-9, "2 ns")]
)
def test_durations_have_a_unit(seconds, text):
    assert duration(seconds) == text
