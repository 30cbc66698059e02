"""The e-puck's controller of `builtin`: its contract, its driving, its tuning."""

import ast
import math
from dataclasses import replace

import numpy as np
import pytest
from driving_epuck import (
    WORLDS,
    episode,
    import_into,
    random_task,
    world_task,
)
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.builtin.provider import Builtin, template_of
from tdac_agent.builtin.template import read_parameters
from tdac_agent.environments.epuck.builtin import EPuckParameters, template_for
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.environments.epuck.oracle import WorldOracle, occupied_at
from tdac_agent.episodes.episode import Record
from tdac_agent.models.provider import Request
from tdac_agent.prompting.extract import extract_source
from tdac_agent.tasks.task_file import TaskFile
from tdac_agent.verification.suite import contract
from tdac_agent.verification.verify import verify
from tdac_envs import write_world
from tdac_envs.worlds.footprint import Disc
from tdac_envs.worlds.world import Obstacle, Part

SLOW = pytest.mark.slow
# What two collisions make of the neutral parameters.
TUNED = EPuckParameters(
    inflation_margin=0.004,
    slow_dist=0.02,
    blocked=640.0,
    turn_gain=0.9,
    turn_in_place=0.2,
)


@pytest.fixture
def module(crates, crates_source, tmp_path, monkeypatch):
    return import_into(crates, crates_source, tmp_path, monkeypatch)


def test_constants(tmp_path):
    """Clock, wheel limit and tolerance are the task's."""
    spec = TaskFile(env=EPUCK.id, world="maze", dt=0.0125, tolerance=0.031)
    task = load_task(spec)
    tree = ast.parse(template_for(task.nominal).render(EPuckParameters()))
    values = {
        node.targets[0].id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
    }
    assert values["TIME_STEP"] == 12.5
    assert values["GOAL_TOLERANCE"] == 0.031
    assert values["MAX_WHEEL_SPEED"] == 6.28
    assert values["SENSOR_RANGE"] == 0.07
    assert values["WORLD_FILE"] == "world.wbt"
    assert type(contract.time_step(0.032)) is int


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("name", [*WORLDS, "drawn"])
def test_it_reads_worlds(name, module, tmp_path):
    """Occupied is what the oracle says, in this world and in changed copies."""
    if name == "drawn":
        task = random_task(np.random.default_rng(4), tmp_path)
    else:
        task = world_task(name) or pytest.skip("the paper's world is not here")
    for case in WorldOracle().world_cases(task.nominal.ground.world):
        world = module.parse_world(case.text)
        assert world["start"] == pytest.approx(case.start)
        assert world["goal"] == pytest.approx(case.goal)
        size = case.resolution()
        for inflation in (0.0, 0.037):
            occ, origin = module.build_grid(world, size, inflation)
            assert occ.dtype == bool
            for point, occupied in case.samples(inflation, 1.5 * size):
                found = occupied_at(occ, origin, size, point)
                assert found == occupied, (case.name, point)


@pytest.mark.parametrize("seed", range(4))
def test_distances_are_those_of_the_environment(seed, module, tmp_path):
    """What `Walls` says of a point is the room that the environment measures."""
    random = np.random.default_rng(seed)
    ground = random_task(random, tmp_path).nominal.ground
    world = module.parse_world((tmp_path / "drawn.wbt").read_text())
    walls = module.Walls(world)
    left, low, right, high = ground.bounds
    compared = 0
    for x, y in random.uniform((left, low), (right, high), (200, 2)).tolist():
        room = ground.gap(x, y)
        if room > 1e-3 and module.room_in(world["arena"], x, y) > 0.0:
            assert walls.gap((x, y), (x, y)) == pytest.approx(room, abs=1e-7)
            compared += 1
    assert compared > 20


