"""The controller of `builtin`: it keeps the contract, and it drives."""

import ast
import math

import numpy as np
import pytest
from driving import drive, import_controller, random_env

from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.episodes.episode import Record
from tdac_agent.verification.suite.oracle import Oracle
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.mapping.bundled import bundled_maps
from tdac_envs.mapping.params import RobotParams

TUNED = MapParameters(
    inflation_margin=2.0,
    lookahead=60.0,
    slow_dist=10.0,
    stop_dist=4.0,
    turn_gain=0.6,
    turn_in_place=0.4,
)


@pytest.fixture(scope="module")
def source():
    return template_for(RobotParams(), 0.05).render(MapParameters())


def test_robot_constants():
    """The robot's constants are the task's."""
    robot = RobotParams(radius=7.25, axle_length=11.0, n_rays=9, range_max=90.0)
    values = {
        node.targets[0].id: node.value.value
        for node in ast.parse(template_for(robot, 0.1).render(TUNED)).body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
    }
    assert values["ROBOT_RADIUS_PX"] == 7.25
    assert values["AXLE_LENGTH_PX"] == 11.0
    assert values["SENSOR_RANGE_PX"] == 90.0
    assert values["SENSOR_FOV_DEG"] == 110.0
    assert values["N_RAYS"] == 9
    assert values["DT"] == 0.1


@pytest.fixture
def module(source, tmp_path, monkeypatch):
    env = random_env(np.random.default_rng(0))
    return import_controller(source, env, tmp_path, monkeypatch)


def test_is_occupied(module):
    """Python bools; points are rounded to pixels; outside is occupied."""
    occ = np.zeros((4, 6), bool)
    occ[2, 5] = True
    own = module.OccMap2D(occ)
    answers = [
        own.is_occupied(x, y) for x, y in [(5, 2), (4.5, 1.5), (4.4, 2), (-1, 0)]
    ]
    assert answers == [True, True, False, True]
    assert {type(answer) for answer in answers} == {bool}


@pytest.mark.parametrize("seed", range(5))
def test_nearest_free(module, seed):
    """The nearest by distance, or ValueError."""
    oracle = Oracle()
    occ = oracle.grid(seed, 40, 30, 0.9)
    own = module.OccMap2D(occ)
    for x, y in [(0, 0), (39, 29), (20, 15), (7, 22), (45, -3)]:
        best = oracle.nearest_free_distance(occ, x, y)
        found = module.nearest_free(own, x, y, 60)
        assert [type(value) for value in found] == [int, int]
        assert math.dist(found, (x, y)) == pytest.approx(best)
        if best > 0:
            with pytest.raises(ValueError, match="no free pixel within"):
                module.nearest_free(own, x, y, best - 0.01)


@pytest.mark.parametrize("case", Oracle().plan_cases(), ids=lambda case: case.name)
def test_plan_path(module, case):
    """At cell 1 the path is as short as any."""
    path = module.plan_path(module.OccMap2D(case.occ), case.start, case.goal, 1)
    if math.isinf(case.length):
        assert path == []
        return
    assert (path[0], path[-1]) == (case.start, case.goal)
    assert Oracle().path_error(case.occ, path) is None
    assert Oracle().path_length(path) == pytest.approx(case.length)


def test_plan_path_in_larger_steps(module):
    """At cell 4 a goal off the lattice is reached, and no wall is jumped."""
    occ = np.zeros((40, 60), bool)
    occ[:30, 30] = True
    own = module.OccMap2D(occ)
    path = module.plan_path(own, (3, 3), (51, 8), 4)
    assert (path[0], path[-1]) == ((3, 3), (51, 8))
    steps = np.abs(np.diff(path, axis=0)).max(axis=1)
    assert set(steps.tolist()) <= {1, 4}
    occ[30:, 30] = True
    assert module.plan_path(module.OccMap2D(occ), (3, 3), (51, 8), 4) == []


