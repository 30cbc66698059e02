"""Promises of distances to prisms and of the swept disc; pymunk is the oracle."""

import math

import numpy as np
import pymunk
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_envs.drive.stepping import move
from tdac_envs.epuck.contact import advance, first_touch
from tdac_envs.epuck.gaps import clear_grid, nearest_gap
from tdac_envs.epuck.infrared import sees
from tdac_envs.epuck.prisms import Owned, Prisms
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle
from tdac_envs.worlds.world import Part

RADIUS = 0.037
seeds = st.integers(0, 2**32 - 1)


def scattered(rng, count=12):
    """Random discs, rectangles (some very thin) and polygons on a square metre."""
    shapes = []
    for _ in range(count):
        x, y = rng.uniform(-0.5, 0.5, 2)
        kind = rng.integers(3)
        if kind == 0:
            shapes.append(Disc(x, y, rng.uniform(0.002, 0.1)))
        elif kind == 1:
            length, width = rng.uniform(0.05, 0.3), rng.choice([0.0005, 0.01, 0.1])
            shapes.append(Rectangle(x, y, rng.uniform(-3, 3), length, width))
        else:
            corners = np.add(rng.uniform(-0.1, 0.1, (rng.integers(4, 9), 2)), (x, y))
            shapes.append(Polygon.around(corners))
    return shapes


def arrays(shapes):
    return Prisms.of(Owned(Part(shape, 0.0, 0.1)) for shape in shapes).arrays()


def space_of(shapes):
    """The same shapes in a pymunk space."""
    space = pymunk.Space()
    for shape in shapes:
        if isinstance(shape, Disc):
            space.add(
                pymunk.Circle(space.static_body, shape.radius, (shape.x, shape.y))
            )
        else:
            space.add(pymunk.Poly(space.static_body, shape.vertices.tolist()))
    space.reindex_static()
    return space


def oracle_gap(space, x, y):
    found = space.point_query_nearest((x, y), 10.0, pymunk.ShapeFilter())
    return found.distance


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_the_gap_is_that_of_a_physics_engine(seed):
    """Signed distance to the nearest of discs and convex polygons."""
    rng = np.random.default_rng(seed)
    shapes = scattered(rng)
    space, prisms = space_of(shapes), arrays(shapes)
    for x, y in rng.uniform(-0.7, 0.7, (40, 2)):
        expected = oracle_gap(space, x, y)
        assert nearest_gap(*prisms, x, y) == pytest.approx(expected, abs=1e-9)


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_the_first_contact_is_the_first_and_a_contact(seed):
    """On the way to it nothing is nearer than the radius; there, something is."""
    rng = np.random.default_rng(seed)
    shapes = scattered(rng)
    space, prisms = space_of(shapes), arrays(shapes)
    for _ in range(20):
        x, y = rng.uniform(-0.7, 0.7, 2)
        if oracle_gap(space, x, y) < RADIUS + 1e-9:
            continue
        heading, turn = rng.uniform(-3, 3), rng.choice([0.0, rng.uniform(-3, 3)])
        forward = rng.uniform(-0.6, 0.6)
        share = first_touch(*prisms, x, y, heading, forward, turn, RADIUS)
        end = min(share, 1.0)
        for part in np.linspace(0.0, end, 100):
            at = move.py_func(x, y, heading, part * forward, part * turn)
            assert oracle_gap(space, at[0], at[1]) >= RADIUS - 1e-8
        if share <= 1.0:
            assert oracle_gap(space, at[0], at[1]) == pytest.approx(RADIUS, abs=1e-8)


@pytest.mark.slow
def test_a_disc_that_was_stopped_may_leave_but_not_go_on():
    """Driving on moves it by nothing, driving off by all of the way."""
    wall = arrays([Rectangle(0.2, 0.0, 0.0, 0.002, 0.5)])
    prisms = *wall, np.empty(0, np.int64), 0, 1
    state = np.zeros(3)
    assert advance(*prisms, state, 0.3, 0.0, RADIUS)[0]
    stopped = state[0]
    assert 0.199 - RADIUS - stopped == pytest.approx(0.0, abs=1e-8)
    for _ in range(100):
        assert advance(*prisms, state, 0.3, 0.0, RADIUS)[0]
    assert state[0] == pytest.approx(stopped, abs=1e-6)
    assert not advance(*prisms, state, -0.1, 0.0, RADIUS)[0]
    assert state[0] == pytest.approx(stopped - 0.1, abs=1e-6)


def test_turning_in_place_touches_nothing():
    prisms = arrays([Disc(0.05, 0.0, 0.02)])
    assert first_touch(*prisms, 0.0, 0.0, 0.0, 0.0, 3.0, RADIUS) == 2.0


def test_the_grid_of_clearances_is_the_gap_at_its_points():
    """Up to the largest distance of interest."""
    rng = np.random.default_rng(2)
    prisms = arrays(scattered(rng))
    clear = np.full((40, 50), 0.1)
    clear_grid(*prisms, -0.6, -0.5, 0.025, clear)
    for v in range(40):
        for u in range(50):
            gap = nearest_gap(*prisms, -0.6 + 0.025 * u, -0.5 + 0.025 * v)
            assert clear[v, u] == pytest.approx(min(gap, 0.1), abs=1e-12)


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_what_is_in_between_hides(seed):
    """A line of sight is free exactly where a physics engine's segment hits nothing."""
    rng = np.random.default_rng(seed)
    shapes = scattered(rng)
    space, prisms = space_of(shapes), arrays(shapes)
    for _ in range(20):
        one, two = rng.uniform(-0.7, 0.7, (2, 2)).tolist()
        near = min(oracle_gap(space, *one), oracle_gap(space, *two))
        if near < 1e-6 or math.dist(one, two) < 1e-3:
            continue
        hit = space.segment_query_first(one, two, 0.0, pymunk.ShapeFilter())
        assert sees(*prisms, *one, *two) == (hit is None)
