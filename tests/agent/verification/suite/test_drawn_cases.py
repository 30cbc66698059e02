"""What a suite draws for a run follows from its seed, and has the answer it is told."""

import math

import numpy as np
import pytest

from tdac_agent.environments.epuck.oracle import WorldOracle
from tdac_envs import load_world
from tdac_envs.worlds.bundled import world_file


@pytest.mark.parametrize("cell", [1, 2, 5])
@pytest.mark.parametrize("density", [0.0, 0.1, 0.3])
def test_walks_are_steps_apart_and_joined(cell, density):
    """Free ends, a whole number of steps from each other, with a path between them."""
    oracle = WorldOracle()
    for seed in range(20):
        occ = oracle.grid(seed, 90, 70, density / cell)
        for start, goal in oracle.walks(occ, cell, np.random.default_rng(seed)):
            assert start != goal
            assert not (goal[0] - start[0]) % cell
            assert not (goal[1] - start[1]) % cell
            assert math.isfinite(oracle.shortest_length(occ, start, goal))


def test_a_map_without_room_has_no_walks():
    """Nothing is asked where there is nothing to ask."""
    random = np.random.default_rng(0)
    assert list(WorldOracle().walks(np.ones((20, 30), np.bool_), 1, random)) == []
    assert list(WorldOracle().walks(np.zeros((3, 3), np.bool_), 5, random)) == []


@pytest.mark.slow
def test_what_is_drawn_follows_from_the_seed():
    """The same seed draws the same walks and copy of a world, another one others."""
    oracle, occ = WorldOracle(), np.zeros((50, 60), np.bool_)
    world = load_world(world_file("arena"))

    def drawn(seed):
        random = np.random.default_rng(seed)
        walks = list(oracle.walks(occ, 1, random))
        cases = oracle.world_cases(world, random)
        return walks, [(case.text, case.seed) for case in cases]

    assert drawn(2**80) == drawn(2**80)
    (walks, cases), (others, other_cases) = drawn(1), drawn(2)
    assert not set(walks) & set(others)
    same = [case for case in cases if case in other_cases]
    assert len(same) == len(cases) - 2 == len(oracle.world_cases(world)) - 1
