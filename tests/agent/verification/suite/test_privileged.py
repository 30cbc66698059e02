"""The privileged controllers: the reference solves every task, the bad ones do not."""

import ast
import math
import random
from itertools import pairwise

import numpy as np
import pytest
from driving import drive, import_controller, random_env

from tdac_agent.environments.map2d.entry import MAP2D
from tdac_agent.verification.suite.privileged import (
    BAD,
    POLICIES,
    privileged_controller,
    reference_paths,
)
from tdac_agent.verification.suite.reference import without_flat_points
from tdac_agent.verification.suite.starts import spread_starts
from tdac_envs.grid.plan import distance_field
from tdac_envs.map2d.env import Map2DEnv


def episodes(env, seed, folder, monkeypatch, name="reference"):
    """The six episodes of a verification, each in a fresh module."""
    ways = reference_paths(env.nominal, seed)
    source = privileged_controller(env.nominal, ways, name)
    for start in (env.nominal.start, *spread_starts(env.nominal, seed, 5)):
        module = import_controller(source, env, folder, monkeypatch)
        yield drive(env, module.policy, start)


def assert_solved(rollout):
    task = rollout.outcome, rollout.trajectory.poses[-1], rollout.radius
    assert rollout.reached, task
    assert rollout.collisions == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_the_reference_solves_random_grids(seed, tmp_path, monkeypatch):
    """From float32 observations, with little or no room to spare, from any seed."""
    env = random_env(np.random.default_rng(seed))
    for rollout in episodes(env, seed, tmp_path, monkeypatch):
        assert_solved(rollout)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_the_reference_solves_many_random_grids(block, tmp_path, monkeypatch):
    """As above, 1500 starts in all."""
    for seed in range(25):
        env = random_env(np.random.default_rng([block, seed]))
        for rollout in episodes(env, seed, tmp_path, monkeypatch):
            assert_solved(rollout)


@pytest.mark.parametrize("gap", [9, 10, 13])
def test_the_reference_passes_where_the_body_just_fits(gap, tmp_path, monkeypatch):
    """A passage as wide as the body, 300 px away from where float32 is finest."""
    cells = np.zeros((341, 381), bool)
    cells[:, 340:344] = True
    cells[320 - gap // 2 : 320 - gap // 2 + gap, 340:344] = False
    radius = math.sqrt(((gap - 1) // 2 + 0.5) ** 2 - 0.5) - 1e-6
    env = Map2DEnv(cells, (312, 320, 0), (366, 321), robot_radius=radius)
    for rollout in episodes(env, 0, tmp_path, monkeypatch):
        assert_solved(rollout)


def test_only_the_policy_differs():
    """Each bad controller is the reference but for `policy` and what that one needs."""
    env = Map2DEnv(np.zeros((60, 90), bool), (15, 15, 0), (70, 40), robot_radius=5)
    ways = reference_paths(env.nominal, 3)
    trees = {
        name: ast.parse(privileged_controller(env.nominal, ways, name))
        for name in POLICIES
    }
    others = {
        name: [
            ast.dump(node)
            for node in tree.body
            if getattr(node, "name", "") != "policy"
            and not (isinstance(node, ast.Assign) and node.targets[0].id == "DICE")
        ]
        for name, tree in trees.items()
    }
    policies = {
        ast.dump(node)
        for tree in trees.values()
        for node in tree.body
        if getattr(node, "name", "") == "policy"
    }
    assert all(rest == others["reference"] for rest in others.values())
    assert len(policies) == len(POLICIES) == len(BAD) + 1


def test_it_says_that_it_is_privileged():
    """The first words of the file: no one shall take it for an example."""
    env = Map2DEnv(np.zeros((60, 90), bool), (15, 15, 0), (70, 40), robot_radius=5)
    ways = reference_paths(env.nominal, 0)
    for name in POLICIES:
        source = privileged_controller(env.nominal, ways, name)
        assert source.startswith('"""PRIVILEGED: ')


@pytest.mark.parametrize("name", ["do-nothing", "constant", "random"])
def test_bad_ones_do_not_arrive(name, tmp_path, monkeypatch):
    """Whoever stands, drives straight on or rolls dice does not get around a wall."""
    cells = np.zeros((80, 120), bool)
    cells[:55, 58:62] = True
    env = Map2DEnv(cells, (20, 20, 0), (100, 20), robot_radius=6, horizon=400)
    for rollout in episodes(env, 1, tmp_path, monkeypatch, name):
        assert not rollout.reached


def test_flat_points_are_left_out():
    """The polyline stays the same set of points; turning back is a corner."""
    dice = random.Random(0)
    for _ in range(200):
        points, at = [(0.0, 0.0)], (0.0, 0.0)
        for _ in range(12):
            dx, dy = dice.choice([(1, 0), (0, 1), (1, 1), (-1, 0)])
            at = (at[0] + dx, at[1] + dy)
            points.append(at)
        kept = without_flat_points(points)
        assert [kept[0], kept[-1]] == [points[0], points[-1]]
        assert unit_steps(kept) == points
        for (x0, y0), (x1, y1), (x2, y2) in zip(kept, kept[1:], kept[2:], strict=False):
            ahead = math.atan2(y1 - y0, x1 - x0), math.atan2(y2 - y1, x2 - x1)
            assert ahead[0] != ahead[1]


def unit_steps(corners):
    """The pixels that a polyline of 8-connected runs passes, in their order."""
    points = corners[:1]
    for (x0, y0), (x1, y1) in pairwise(corners):
        count = int(max(abs(x1 - x0), abs(y1 - y0)))
        dx, dy = (x1 - x0) / count, (y1 - y0) / count
        points += [(x0 + k * dx, y0 + k * dy) for k in range(1, count + 1)]
    return points


def test_the_way_is_no_detour():
    """Pulled taut, it is at most as long as the lattice path with 4 px to spare."""
    cells = np.zeros((120, 120), bool)
    cells[40:80, 55:65] = True
    env = Map2DEnv(cells, (20, 60, 0), (100, 60), robot_radius=8)
    way = MAP2D.reference_path(env.nominal, 20.0, 60.0)
    assert way[0] == (20.0, 60.0)
    assert way[-1] == (100.0, 60.0)
    length = sum(math.dist(a, b) for a, b in pairwise(way))
    field = distance_field(env.nominal.terrain.clear >= 12.0, (100, 60))
    assert length <= field[60, 20]
