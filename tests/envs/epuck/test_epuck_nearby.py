"""Promises of the lists of nearby parts: nothing that counts is left out."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tdac_envs import bundled_worlds, load_world
from tdac_envs.epuck.contact import first_touch, touch_of
from tdac_envs.epuck.gaps import listed_at, nearest_gap, nearest_of
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import sense
from tdac_envs.epuck.nearby import surroundings
from tdac_envs.epuck.paths import open_field, path_entry
from tdac_envs.epuck.prisms import FIXED
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.bundled import world_file

STEP = 0.006
NONE = np.empty(0, np.int64)
every_world = pytest.mark.parametrize("name", bundled_worlds())


@pytest.fixture
def place(name):
    """A ground, and what is around at each place of it."""
    ground = Ground.of(load_world(world_file(name)))
    return ground, surroundings(ground, True, True, BODY_RADIUS + STEP)


def poses(ground, count):
    """Anywhere within the fence and a little beyond it."""
    random = np.random.default_rng(3)
    left, low, right, high = ground.bounds
    edge = 0.05
    return np.column_stack(
        [
            random.uniform(left - edge, right + edge, count),
            random.uniform(low - edge, high + edge, count),
            random.uniform(-math.pi, math.pi, count),
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [60, 300])
@every_world
def test_they_change_nothing(name, place, count):
    """Readings, distances and contacts are those with all parts, to the last bit."""
    ground, around = place
    solid, seen = ground.solid, around.visible
    random = np.random.default_rng(4)
    hits, readings = np.zeros((2, 8, 3)), np.zeros((2, 8), np.float32)
    for x, y, heading in poses(ground, count).tolist():
        cell = (*ground.bounds[:2], around.width, x, y)
        begin, end = listed_at(around.seen.cells, len(seen.extent), *cell)
        state = np.array([x, y, heading])
        for k, which in enumerate(((around.seen.listed, begin, end), (NONE, 0, None))):
            listed, first, last = which
            last = len(seen.extent) if last is None else last
            sense(*seen.arrays(), listed, first, last, ground.floor, state,
                  readings[k], hits[k])  # fmt: skip
        np.testing.assert_array_equal(hits[0], hits[1])
        np.testing.assert_array_equal(readings[0], readings[1])
        begin, end = listed_at(around.solid.cells, len(solid.extent), *cell)
        near = (*solid.arrays(), around.solid.listed, begin, end)
        room = nearest_gap(*solid.arrays(), x, y)
        assert nearest_of(*near, x, y) == pytest.approx(room, abs=1e-12)
        arc = (x, y, heading, random.uniform(-STEP, STEP), random.uniform(-1, 1))
        touch = first_touch(*solid.arrays(), *arc, BODY_RADIUS)
        assert touch_of(*near, *arc, BODY_RADIUS) == pytest.approx(touch, abs=1e-9)


@every_world
def test_they_are_short(name, place):
    """In the mean a place has a quarter of all solid parts, or fewer than eight."""
    ground, around = place
    n = len(ground.solid.extent)
    mean = (len(around.solid.listed) - n) / (around.solid.cells[:, 1:].size)
    assert mean < max(8, n / 4)


def test_what_can_be_pushed_is_in_every_list():
    """It may come to be anywhere."""
    ground = Ground.of(load_world(world_file("crates")))
    around = surroundings(ground, False, False, BODY_RADIUS + STEP)
    for prisms, near in ((ground.solid, around.solid), (around.visible, around.seen)):
        mobile = set(np.flatnonzero(prisms.owner != FIXED).tolist())
        assert mobile
        starts = [*near.cells[:, :-1].ravel().tolist(), len(near.listed)]
        for begin, end in pairwise(starts):
            assert mobile <= set(near.listed[begin:end].tolist())


@pytest.mark.parametrize("name", ["maze", "clutter"])
def test_a_path_begins_at_the_nearest_point_that_the_body_gets_to(name):
    """As found by sorting all grid points around and trying one after the other."""
    ground = Ground.of(load_world(world_file(name)))
    free, solid = ground.free(BODY_RADIUS), ground.solid
    left, low, right, high = ground.bounds
    found = 0
    for at in np.random.default_rng(0).uniform((left, low), (right, high), (300, 2)):
        u, v = (at - (left, low)) / ground.spacing
        near = [
            ((i - u) ** 2 + (j - v) ** 2, i, j)
            for i in range(max(round(u) - 3, 0), min(round(u) + 4, free.shape[1]))
            for j in range(max(round(v) - 3, 0), min(round(v) + 4, free.shape[0]))
            if free[j, i]
        ]
        expected = None
        for _, i, j in sorted(near):
            off = np.subtract(ground.at(i, j), at)
            way = (math.atan2(off[1], off[0]), math.hypot(*off), 0.0, BODY_RADIUS)
            if first_touch(*solid.arrays(), *at, *way) > 1:
                expected = (i, j)
                break
        assert path_entry(ground, open_field(free), tuple(at.tolist())) == expected
        found += expected is not None
    assert 100 < found < 300