def test_what_hangs_in_the_air(module, crates):
    """It is in the way only if it is low enough, or has a mass and falls."""
    ground = crates.nominal.ground.world
    disc, places = Disc(-0.5, 0.35, 0.05), {}
    for bottom, mass in ((0.03, None), (0.06, None), (0.06, 0.2)):
        part = Part(disc, bottom, bottom + 0.1)
        thing = Obstacle("it", "Solid", -0.5, 0.35, (part,), (part,), mass=mass)
        text = write_world(replace(ground, obstacles=(*ground.obstacles, thing)))
        walls = module.Walls(module.parse_world(text))
        places[bottom, mass] = walls.gap((-0.5, 0.28), (-0.5, 0.28))
    assert places[0.03, None] == pytest.approx(0.02)
    assert places[0.06, 0.2] == pytest.approx(0.02)
    assert places[0.06, None] > 0.05


def test_gap_of_a_line(module, crates):
    """The least room along a line is that of the points on it; 0 where it crosses."""
    walls = module.Walls(module.parse_world(crates.setting.text))
    random, ground = np.random.default_rng(0), crates.nominal.ground
    for _ in range(200):
        ends = random.uniform((-0.78, -0.48), (0.78, 0.48), (2, 2))
        points = ends[0] + np.linspace(0.0, 1.0, 400)[:, None] * (ends[1] - ends[0])
        least = max(min(ground.gap(x, y) for x, y in points.tolist()), 0.0)
        found = walls.gap(*(tuple(end) for end in ends.tolist()))
        if ground.gap(*ends[0]) > 0.0 < ground.gap(*ends[1]):
            assert max(found, 0.0) == pytest.approx(least, abs=5e-3)
            assert found <= least + 1e-9


@pytest.mark.parametrize("case", WorldOracle().plan_cases(), ids=lambda case: case.name)
def test_astar(module, case):
    """As short as any path."""
    path = module.astar(case.occ, case.start, case.goal)
    if math.isinf(case.length):
        assert path == []
        return
    assert (path[0], path[-1]) == (case.start, case.goal)
    assert {type(value) for cell in path for value in cell} == {int}
    assert WorldOracle().path_error(case.occ, path) is None
    assert WorldOracle().path_length(path) == pytest.approx(case.length)


def test_what_is_right_ahead_stops_it(module):
    """Only if it is nearer than the waypoint; then it turns to the freer side."""
    near, free = 1100.0, 67.19
    left_freer = [near, near, near, free, free, free, free, near]
    left, right = module.compute_wheel_speeds((0, 0), 0.0, (0.3, 0.0), left_freer)
    assert left == -right < 0.0
    left, right = module.compute_wheel_speeds((0, 0), 0.0, (0.3, 0.0), left_freer[::-1])
    assert right == -left < 0.0
    left, right = module.compute_wheel_speeds((0, 0), 0.0, (0.001, 0.0), left_freer)
    assert left == right > 0.0
    left, right = module.compute_wheel_speeds((0, 0), 0.0, (0.3, 0.0), None)
    assert left == right == module.MAX_WHEEL_SPEED


def test_run_episode(crates, module):
    """What `run_episode` returns is what the environment did."""
    record = Record(crates.make_env(), crates.nominal.start, 2500)
    result = module.run_episode(record, 2500)
    trajectory = record.trajectory()
    assert record.outcome == "reached"
    assert set(result) == {"positions", "speeds", "collisions", "goal", "dt"}
    np.testing.assert_allclose(result["positions"], trajectory.poses[:, :2], atol=1e-6)
    forward = trajectory.actions.mean(axis=1) * 6.28 * 0.02
    np.testing.assert_allclose(result["speeds"], forward, atol=1e-6)
    assert result["collisions"] == 0
    assert type(result["collisions"]) is int
    assert result["goal"] == pytest.approx(crates.nominal.goal)
    assert result["dt"] == 0.032


