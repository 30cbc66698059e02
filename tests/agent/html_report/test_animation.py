"""Few whole numbers tell where the robot was at each step."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from without_marks import reading

from tdac_agent import load_task
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report.animation import RAD, TOLERANCE, animations, thinned
from tdac_agent.html_report.scene import scene_of
from tdac_agent.runs.history import gather_run
from tdac_agent.verification.diagnosis.figures import contact_of

WALKS = arrays(
    np.float64,
    st.tuples(st.integers(1, 60), st.just(3)),
    elements=st.floats(-3.0, 3.0),
).map(lambda steps: np.cumsum(steps, axis=0))


def linear(rows, kept):
    """Rows between those that are kept, by linear interpolation over time."""
    at = np.arange(len(rows))
    return np.column_stack([np.interp(at, kept, column[kept]) for column in rows.T])


@settings(deadline=None)
@given(WALKS)
def test_what_is_left_out_lies_on_the_line(poses):
    """At every step, also with a heading that turns, and the ends are kept."""
    kept = thinned(poses, most=1_000)
    assert kept[0] == 0
    assert kept[-1] == len(poses) - 1
    off = np.abs(linear(poses, kept) - poses) * (1.0, 1.0, RAD)
    assert off.max() <= TOLERANCE + 1e-9


@settings(deadline=None)
@given(WALKS, st.integers(2, 20))
def test_never_more_points_than_wanted(poses, most):
    """However erratic it was."""
    assert len(thinned(poses, most)) <= most


def test_a_straight_line_needs_its_ends():
    """A thousand steps straight ahead are two points."""
    poses = np.outer(np.arange(1001.0), [1.0, 0.5, 0.01])
    assert thinned(poses, 400).tolist() == [0, 1000]


def test_places_of_a_map(small_task):
    """Pixel (x, y) is its square in the enlarged picture; headings stay."""
    scene = scene_of(small_task)
    zoom = scene.width / 160
    assert scene.height == 120 * zoom
    poses = scene.at(np.array([[30.0, 60.0, 3.0], [31.0, 60.0, -3.0]]))
    assert poses[:, 0] == pytest.approx([30.5 * zoom, 31.5 * zoom])
    assert poses[:, 1] == pytest.approx([60.5 * zoom] * 2)
    assert poses[:, 2] == pytest.approx([3.0, 2 * np.pi - 3.0])
    assert scene.radius == pytest.approx(6 * zoom)


def test_places_of_a_world():
    """Up is up: y grows upwards, headings turn the other way on the screen."""
    task = load_task("epuck")
    scene = scene_of(task)
    (low, high) = scene.at(np.array([[0.0, 0.0, 0.5], [0.0, 0.1, 0.5]]))
    assert low[0] == pytest.approx(high[0])
    assert low[1] > high[1]
    assert low[2] == -0.5
    assert (low[1] - high[1]) * 0.37 == pytest.approx(scene.radius)  # 37 mm


@pytest.mark.slow
def test_an_episode_as_numbers(runs):
    """The sums of the differences are the judge's poses, in quarters of a pixel."""
    told = gather_run(runs / "verified")
    scene = scene_of(told.task)
    episodes = animations(told, told.task, scene)
    names = [(episode["candidate"], episode["name"]) for episode in episodes]
    assert names[0] == ("1.0", "nominal")
    assert [name for name in names if name[0] == "1.1"] == [
        ("1.1", name)
        for name in ("nominal", *(f"jitter {n}" for n in range(1, 6)))
    ]  # fmt: skip
    assert episodes[0]["outcome"] == "collision"
    for one in told.tried:
        for name, trajectory in one.trajectories():
            episode = episodes[names.index((f"{one.k}.{one.j}", name))]
            rows = np.cumsum(np.reshape(episode["points"], (-1, 4)), axis=0)
            assert rows[-1, 0] == episode["steps"] == trajectory.steps
            poses = scene.at(trajectory.poses)
            drawn = np.column_stack(
                [np.interp(range(len(poses)), rows[:, 0], c) for c in rows[:, 1:].T]
            )
            off = np.abs(drawn / (4, 4, 100) - poses) * (1, 1, RAD)
            assert off.max() <= TOLERANCE + 0.125 + 1e-6
            where = contact_of(told.task.nominal, trajectory, episode["outcome"])
            assert (where is None) == (episode["contact"] is None)
            if where is not None:
                mark = scene.at(np.array([where]))[0]
                assert episode["contact"] == pytest.approx(mark.tolist(), abs=0.06)


def test_movers_as_numbers(copied):
    """Each has its way, to the same precision, and its radius; others have none."""
    file = copied / "iterations" / "k01" / "j0" / "trajectories" / "nominal.npz"
    trajectory = Trajectory.load(file)
    turns = np.linspace(0.0, 3.0, trajectory.steps + 1)
    ways = [(80 + 30 * np.cos(turns), 60 + 30 * np.sin(turns)), (20 + turns, 9 * turns)]
    discs = [np.column_stack([x, y, np.full_like(x, 5.0)]) for x, y in ways]
    movers = np.stack(discs, axis=1).astype(np.float32)
    replace(trajectory, movers=movers).save(file)
    told = gather_run(copied)
    scene = scene_of(told.task)
    first, *others = animations(told, told.task, scene)
    assert [len(each["movers"]) for each in (first, others[0])] == [2, 0]
    for disc, mover in enumerate(first["movers"]):
        rows = np.cumsum(np.reshape(mover["points"], (-1, 3)), axis=0)
        places = scene.at(movers[:, disc, :2].astype(float))
        drawn = np.column_stack(
            [np.interp(range(len(places)), rows[:, 0], c) for c in rows[:, 1:].T]
        )
        assert np.abs(drawn / 4 - places).max() <= TOLERANCE + 0.125 + 1e-6
        assert mover["radius"] == pytest.approx(scene.radius * 5 / 6, abs=0.06)
    assert "movers, with their last second" in reading(copied)


def test_a_page_without_movers(page):
    """Its legend has none."""
    assert "movers, with" not in page
