"""Promises of the grid planner."""

from pathlib import Path

import brute_force
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.graph import MCP_Geometric

from tdac_envs.grid import astar
from tdac_envs.grid.plan import (
    descend,
    distance_field,
    guide_between,
    path_length,
    plan_path,
    plan_paths,
)
from tdac_envs.mapping.map_files import read_movingai

MOVINGAI = Path(__file__).parents[4] / "shared/data/maps/movingai"


def has_one_ground(scenario):
    """Water and swamp have rules of their own: water may be swum in, for one."""
    rows = scenario.with_suffix("").read_text().splitlines()[4:]
    return not set("WS") & set("".join(rows))


SCENARIOS = sorted(filter(has_one_ground, MOVINGAI.glob("*.scen")))


def random_free(seed, density, shape=(15, 18)):
    return np.random.default_rng(seed).random(shape) >= density


def assert_path(free, path, start, goal):
    """Unit steps over free pixels from start to goal, past no occupied corner."""
    assert tuple(path[0]) == start
    assert tuple(path[-1]) == goal
    pixels = path.astype(int)
    assert free[pixels[:, 1], pixels[:, 0]].all()
    steps = np.diff(pixels, axis=0)
    assert (np.abs(steps).max(axis=1) == 1).all()
    assert free[pixels[:-1, 1], pixels[1:, 0]].all()
    assert free[pixels[1:, 1], pixels[:-1, 0]].all()


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.15, 0.3, 0.45]))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_lengths_and_paths_are_shortest(seed, density):
    free = random_free(seed, density)
    start, goal = (1, 2), (16, 13)
    expected = brute_force.shortest(free, start, goal)
    length = distance_field(free, goal)[start[::-1]] if free[goal[::-1]] else np.inf
    assert length == pytest.approx(expected) or not free[start[::-1]]
    path = plan_path(free, start, goal)
    assert (len(path) > 0) == np.isfinite(expected)
    if len(path):
        assert path_length(path) == pytest.approx(expected)
        assert_path(free, path, start, goal)


def test_the_open_field_is_that_of_scikit_image():
    ours = distance_field(np.ones((40, 50), bool), (7, 9))
    theirs, _ = MCP_Geometric(np.ones((40, 50))).find_costs([(9, 7)])
    np.testing.assert_allclose(ours, theirs)


@pytest.mark.parametrize("seed", range(5))
def test_the_field_is_that_of_scikit_image_but_for_cut_corners(seed):
    """MCP_Geometric passes diagonally between obstacles, which only shortens."""
    free = np.kron(random_free(seed, 0.2, (12, 12)), np.ones((9, 9), bool))
    goal = tuple(int(v) for v in np.argwhere(free)[0])
    ours = distance_field(free, goal[::-1])
    theirs, _ = MCP_Geometric(np.where(free, 1.0, -1.0)).find_costs([goal])
    reached = np.isfinite(ours)
    assert reached.sum() > 1000
    assert (theirs[reached] <= ours[reached] + 1e-9).all()


@pytest.mark.parametrize("goal", [(-1, 0), (0, 9), (3, 3)])
def test_field_of_a_goal_outside_or_occupied_is_infinite(goal):
    free = np.ones((8, 8), bool)
    free[3, 3] = False
    assert np.isinf(distance_field(free, goal)).all()


def assert_same_path(free, start, goal, guide=None):
    """Equal to the descent of the whole field, ties included."""
    wanted = descend(free, distance_field(free, goal), start)
    np.testing.assert_array_equal(plan_path(free, start, goal, guide), wanted)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.25, 0.4]))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_the_search_takes_the_path_of_the_whole_field(seed, density):
    """Of several shortest paths, it is always the same one."""
    free = random_free(seed, density, (40, 55))
    free[3, 2] = free[35, 50] = True
    assert_same_path(free, (2, 3), (50, 35))


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.3]))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_a_guide_changes_nothing(seed, density):
    """One search guides those in parts of its pixels, also where the way is longer."""
    free = random_free(seed, density, (40, 55))
    free[3, 2] = free[35, 50] = True
    guide = guide_between(free, (2, 3), (50, 35))
    for part in (free, free & random_free(seed + 1, 0.1, free.shape)):
        part[3, 2] = part[35, 50] = True
        if guide is None:
            assert len(plan_path(part, (2, 3), (50, 35))) == 0
        else:
            assert_same_path(part, (2, 3), (50, 35), guide)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.1, 0.3]))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_paths_of_many_spaces_are_those_of_each(seed, density):
    """Whether one lies within the other, has longer ways, or none."""
    start, goal = (2, 3), (50, 35)
    whole = random_free(seed, density, (40, 55))
    holes = [random_free(seed + n, 0.04 * n, whole.shape) for n in range(4)]
    spaces = [whole & hole for hole in holes] + [whole & holes[1] & holes[2]]
    for space in spaces:
        space[3, 2] = space[35, 50] = True
    together = np.logical_or.reduce(spaces)
    guide = guide_between(together, start, goal)
    if guide is None:
        assert not any(len(plan_path(space, start, goal)) for space in spaces)
        return
    for space, path in zip(spaces, plan_paths(spaces, start, goal, guide), strict=True):
        wanted = descend(space, distance_field(space, goal), start)
        np.testing.assert_array_equal(path, wanted)


def test_buckets_grow_where_many_paths_are_equally_long(monkeypatch):
    """In an open place nearly every pixel is on some shortest path."""
    monkeypatch.setattr(astar, "_PIXELS_PER_ENTRY", 10**9)
    assert_same_path(np.ones((90, 160), bool), (5, 5), (150, 80))


@pytest.mark.parametrize("start", [(-1, 0), (9, 9), (2, 2)])
def test_no_path_is_an_empty_path(start):
    free = np.ones((8, 8), bool)
    free[2, 2] = False
    assert plan_path(free, start, (0, 0)).shape == (0, 2)


def test_start_at_the_goal_is_one_point():
    path = plan_path(np.ones((3, 3), bool), (1, 1), (1, 1))
    np.testing.assert_array_equal(path, [[1, 1]])
    assert path_length(path) == 0.0


def test_the_descent_of_a_rounded_field_ends_at_the_goal():
    """A float32 field, as a task keeps it, is as good for the path."""
    free = random_free(11, 0.25, (300, 300))
    free[10, 10] = free[280, 280] = True
    field = distance_field(free, (10, 10))
    rounded = field.astype(np.float32).astype(np.float64)
    path = descend(free, rounded, (280, 280))
    assert_path(free, path, (280, 280), (10, 10))
    assert path_length(path) == pytest.approx(field[280, 280], rel=1e-5)


def scenarios(file, count):
    """Every n-th scenario: start, goal and optimal length."""
    lines = file.read_text().splitlines()[1:]
    rows = [line.split() for line in lines if line.strip()]
    for row in rows[:: max(len(rows) // count, 1)]:
        *ends, length = row[4:9]
        x, y, to_x, to_y = map(int, ends)
        yield (x, y), (to_x, to_y), float(length)


def assert_optimal(file, count):
    occupied = read_movingai(file.with_suffix("")).occupied
    for start, goal, length in scenarios(file, count):
        path = plan_path(~occupied, start, goal)
        assert path_length(path) == pytest.approx(length, abs=0.01)


@pytest.mark.skipif(not SCENARIOS, reason="the public maps are not here")
@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.name)
def test_movingai_lengths(file):
    assert_optimal(file, 4)


@pytest.mark.slow
@pytest.mark.skipif(not SCENARIOS, reason="the public maps are not here")
@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.name)
def test_many_movingai_lengths(file):
    assert_optimal(file, 200)
