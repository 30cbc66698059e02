"""`builtin`: its file keeps the contract, each failure changes what it should."""

import ast
import math
from dataclasses import fields, replace

import numpy as np
import pytest
from driving import drive, import_controller, random_env

from tdac_agent import contract
from tdac_agent.builtin import (
    Builtin,
    Parameters,
    read_parameters,
    render_controller,
)
from tdac_agent.builtin.repair import Bounds, read_rules, repair
from tdac_agent.episode import Record
from tdac_agent.extract import extract_source
from tdac_agent.oracle import Oracle
from tdac_agent.provider import Request
from tdac_agent.report import Diagnosis, Failure, Report
from tdac_agent.rules import MAX_RULE_CHARS, add_rules, parse_rules
from tdac_envs.map2d import Map2DEnv
from tdac_envs.maps import bundled_maps
from tdac_envs.params import MapParams, RobotParams
from tdac_envs.task2d import jittered_start

TUNED = Parameters(
    inflation_margin=2.0,
    lookahead=60.0,
    slow_dist=10.0,
    stop_dist=4.0,
    turn_gain=0.6,
    turn_in_place=0.4,
)
MIDDLE = replace(TUNED, unstick_after=80.0, cruise_speed=0.6)
END = "test_end_to_end.py::"


def report(*failures):
    """A failed report of (test, cause or None)."""
    records = tuple(
        Failure(
            test=test,
            group="end to end",
            message="failed",
            diagnosis=Diagnosis(cause=cause, text=cause) if cause else None,
        )
        for test, cause in failures
    )
    # What verified it, and with which seeds, is nothing to the repair.
    return Report.model_construct(failures=records)


@pytest.fixture(scope="module")
def builtin():
    env = Map2DEnv(np.zeros((90, 120), bool), (20, 20, 0), (90, 70), robot_radius=8)
    params = MapParams(
        source="array",
        source_sha256="",
        width=120,
        height=90,
        robot=env.nominal.robot,
        polarity="given",
        method="given",
    )
    return Builtin(env.nominal, params)


def source_of(reply):
    source = extract_source(reply.text)
    assert source is not None
    return source


@pytest.fixture(scope="module")
def source():
    return render_controller(Parameters(), RobotParams(), 0.05)


def test_first_candidate_is_neutral(builtin):
    """Without rules, the parameters have their neutral values."""
    reply = builtin.complete(Request("generate", ""))
    assert read_parameters(source_of(reply)) == Parameters()
    assert reply.stop == "end"


@pytest.mark.parametrize("seed", range(10))
def test_parameters_are_read_back(seed):
    """Whatever is rendered can be read from the file again."""
    random = np.random.default_rng(seed)
    drawn = {
        f.name: random.uniform(f.metadata["low"], f.metadata["high"])
        for f in fields(Parameters)
    }
    parameters = Parameters().changed(**drawn)
    text = render_controller(parameters, RobotParams.disc(7.25), 0.05)
    assert read_parameters(text) == parameters


def test_parameters_have_bounds():
    """A value out of bounds is refused; a change stops at the bound."""
    with pytest.raises(ValueError, match=r"turn_gain in \[0.1, 1\], got 2.0"):
        Parameters(turn_gain=2.0)
    assert Parameters().changed(turn_gain=2.0).turn_gain == 1.0


def test_static_contract(source):
    """The file is what the static tests ask for."""
    tree = ast.parse(source)
    names = contract.top_level_names(tree)
    assert contract.import_problems(tree) == []
    assert {name: list(find(tree)) for name, find in contract.HYGIENE.items()} == {
        name: [] for name in contract.HYGIENE
    }
    wanted = {"OccMap2D", "nearest_free", "plan_path", "policy", "reset", "run_episode"}
    assert wanted | {"main"} | set(contract.CONSTANTS_2D) <= set(names)
    assert contract.has_main_guard(tree)


