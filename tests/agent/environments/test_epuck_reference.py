"""The reference for the e-puck solves every task, and its bad likes none."""

import ast
import math
from itertools import pairwise

import numpy as np
import pytest
from driving_epuck import (
    WORLDS,
    episode,
    import_into,
    random_task,
    world_task,
)

from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.environments.epuck.oracle import WorldOracle, occupied_at
from tdac_agent.verification.suite import contract
from tdac_agent.verification.suite.hygiene import HYGIENE
from tdac_agent.verification.suite.privileged import (
    BAD,
    POLICIES,
    privileged_controller,
    reference_paths,
)
from tdac_agent.verification.suite.starts import spread_starts
from tdac_envs.worlds.bodies import BODY_RADIUS


@pytest.fixture
def task_of(tmp_path):
    def find(name):
        task = world_task(name)
        return task or pytest.skip("the paper's world is not here")

    return find


def drive_from(task, starts, folder, monkeypatch):
    """Episodes of a reference that knows the ways from some starts."""
    nominal = task.nominal
    ways = [EPUCK.reference_path(nominal, start.x, start.y) for start in starts]
    source = privileged_controller(nominal, ways)
    module = import_into(task, source, folder, monkeypatch)
    env = task.make_env()
    for start in starts:
        yield episode(module, env, start)


def assert_solved(task, rollout):
    end = rollout.trajectory.poses[-1]
    assert rollout.reached, (rollout.outcome, end)
    assert rollout.collisions == 0
    assert math.dist(end[:2], task.nominal.goal) <= 0.02


@pytest.mark.parametrize("name", WORLDS)
def test_bundled_worlds(name, task_of, tmp_path, monkeypatch):
    """From the start and moved ones to within 20 mm, in half of the horizon."""
    task = task_of(name)
    random = np.random.default_rng(0)
    starts = [task.nominal.start, *(task.nominal.jittered(random) for _ in range(4))]
    for rollout in drive_from(task, starts, tmp_path, monkeypatch):
        assert_solved(task, rollout)
        assert rollout.trajectory.steps <= task.nominal.horizon / 2


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_a_hundred_starts(name, task_of, tmp_path, monkeypatch):
    """At least 99 of 100 moved starts, in every world, without a contact."""
    task = task_of(name)
    random = np.random.default_rng(1)
    starts = [task.nominal.jittered(random) for _ in range(100)]
    rollouts = list(drive_from(task, starts, tmp_path, monkeypatch))
    assert sum(r.reached and r.collisions == 0 for r in rollouts) >= 99


@pytest.mark.parametrize("seed", range(6))
def test_random_worlds(seed, tmp_path, monkeypatch):
    """The six starts of a verification, among anything."""
    task = random_task(np.random.default_rng(seed), tmp_path)
    starts = [task.nominal.start, *spread_starts(task.nominal, seed, 5)]
    for rollout in drive_from(task, starts, tmp_path, monkeypatch):
        assert_solved(task, rollout)


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_many_random_worlds(block, tmp_path, monkeypatch):
    """As above, 100 worlds."""
    for seed in range(10):
        task = random_task(np.random.default_rng([block, seed]), tmp_path)
        starts = [
            task.nominal.start,
            task.nominal.jittered(np.random.default_rng(seed)),
        ]
        for rollout in drive_from(task, starts, tmp_path, monkeypatch):
            assert_solved(task, rollout)


@pytest.mark.parametrize("name", ["arena", "maze"])
def test_the_way_is_clear_and_no_detour(name, task_of):
    """Along all of it the body has room; it is as long as the grid's path at most."""
    nominal = task_of(name).nominal
    way = EPUCK.reference_path(nominal, *nominal.start[:2])
    assert way[0] == nominal.start[:2]
    assert way[-1] == nominal.goal
    for begin, end in pairwise(way):
        for share in np.linspace(0.0, 1.0, 200):
            x, y = (a + share * (b - a) for a, b in zip(begin, end, strict=True))
            assert nominal.ground.gap(x, y) >= BODY_RADIUS
    length = sum(math.dist(a, b) for a, b in pairwise(way))
    assert length <= nominal.shortest + 0.02


def test_only_the_policy_differs(task_of):
    """Each bad controller is the reference but for `policy` and what that one needs."""
    nominal = task_of("crates").nominal
    ways = reference_paths(nominal, 3)
    sources = {name: privileged_controller(nominal, ways, name) for name in POLICIES}
    assert all(text.startswith('"""PRIVILEGED: ') for text in sources.values())
    rests = {
        text.replace(POLICIES[name], "").replace("\n", "")
        for name, text in sources.items()
    }
    assert len(rests) == 1
    assert len(set(sources.values())) == len(BAD) + 1


def test_static_contract(task_of):
    """The file is what the static tests ask for, whatever its policy."""
    nominal = task_of("crates").nominal
    for name in POLICIES:
        tree = ast.parse(privileged_controller(nominal, [], name))
        assert contract.import_problems(tree) == []
        assert [problem for find in HYGIENE.values() for problem in find(tree)] == []
        wanted = EPUCK.names
        found = set(contract.top_level_names(tree))
        assert {"policy", *wanted.constants, *wanted.functions} <= found
        assert contract.has_main_guard(tree)


@pytest.mark.parametrize("name", ["do-nothing", "constant", "random"])
def test_bad_ones_do_not_arrive(name, task_of, tmp_path, monkeypatch):
    """Who stands, drives straight on or rolls dice does not get around the crates."""
    task = task_of("crates")
    source = privileged_controller(task.nominal, reference_paths(task.nominal, 1), name)
    module = import_into(task, source, tmp_path, monkeypatch)
    for start in (task.nominal.start, *spread_starts(task.nominal, 1, 2)):
        assert not episode(module, task.make_env(), start).reached


@pytest.mark.parametrize("name", ["room", "yard", "drawn"])
def test_it_reads_worlds(name, task_of, tmp_path, monkeypatch):
    """Occupied is what the oracle says, in this world and in changed copies."""
    if name == "drawn":
        task = random_task(np.random.default_rng(4), tmp_path)
    else:
        task = task_of(name)
    source = privileged_controller(task.nominal, [])
    module = import_into(task, source, tmp_path, monkeypatch)
    for case in WorldOracle().world_cases(task.nominal.ground.world):
        world = module.parse_world(case.text)
        assert world["start"] == pytest.approx(case.start)
        assert world["goal"] == pytest.approx(case.goal)
        size = case.resolution()
        occ, origin = module.build_grid(world, size, 0.03)
        for point, occupied in case.samples(0.03, 1.5 * size):
            assert occupied_at(occ, origin, size, point) == occupied, (case.name, point)


def test_astar(task_of, tmp_path, monkeypatch):
    """As short as any path."""
    task = task_of("crates")
    source = privileged_controller(task.nominal, [])
    module = import_into(task, source, tmp_path, monkeypatch)
    for case in WorldOracle().plan_cases():
        path = module.astar(case.occ, case.start, case.goal)
        if math.isinf(case.length):
            assert path == []
            continue
        assert (path[0], path[-1]) == (case.start, case.goal)
        assert WorldOracle().path_error(case.occ, path) is None
        assert WorldOracle().path_length(path) == pytest.approx(case.length)
