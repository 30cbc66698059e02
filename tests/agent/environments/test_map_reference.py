"""The reference solves every feasible task and touches nothing."""

import math

import numpy as np
import pytest
from driving import random_env

from tdac_agent.environments.map2d.reference import oracle_path
from tdac_agent.episodes.episode import Record, run_policy
from tdac_agent.verification.judge.drivers import ReferenceDriver
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.mapping.bundled import bundled_maps


def solve(env, start):
    record = Record(env, start, env.nominal.horizon)
    driver = ReferenceDriver(env)
    return run_policy(driver, record, "nominal", held_out=False, deadline=math.inf)


def assert_solves(env, random, jitters):
    task = env.nominal
    starts = [task.start, *(task.jittered(random) for _ in range(jitters))]
    for start in starts:
        rollout = solve(env, start)
        radius = task.robot.radius
        ending = f"{rollout.outcome} from {start} to {task.goal}, radius {radius}"
        assert rollout.reached, ending
        assert rollout.collisions == 0, ending


@pytest.mark.parametrize("seed", range(60))
def test_random_grids(seed):
    """Nominal and jittered starts, with little or no room to spare."""
    random = np.random.default_rng(seed)
    assert_solves(random_env(random), random, jitters=2)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(20))
def test_many_random_grids(block):
    """As above, 2000 starts."""
    for seed in range(50):
        random = np.random.default_rng([block, seed])
        assert_solves(random_env(random), random, jitters=1)


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("name", bundled_maps())
def test_bundled_maps(name):
    """Every bundled task, in half of its horizon."""
    env = Map2DEnv(name)
    assert_solves(env, np.random.default_rng(0), jitters=2)
    assert solve(env, env.nominal.start).trajectory.steps <= env.nominal.horizon / 2


def test_passage_as_wide_as_the_body():
    """A body as wide as its passage still gets through, from its exact start."""
    for gap in (9, 10, 13):
        cells = np.zeros((41, 81), bool)
        cells[:, 40:44] = True
        cells[20 - gap // 2 : 20 - gap // 2 + gap, 40:44] = False
        radius = math.sqrt(((gap - 1) // 2 + 0.5) ** 2 - 0.5) - 1e-6
        env = Map2DEnv(cells, (12, 20, 0), (66, 21), robot_radius=radius)
        for seed in range(5):
            assert_solves(env, np.random.default_rng(seed), jitters=1)


def test_path_keeps_a_margin_where_there_is_room():
    """In the open, the oracle's path stays 4 px off a wall that it goes round."""
    cells = np.zeros((120, 120), bool)
    cells[40:80, 55:65] = True
    env = Map2DEnv(cells, (20, 60, 0), (100, 60), robot_radius=8)
    path = oracle_path(env.nominal, 20, 60)
    rows, columns = np.round(path[:, 1]).astype(int), np.round(path[:, 0]).astype(int)
    assert env.nominal.terrain.clear[rows, columns].min() >= 12.0


def test_open_room_needs_one_segment():
    """Without obstacles the pulled path is a straight line."""
    env = Map2DEnv(np.zeros((90, 150), bool), (20, 20, 0), (130, 71), robot_radius=8)
    corners = env.nominal.pulled(oracle_path(env.nominal, 20, 20))
    assert corners == [(20.0, 20.0), (130.0, 71.0)]