def test_robot_constants():
    """The robot's constants are the task's."""
    robot = RobotParams(radius=7.25, axle_length=11.0, n_rays=9, range_max=90.0)
    values = {
        node.targets[0].id: node.value.value
        for node in ast.parse(render_controller(TUNED, robot, 0.1)).body
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


def test_run_episode(tmp_path, monkeypatch):
    """What `run_episode` returns is what the environment did."""
    env = Map2DEnv(np.zeros((90, 140), bool), (20, 20, 0), (110, 70), robot_radius=8)
    text = render_controller(TUNED, env.nominal.robot, env.nominal.dt)
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
    text = render_controller(TUNED, env.nominal.robot, env.nominal.dt)
    module = import_controller(text, env, tmp_path, monkeypatch)
    rollout = drive(env, steer(module))
    assert rollout.reached, rollout.outcome


@pytest.mark.parametrize("name", ["maze", "thin_walls"])
@pytest.mark.parametrize("nodes", [100_000, 20_000])
def test_large_maps_are_planned_on_a_lattice(name, nodes, tmp_path, monkeypatch):
    """With fewer nodes than pixels, or too few to get through, it still arrives."""
    env = Map2DEnv(name)
    text = render_controller(TUNED, env.nominal.robot, env.nominal.dt)
    text = text.replace("MAX_NODES = 1_500_000", f"MAX_NODES = {nodes}")
    module = import_controller(text, env, tmp_path, monkeypatch)
    rollout = drive(env, steer(module))
    assert rollout.reached, rollout.outcome


@pytest.mark.parametrize("name", bundled_maps())
def test_drives_on_bundled_maps(name, tmp_path, monkeypatch):
    """After one repair every bundled map is solved, from jittered starts, too."""
    env = Map2DEnv(name)
    text = render_controller(TUNED, env.nominal.robot, env.nominal.dt)
    module = import_controller(text, env, tmp_path, monkeypatch)
    random = np.random.default_rng(3)
    for start in (None, jittered_start(env.nominal, random)):
        rollout = drive(env, steer(module), start)
        assert rollout.reached, rollout.outcome
        assert rollout.trajectory.steps <= 0.25 * env.nominal.horizon


UP, DOWN = 1, -1


@pytest.mark.parametrize(
    ("cause", "name", "way"),
    [
        ("collision", "inflation_margin", UP),
        ("collision", "lookahead", DOWN),
        ("collision", "slow_dist", UP),
        ("collision", "stop_dist", UP),
        ("collision", "turn_in_place", DOWN),
        ("no motion", "inflation_margin", DOWN),
        ("stuck", "unstick_after", DOWN),
        ("stuck", "lookahead", DOWN),
        ("spinning", "turn_gain", DOWN),
        ("oscillating", "turn_gain", DOWN),
        ("too slow", "cruise_speed", UP),
        ("too slow", "slow_dist", DOWN),
        ("too slow", "stop_dist", DOWN),
        ("missed goal", "lookahead", DOWN),
        ("missed goal", "turn_in_place", DOWN),
        ("time-out", "lookahead", DOWN),
        ("held out", "inflation_margin", UP),
    ],
)
def test_each_failure_changes_its_parameter(builtin, cause, name, way):
    """The edit moves the parameter, and the notes name the test behind it."""
    text = render_controller(MIDDLE, RobotParams(), 0.05)
    failed = report((f"{END}test_x", cause))
    reply = builtin.complete(Request("edit", "", controller=text, report=failed))
    after = read_parameters(source_of(reply))
    change = getattr(after, name) - getattr(MIDDLE, name)
    assert change * way > 0
    note = f"{END}test_x -> {name} {getattr(MIDDLE, name):g} -> "
    assert any(line.startswith(note) for line in reply.notes), reply.notes


def test_stuck_switches_the_manoeuvre_on():
    """Off by default, on after a robot was stuck."""
    parameters, _ = repair(Parameters(), report(("t", "stuck")), Bounds(), 0)
    assert parameters.unstick_after == 100.0


def test_late_progress_is_too_slow(builtin):
    """A progress test that failed though the goal was reached asks for speed."""
    text = render_controller(MIDDLE, RobotParams(), 0.05)
    failed = report((f"{END}test_progress", None))
    reply = builtin.complete(Request("edit", "", controller=text, report=failed))
    assert read_parameters(source_of(reply)).cruise_speed > MIDDLE.cruise_speed


def test_collision_is_laid_to_the_collision_test():
    """Of the tests that one collision failed, the notes name the plainest."""
    tests = (
        f"{END}test_progress",
        f"{END}test_no_collisions",
        f"{END}test_reaches_goal",
    )
    failed = report(*((test, "collision") for test in tests))
    _, changes = repair(MIDDLE, failed, Bounds(), 0)
    assert {change.test for change in changes} == {tests[1]}


def test_first_cause_wins():
    """Where two failures want the same parameter, the more telling one has it."""
    failed = report(("slow", "too slow"), ("hit", "collision"))
    parameters, changes = repair(MIDDLE, failed, Bounds(), 0)
    behind = {change.name: change.test for change in changes}
    assert behind["slow_dist"] == "hit"
    assert behind["cruise_speed"] == "slow"
    assert parameters.slow_dist > MIDDLE.slow_dist


def test_margin_is_searched_from_both_sides():
    """Between a margin that collides and one that goes nowhere."""
    crash, halt = report(("t", "collision")), report(("t", "no motion"))
    parameters = replace(MIDDLE, inflation_margin=8.0)
    bounds = Bounds(above=2.0, below=math.inf)
    for failed, above, below in ((halt, 2, 8), (crash, 5, 8), (halt, 5, 6.5)):
        bounds = Bounds(above, below)
        parameters, _ = repair(parameters, failed, bounds, 0)
    assert 5 < parameters.inflation_margin < 6.5


def test_rules_carry_the_parameters_over(builtin):
    """The next iteration starts where the last one ended, even from cut rules."""
    text = render_controller(MIDDLE, RobotParams(), 0.05)
    failed = report((f"{END}test_no_collisions", "collision"))
    reply = builtin.complete(
        Request("summarise", "", controller=text, report=failed, sample=(0, 3, 1))
    )
    told = parse_rules(reply.text)
    assert told
    assert all(len(rule) <= MAX_RULE_CHARS for rule in told)
    rules = add_rules((), ["Turn in place when lost.", *told], 3, ())
    request = Request("generate", "", rules=tuple(rule.text for rule in rules))
    parameters = read_parameters(source_of(builtin.complete(request)))
    wanted, _ = repair(MIDDLE, failed, Bounds(above=2.0), 301)
    assert parameters == wanted
    assert read_rules(told)[1].above == 2.0


def test_a_persons_rule_counts(builtin):
    """A rule in the documented words, written by hand, is obeyed."""
    request = Request("generate", "", rules=("set LOOKAHEAD = 55 px",))
    assert read_parameters(source_of(builtin.complete(request))).lookahead == 55.0


@pytest.mark.parametrize(
    "cause", ["collision", "no motion", "too slow", "held out", "error", None]
)
def test_never_tries_the_same_twice(builtin, cause):
    """Ten iterations that all fail in the same way are twenty different candidates."""
    rules, tried = (), []
    failed = report((f"{END}test_x", cause))
    for k in range(1, 11):
        texts = tuple(rule.text for rule in rules)
        reply = builtin.complete(Request("generate", "", rules=texts, sample=(0, k, 0)))
        for j, kind in enumerate(("edit", "summarise")):
            text = source_of(reply)
            tried.append(read_parameters(text))
            reply = builtin.complete(
                Request(
                    kind,
                    "",
                    controller=text,
                    report=failed,
                    rules=texts,
                    sample=(0, k, j),
                )
            )
        rules = add_rules(rules, parse_rules(reply.text), k, ())
    assert len(set(tried)) == len(tried)


def test_foreign_controller_is_replaced(builtin):
    """Code that is not from the template cannot be tuned; the notes say so."""
    failed = report((f"{END}test_x", "collision"))
    request = Request("edit", "", controller="def policy(obs): ...", report=failed)
    reply = builtin.complete(request)
    assert read_parameters(source_of(reply)).inflation_margin > 0
    assert "not from the template" in reply.notes[0]


def test_edit_needs_a_report(builtin):
    """A question that lacks its report is refused."""
    with pytest.raises(ValueError, match="request to edit needs a report"):
        builtin.complete(Request("edit", "", controller=""))