def drives(task, starts, parameters, folder, monkeypatch, **options):
    """Episodes of the controller, and the least room that it kept."""
    source = template_for(task.nominal).render(parameters)
    module = import_into(task, source, folder, monkeypatch)
    env = task.make_env(**options)
    return [episode(module, env, start) for start in starts]


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_drives_in_bundled_worlds(name, tmp_path, monkeypatch):
    """The first controller solves every world fast, and keeps the required gap."""
    task = world_task(name) or pytest.skip("the paper's world is not here")
    random = np.random.default_rng(0)
    starts = [task.nominal.start, *(task.nominal.jittered(random) for _ in range(4))]
    for rollout in drives(task, starts, EPuckParameters(), tmp_path, monkeypatch):
        assert rollout.reached, rollout.outcome
        assert rollout.trajectory.steps <= task.nominal.horizon / 3
        assert rollout.smallest_gap.gap >= rollout.required_gap


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_a_hundred_starts_with_noise(name, tmp_path, monkeypatch):
    """Also with the sensors' published noise, slipping wheels and a late action."""
    task = world_task(name) or pytest.skip("the paper's world is not here")
    random = np.random.default_rng(5)
    starts = [task.nominal.jittered(random) for _ in range(50)]
    noisy = {"sensor_noise": 1.0, "wheel_slip": 0.03, "delay": 1}
    for options in ({}, noisy):
        rollouts = drives(task, starts, TUNED, tmp_path, monkeypatch, **options)
        assert [rollout.outcome for rollout in rollouts] == ["reached"] * 50


@pytest.mark.slow_after(4)
@pytest.mark.parametrize("seed", range(8))
def test_drives_in_random_worlds(seed, tmp_path, monkeypatch):
    """Among anything, also through gaps that leave it no margin."""
    random = np.random.default_rng([7, seed])
    task = random_task(random, tmp_path)
    starts = [task.nominal.start, task.nominal.jittered(random)]
    for rollout in drives(task, starts, TUNED, tmp_path, monkeypatch):
        assert rollout.reached, rollout.outcome


@pytest.mark.slow
def test_unsolvable_says_so(module):
    """Where the body does not get to the goal, the error names both ends."""
    text = module.sensors.HERE.joinpath("world.wbt").read_text()
    world = module.parse_world(text)
    wall = {"points": [(0.3, -1.0), (0.3, 1.0)], "radius": 0.01}
    world["obstacles"].append(wall)
    walls = module.Walls(world)
    with pytest.raises(ValueError, match=r"does not get from \(-0.6, 0.0\) to \(0.6"):
        module.plan(world, walls, (-0.6, 0.0), (0.6, 0.0))


SYNTHESES = [
    pytest.param(name, marks=[] if name == "crates" else [pytest.mark.slow])
    for name in WORLDS
]


@pytest.mark.slow
@pytest.mark.parametrize("name", SYNTHESES)
def test_it_is_verified(name, tmp_path, warm):
    """Every world ends with a controller that passes the whole suite."""
    task = world_task(name) or pytest.skip("the paper's world is not here")
    run = synthesize(task, out=tmp_path / "run", iterations=3, judge=warm)
    assert run.passed
    source = (tmp_path / "run" / "controller.py").read_text()
    assert read_parameters(source, EPuckParameters) is not None


@pytest.mark.slow
def test_a_collision_is_repaired(crates, tmp_path):
    """A margin that is given up on purpose comes back from the report's diagnosis."""
    careless = template_for(crates.nominal).render(EPuckParameters())
    careless = careless.replace("BODY_RADIUS = 0.037", "BODY_RADIUS = 0.03")
    report = verify(careless, crates, paper=True)
    causes = {failure.diagnosis.cause for failure in report.failures}
    assert causes == {"collision"}
    text = careless.replace("BODY_RADIUS = 0.03", "BODY_RADIUS = 0.037")
    builtin = Builtin(template_of(crates.setting))
    reply = builtin.complete(Request("edit", "", controller=text, report=report))
    after = read_parameters(extract_source(reply.text), EPuckParameters)
    assert after.inflation_margin == 0.002
    assert any("test_no_collisions -> inflation_margin" in n for n in reply.notes)
