"""The suite's answers about worlds, against a second way to get them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_agent import load_task
from tdac_agent.environments.epuck.moved_world import Motion, reordered
from tdac_agent.environments.epuck.oracle import ANGLES, WorldOracle, occupied_at
from tdac_envs import bundled_worlds, load_world, read_world
from tdac_envs.epuck.ground import Ground
from tdac_envs.worlds.bodies import at_body_height, bodies, floor_under
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.wbt.writer import write_world

NAMES = ["epuck", *(f"epuck-{name}" for name in bundled_worlds()[1:])]


def flat(name):
    return load_task(name).nominal.ground.world


def footprints(world):
    """Of everything solid at body height."""
    floor = floor_under(world)
    return [p.shape for t in bodies(world) for p in at_body_height(t.solid, floor)]


def covered(shapes, x, y):
    """Whether one of the footprints covers a point."""
    return any(shape.contains(x, y) for shape in shapes)


def covered_nearby(shapes, x, y, radius):
    """Whether anything solid is within a radius, by probing rings of points."""
    return any(
        covered(shapes, x + r * math.cos(a), y + r * math.sin(a))
        for r in np.linspace(radius, 0.0, 4)
        for a in np.linspace(0.0, math.tau, 33)
    )


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    angle=st.floats(-10.0, 10.0),
    x=st.floats(-3.0, 3.0),
    y=st.floats(-3.0, 3.0),
    name=st.sampled_from(bundled_worlds()),
)
def test_a_moved_world_is_the_same_elsewhere(angle, x, y, name):
    """Robot, goal and everything solid keep their distances to every point."""
    world, motion = load_world(world_file(name)), Motion(angle, x, y)
    moved = motion.world(world)
    here = motion.point(*world.robot.pose[:2])
    assert moved.robot.pose[:2] == pytest.approx(here, abs=1e-8)
    turn = math.remainder(moved.robot.heading - world.robot.heading - angle, math.tau)
    assert abs(turn) < 1e-8
    assert moved.goal == pytest.approx(motion.point(*world.goal), abs=1e-8)
    random = np.random.default_rng(0)
    parts = [[p.shape for t in bodies(w) for p in t.solid] for w in (world, moved)]
    assert [s.area for s in parts[0]] == pytest.approx([s.area for s in parts[1]])
    for u, v in random.uniform(-1.0, 1.0, (40, 2)):
        at = motion.point(u, v)
        assert covered(parts[0], u, v) == covered(parts[1], *at)


def assert_same_things(found, expected):
    """Equal but for their order, and last digits of what was turned and back."""
    assert len(found) == len(expected)
    for one, other in zip(
        *(sorted(things, key=lambda t: t.name) for things in (found, expected)),
        strict=True,
    ):
        assert (one.name, one.kind, one.mass) == (other.name, other.kind, other.mass)
        for parts in ("solid", "visible"):
            pieces, wanted = getattr(one, parts), getattr(other, parts)
            assert [(p.bottom, p.top) for p in pieces] == [
                (p.bottom, p.top) for p in wanted
            ]
            for piece, same in zip(pieces, wanted, strict=True):
                assert piece.shape.bounds == pytest.approx(same.shape.bounds, abs=1e-7)
                assert piece.shape.area == pytest.approx(same.shape.area, abs=1e-8)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", NAMES)
def test_copies_are_the_worlds_they_say(name):
    """Each text reads as its world; the copies have another order, names and more."""
    world = flat(name)
    first, *copies = WorldOracle().world_cases(world)
    assert read_world(first.text) == world
    assert len(copies) == len(ANGLES)
    for case in copies:
        read = read_world(case.text)
        assert_same_things(read.obstacles, case.world.obstacles)
        assert (read.robots, read.goal) == (case.world.robots, case.world.goal)
        assert len(read.obstacles) >= len(world.obstacles) + 5
        assert not {t.name for t in read.obstacles} & {
            t.name for t in world.obstacles if t.name not in ("", "GOAL")
        }
        assert Ground.of(read).gap(*case.start[:2]) >= 0.037
        assert Ground.of(read).gap(*case.goal) >= 0.037
    assert len({case.text for case in copies}) == len(copies)


def test_reordered_text_has_the_same_nodes():
    """Only order and DEF names change, and WorldInfo stays in front."""
    text = write_world(flat("epuck"))
    shuffled = reordered(text, np.random.default_rng(1))
    assert shuffled != text
    kinds = [line for line in shuffled.splitlines() if line.endswith(" {")]
    assert next(k for k in kinds if not k.startswith(" ")) == "WorldInfo {"
    one, other = read_world(text), read_world(shuffled)
    assert one.goal == other.goal
    assert one.arenas == other.arenas
    assert len(one.obstacles) == len(other.obstacles)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["epuck", "epuck-room", "epuck-yard"])
def test_samples_are_what_footprints_say(name):
    """Without inflation a point is occupied just where a footprint covers it."""
    for case in WorldOracle().world_cases(flat(name))[:2]:
        arena, shapes = case.world.arena.inside, footprints(case.world)
        found = list(case.samples(0.0, 0.01))
        assert {occupied for _, occupied in found} == {True, False}
        for (x, y), occupied in found:
            solid = covered(shapes, x, y) or not arena.contains(x, y)
            assert solid == occupied


@pytest.mark.slow
def test_inflated_samples_are_what_a_ring_of_probes_says():
    """With inflation a point is occupied just where something solid is that near."""
    case = WorldOracle().world_cases(flat("epuck-crates"))[1]
    arena, shapes = case.world.arena.inside, footprints(case.world)
    for (x, y), occupied in list(case.samples(0.04, 0.01))[::6]:
        near = covered_nearby(shapes, x, y, 0.04) or not arena.contains(x, y)
        assert near == occupied


def test_cells_of_a_grid():
    """A cell covers its side from its corner on; outside the grid all is occupied."""
    occ = np.zeros((2, 3), bool)
    occ[1, 2] = True
    assert occupied_at(occ, (1.0, -1.0), 0.5, (2.01, -0.01))
    assert not occupied_at(occ, (1.0, -1.0), 0.5, (1.99, -0.01))
    assert not occupied_at(occ, (1.0, -1.0), 0.5, (2.01, -0.51))
    for outside in ((0.99, -0.9), (2.51, -0.9), (1.2, -1.01), (1.2, 0.01)):
        assert occupied_at(occ, (1.0, -1.0), 0.5, outside)
