"""Promises of the occupancy grid and its clearance."""

import copy
import pickle

import brute_force
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tdac_envs.core.errors import MapError
from tdac_envs.grid.grid import (
    OccupancyGrid,
    body_free,
    clearance,
    clearance_at,
    inflate,
)

maps = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=24))


def test_cells_are_read_only_and_copied():
    cells = np.zeros((3, 4), bool)
    grid = OccupancyGrid(cells)
    cells[0, 0] = True
    assert not grid.cells[0, 0]
    with pytest.raises(ValueError, match="read-only"):
        grid.cells[0, 0] = True
    assert (grid.width, grid.height) == (4, 3)


@pytest.mark.parametrize("shape", [(0, 3), (3,), (2, 2, 2)])
def test_a_grid_has_two_dimensions(shape):
    with pytest.raises(MapError, match="expected a 2-D grid"):
        OccupancyGrid(np.zeros(shape, bool))


@pytest.mark.parametrize("resolution", [0.0, -1.0, float("nan")])
def test_a_resolution_is_positive(resolution):
    with pytest.raises(MapError, match="resolution above 0"):
        OccupancyGrid(np.zeros((2, 2), bool), resolution)


def test_pixels_are_half_open_squares_about_their_centres():
    cells = np.zeros((3, 3), bool)
    cells[1, 1] = True
    grid = OccupancyGrid(cells)
    assert grid.is_occupied(0.5, 0.5)
    assert grid.is_occupied(1.49, 1.49)
    assert not grid.is_occupied(1.5, 1.0)
    assert not grid.is_occupied(-0.5, -0.5)
    assert grid.is_occupied(-0.51, 0.0)
    assert grid.is_occupied(2.5, 0.0)


def test_equal_grids_are_equal_and_stay_so_in_copies():
    cells = np.eye(5, dtype=bool)
    grid = OccupancyGrid(cells, 0.05)
    assert grid == OccupancyGrid(cells.copy(), 0.05)
    assert hash(grid) == hash(OccupancyGrid(cells.copy(), 0.05))
    assert grid != OccupancyGrid(cells)
    assert grid != OccupancyGrid(~cells, 0.05)
    for twin in (pickle.loads(pickle.dumps(grid)), copy.deepcopy(grid)):
        assert twin == grid
        assert not twin.cells.flags.writeable


def test_the_hash_tells_shapes_apart():
    wide, tall = np.zeros((2, 8), bool), np.zeros((8, 2), bool)
    assert OccupancyGrid(wide).sha256() != OccupancyGrid(tall).sha256()


@given(maps)
@settings(derandomize=True, deadline=None, max_examples=150)
def test_clearance_is_the_distance_to_the_nearest_square(cells):
    y, x = np.indices(cells.shape)
    expected = brute_force.distance(cells, x, y)
    np.testing.assert_allclose(clearance(cells), expected, rtol=1e-6)


@pytest.mark.parametrize("density", [0.0, 0.001, 0.05])
def test_clearance_on_a_sparse_map(density):
    cells = np.random.default_rng(3).random((60, 90)) < density
    y, x = np.indices(cells.shape)
    expected = brute_force.distance(cells, x, y)
    np.testing.assert_allclose(clearance(cells), expected, rtol=1e-6)


@given(maps, st.floats(-0.5, 23.4), st.floats(-0.5, 23.4), st.floats(0.1, 30.0))
@settings(derandomize=True, deadline=None, max_examples=150)
def test_clearance_at_any_point_up_to_a_limit(cells, x, y, limit):
    height, width = cells.shape
    x, y = min(x, width - 0.6), min(y, height - 0.6)
    expected = min(float(brute_force.distance(cells, x, y)), limit)
    assert clearance_at(cells, x, y, limit) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("radius", [0, 1, 2.3, 5])
def test_inflate_takes_all_cells_within_the_radius(radius):
    cells = np.random.default_rng(1).random((20, 30)) < 0.02
    rows, columns = np.nonzero(cells)
    y, x = np.indices(cells.shape)
    gaps = np.hypot(x[..., None] - columns, y[..., None] - rows).min(axis=-1)
    np.testing.assert_array_equal(inflate(cells, radius), gaps <= radius)


def test_inflate_of_an_empty_map_is_empty():
    assert not inflate(np.zeros((4, 4), bool), 3.0).any()


@pytest.mark.parametrize("radius", [0.4, 2.0, 3.7])
def test_a_step_between_body_free_pixels_touches_nothing(radius):
    cells = np.random.default_rng(5).random((40, 40)) < 0.03
    free = body_free(clearance(cells), radius)
    for y, x in np.argwhere(free[1:-1, 1:-1])[::7] + 1:
        for dx, dy in ((1, 0), (0, 1), (1, 1), (-1, 1)):
            if not free[y + dy, x + dx]:
                continue
            part = np.linspace(0, 1, 33)
            gaps = brute_force.distance(cells, x + part * dx, y + part * dy)
            assert gaps.min() >= radius - 1e-6