@pytest.mark.parametrize("seed", range(6))
def test_clearance_is_exact(module, seed):
    """The controller's own clearance equals the environment's, up to its limit."""
    terrain = random_env(np.random.default_rng(seed)).nominal.terrain
    own = module.clearance(terrain.grid.cells, 12.0)
    np.testing.assert_allclose(
        np.minimum(own, 12.0), np.minimum(terrain.clear, 12.0), atol=1e-5
    )


def test_a_goal_behind_a_wall_is_said_to_be_out_of_reach(module):
    """The wave that does not get to the start ends, on every lattice."""
    occ = np.zeros((200, 300), np.bool_)
    occ[:, 150] = True
    with pytest.raises(ValueError, match="does not get from"):
        module.Roadmap(occ, (40.0, 100.0), (250.0, 100.0))


def test_run_episode(tmp_path, monkeypatch):
    """What `run_episode` returns is what the environment did."""
    env = Map2DEnv(np.zeros((90, 140), bool), (20, 20, 0), (110, 70), robot_radius=8)
    text = template_for(env.nominal.robot, env.nominal.dt).render(TUNED)
    module = import_controller(text, env, tmp_path, monkeypatch)
    record = Record(env, env.nominal.start, 2500)
    result = module.run_episode(record, 2500)
    trajectory = record.trajectory()
    assert record.outcome == "reached"
    assert set(result) == {"positions", "speeds", "collisions", "goal", "dt"}
    np.testing.assert_allclose(result["positions"], trajectory.poses[:, :2], atol=1e-3)
    np.testing.assert_allclose(
        result["speeds"], trajectory.actions.mean(axis=1) * 75.59, atol=1e-3
    )
    assert result["collisions"] == 0
    assert type(result["collisions"]) is int
    assert result["goal"] == (110.0, 70.0)
    assert result["dt"] == 0.05


def steer(module):
    """Calls the controller as the judge does: reset first."""
    fresh = []

    def act(observation):
        if not fresh:
            module.reset(observation)
            fresh.append(True)
        return module.policy(observation)

    return act


@pytest.mark.parametrize("seed", range(12))
def test_drives_on_random_grids(seed, tmp_path, monkeypatch):
    """After one repair the controller drives among random obstacles."""
    random = np.random.default_rng([7, seed])
    env = random_env(random)
    while env.nominal.terrain.clear.max() < env.nominal.robot.radius + 1.5:
        env = random_env(random)
    text = template_for(env.nominal.robot, env.nominal.dt).render(TUNED)
    module = import_controller(text, env, tmp_path, monkeypatch)
    rollout = drive(env, steer(module))
    assert rollout.reached, rollout.outcome


@pytest.mark.parametrize("name", ["maze", "thin_walls"])
@pytest.mark.parametrize("nodes", [100_000, 20_000])
def test_large_maps_are_planned_on_a_lattice(name, nodes, tmp_path, monkeypatch):
    """With fewer nodes than pixels, or too few to get through, it still arrives."""
    env = Map2DEnv(name)
    text = template_for(env.nominal.robot, env.nominal.dt).render(TUNED)
    text = text.replace("MAX_NODES = 1_500_000", f"MAX_NODES = {nodes}")
    module = import_controller(text, env, tmp_path, monkeypatch)
    rollout = drive(env, steer(module))
    assert rollout.reached, rollout.outcome


@pytest.mark.slow
@pytest.mark.parametrize("name", bundled_maps())
def test_drives_on_bundled_maps(name, tmp_path, monkeypatch):
    """The first controller solves each bundled map, and keeps the required gap."""
    env = Map2DEnv(name)
    text = template_for(env.nominal.robot, env.nominal.dt).render(MapParameters())
    module = import_controller(text, env, tmp_path, monkeypatch)
    random = np.random.default_rng(3)
    for start in (None, env.nominal.jittered(random)):
        rollout = drive(env, steer(module), start)
        assert rollout.reached, rollout.outcome
        assert rollout.trajectory.steps <= 0.25 * env.nominal.horizon
        assert rollout.smallest_gap.gap >= rollout.required_gap
