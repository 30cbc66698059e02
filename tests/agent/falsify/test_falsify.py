"""The search names what makes a controller fail, and by how much."""

import json
import os
import signal
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.margins import (
    BREAKS_WHEN_LATE,
    CAREFUL,
    GAP,
    KNOWS_ITS_AXLE,
    LATE,
    RADIUS,
    TURN,
    write_corridor,
)
from tdac_agent import load_task
from tdac_agent.evaluation.policies import entrant_of
from tdac_agent.falsify.falsify import SearchPlan, falsify
from tdac_agent.falsify.search import between, near
from tdac_agent.tasks.deviation import DEVIATIONS, Deviation

PLAN = SearchPlan(episodes=64)
POSES = dict.fromkeys(("delay", "axle", "range_scale", "range_bias", "pose_y"))
OTHERS = dict.fromkeys(("delay", "axle", "range_scale", "range_bias"))


@pytest.fixture(scope="module")
def corridor(tmp_path_factory):
    return load_task(write_corridor(tmp_path_factory.mktemp("corridor")))


@pytest.fixture
def search(corridor, tmp_path, warm):
    def run(source, plan=PLAN, **options):
        file = tmp_path / "controller.py"
        file.write_text(source)
        entrant = replace(entrant_of(str(file)), name="controller.py")
        return falsify(entrant, corridor, plan, judge=warm, **options)

    return run


def smallest(found):
    failed = found.counterexample
    assert failed is not None
    assert not failed.row.success
    return failed.deviation.parts()


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_delay_is_named_exactly(search, seed):
    plan = replace(PLAN, space=OTHERS, seed=seed)
    assert smallest(search(BREAKS_WHEN_LATE, plan)) == {"delay": LATE}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_an_axle_is_named_within_a_tenth(search, seed):
    plan = replace(PLAN, space=OTHERS, seed=seed)
    parts = smallest(search(KNOWS_ITS_AXLE, plan))
    assert list(parts) == ["axle"]
    # The turn is told divided by 1 + error: too short an axle is noticed first.
    assert parts["axle"] == pytest.approx(1.0 / (1.0 + TURN) - 1.0, rel=0.1)


@pytest.mark.slow
def test_a_gap_that_is_ignored_is_named_within_a_tenth(search):
    plan = replace(PLAN, space=POSES)
    parts = smallest(search(CAREFUL, plan))
    assert list(parts) == ["pose_y"]
    # It seems to be higher up than it is, so that it drives nearer to the wall.
    assert -parts["pose_y"] * RADIUS == pytest.approx(GAP, rel=0.1)


@pytest.mark.slow
def test_nobody_is_accused_without_a_failure(search):
    found = search(CAREFUL, replace(PLAN, space=OTHERS))
    assert found.counterexample is None
    assert all(each.fails is None for each in found.envelopes[0].directions)
    assert found.episodes <= PLAN.episodes


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_goes_on(search, tmp_path):
    plan = replace(PLAN, episodes=48)
    whole = tmp_path / "whole"
    found = search(CAREFUL, plan, out=whole)
    assert 16 < found.episodes <= 48

    def stop(count):
        if count > 20:
            raise KeyboardInterrupt

    cut = tmp_path / "cut"
    with pytest.raises(KeyboardInterrupt):
        search(CAREFUL, plan, out=cut, watch=stop)
    kept = (cut / "unfinished" / "episodes.jsonl").read_text().splitlines()
    assert len(kept) > 20
    counts = []
    again = search(CAREFUL, plan, out=cut, watch=counts.append)
    assert _plain(again) == _plain(found)
    files = {each.name for each in cut.iterdir()}
    assert files == {"falsify.json"}
    assert counts[-1] == found.episodes


def test_an_interruption_while_drawing_loses_nothing(search, tmp_path):
    def stop(found):
        assert found.episodes <= 16
        raise KeyboardInterrupt

    kept = []
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            search(CAREFUL, replace(PLAN, episodes=16), out=tmp_path, finish=stop)
        assert (tmp_path / "falsify.json").is_file()
        kept.append((tmp_path / "unfinished" / "episodes.jsonl").read_bytes())
    assert kept[0] == kept[1] != b""


def test_a_worker_that_dies_between_two_batches_is_replaced(search, warm):
    """What it drove stays; the batches after it have another worker."""
    workers = []

    def kill_first(count):
        assert warm._series is not None
        workers.append(warm._series[0])
        if len(workers) == 1:
            os.killpg(workers[0], signal.SIGKILL)
            while not warm._has_answer():
                os.sched_yield()

    plan = replace(PLAN, episodes=16, space={"delay": None})
    found = search(BREAKS_WHEN_LATE, plan, watch=kill_first)
    assert smallest(found) == {"delay": LATE}
    assert len(workers) > 2
    assert len(set(workers)) == 2
    assert warm._series is None  # the worker has ended with the search


def _plain(found):
    """The record without the CPU time of episodes."""

    def without(value):
        if isinstance(value, dict):
            return {k: without(v) for k, v in value.items() if k != "cpu_seconds"}
        return [*map(without, value)] if isinstance(value, list) else value

    return without(json.loads(found.model_dump_json()))


def test_a_failure_without_a_deviation_is_no_finding(search):
    found = search("def policy(obs):\n    return 0.0, 0.0\n")
    assert found.fails_plainly
    assert found.episodes == 1
    assert found.counterexample.deviation == Deviation()


@pytest.mark.slow
def test_curves_count_jittered_starts(search):
    plan = replace(PLAN, episodes=16, space={"delay": None}, curves=3)
    found = search(BREAKS_WHEN_LATE, plan)
    rates = {point.value: (point.successes, point.count) for point in found.curves}
    assert rates == {0.0: (3, 3), 1.0: (3, 3), 2.0: (3, 3), 3.0: (0, 3)}


@pytest.mark.slow
def test_every_part_does_something(search, corridor):
    """Each part, at its largest size, changes the drive."""
    plan = replace(PLAN, episodes=240)
    found = search(BREAKS_WHEN_LATE.replace("50.0", "60.0"), plan)
    tried = {each.part for each in found.envelopes[0].directions}
    assert tried == set(DEVIATIONS)


@given(
    fails=st.floats(1e-7, 100.0),
    sign=st.sampled_from((-1.0, 1.0)),
    step=st.sampled_from((0.0, 1.0, 1.0 / 15)),
)
def test_a_bracket_is_halved_until_it_is_narrow(fails, sign, step):
    safe, fails, count = 0.0, sign * near(fails, step), 0
    while (middle := between(safe, fails, step)) is not None:
        assert min(safe, fails) < middle < max(safe, fails)
        safe, fails = (middle, fails) if count % 2 else (safe, middle)
        count += 1
        assert count < 60
