"""The repairs of `builtin` on both templates: each failure changes what it should."""

import ast
import math
from dataclasses import fields, replace

import numpy as np
import pytest

from tdac_agent import load_task
from tdac_agent.builtin.provider import Builtin
from tdac_agent.builtin.repair import read_rules, repair, write_rules
from tdac_agent.builtin.template import MarginBounds, read_parameters
from tdac_agent.environments.epuck import builtin as epuck
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.environments.map2d import builtin as map2d
from tdac_agent.environments.map2d.entry import MAP2D
from tdac_agent.models.provider import Request
from tdac_agent.prompting.extract import extract_source
from tdac_agent.prompting.rule_answer import MAX_OPERATIONS, apply, parse_operations
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.verification.diagnosis.report import Diagnosis, Failure, Report
from tdac_agent.verification.suite import contract
from tdac_agent.verification.suite.hygiene import HYGIENE
from tdac_envs.mapping.params import RobotParams

MIDDLE = map2d.MapParameters(
    inflation_margin=2.0,
    lookahead=60.0,
    slow_dist=10.0,
    stop_dist=4.0,
    turn_gain=0.6,
    turn_in_place=0.4,
    unstick_after=80.0,
    cruise_speed=0.6,
)
EPUCK_MIDDLE = epuck.EPuckParameters(
    inflation_margin=0.004,
    slow_dist=0.02,
    blocked=640.0,
    turn_gain=0.9,
    turn_in_place=0.2,
    unstick_after=80.0,
    cruise_speed=0.6,
)
END = "test_end_to_end.py::"
UP, DOWN = 1, -1
SLOW = pytest.mark.slow


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
def templates():
    """The templates, by the name of their environment."""
    crates = load_task("epuck-crates").nominal
    return {
        "map2d": map2d.template_for(RobotParams(), 0.05),
        "epuck": epuck.template_for(crates),
    }


@pytest.fixture(scope="module")
def template(templates):
    return templates["map2d"]


@pytest.fixture(scope="module")
def builtin(template):
    return Builtin(template)


@pytest.fixture(params=["map2d", "epuck"])
def either(request, templates):
    """Each template in turn."""
    return templates[request.param]


def parameters_of(reply, kind=map2d.MapParameters):
    return read_parameters(extract_source(reply.text), kind)


def learnt(book, reply, k):
    """The rules after an answer of the optimizer."""
    return apply(book, parse_operations(reply.text), k, ()).book


def texts_of(book):
    return tuple(rule.text for rule in book.in_force)


@pytest.mark.parametrize("seed", range(10))
def test_parameters_are_read_back(seed, either):
    """Whatever is rendered can be read from the file, and from rules, again."""
    random, kind = np.random.default_rng(seed), either.kind
    drawn = {
        f.name: random.uniform(f.metadata["low"], f.metadata["high"])
        for f in fields(kind)
    }
    parameters = kind().changed(**drawn)
    assert read_parameters(either.render(parameters), kind) == parameters
    rules = write_rules(parameters, [], MarginBounds(0.0015, 0.02), 1)
    assert len(rules) <= MAX_OPERATIONS
    known, bounds = read_rules(rules, kind)
    assert bounds == MarginBounds(0.0015, 0.02)
    for name, value in drawn.items():
        assert getattr(known, name) == pytest.approx(value, rel=1e-2, abs=1e-3)


def test_parameters_have_bounds(either):
    """A value out of bounds is refused; a change stops at the bound."""
    with pytest.raises(ValueError, match=r"turn_gain in \[0.1, 1\], got 2.0"):
        either.kind(turn_gain=2.0)
    assert either.kind().changed(turn_gain=2.0).turn_gain == 1.0


def test_the_repair_tables_know_their_parameters(either):
    """Every parameter that a remedy names exists in its own template."""
    names = {item.name for item in fields(either.kind)}
    for remedy in either.kind.remedies.values():
        assert {*remedy.add, *remedy.scale, *remedy.switch_on} <= names
    assert set(either.kind.remedies) == set(map2d.REMEDIES)


@pytest.mark.parametrize(
    ("name", "entry"), [("map2d", MAP2D), ("epuck", EPUCK)], ids=["map2d", "epuck"]
)
def test_static_contract(name, entry, templates):
    """The file is what the static tests ask for."""
    tree = ast.parse(templates[name].render(templates[name].kind()))
    names = contract.top_level_names(tree)
    assert contract.import_problems(tree) == []
    assert [problem for find in HYGIENE.values() for problem in find(tree)] == []
    wanted = entry.names
    contracted = {*wanted.constants, *wanted.functions, *wanted.classes}
    assert {"policy", "reset", *contracted} <= set(names)
    assert contract.has_main_guard(tree)


def test_first_candidate_is_neutral(builtin):
    """Without rules, the parameters have their neutral values."""
    reply = builtin.complete(Request("generate", ""))
    assert parameters_of(reply) == map2d.MapParameters()
    assert reply.stop == "end"


@pytest.mark.slow_after(7)
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
def test_each_failure_changes_its_parameter(template, builtin, cause, name, way):
    """The edit moves the parameter, and the notes name the test behind it."""
    failed = report((f"{END}test_x", cause))
    request = Request("edit", "", controller=template.render(MIDDLE), report=failed)
    reply = builtin.complete(request)
    assert (getattr(parameters_of(reply), name) - getattr(MIDDLE, name)) * way > 0
    note = f"{END}test_x -> {name} {getattr(MIDDLE, name):g} -> "
    assert any(line.startswith(note) for line in reply.notes), reply.notes


@pytest.mark.parametrize(
    ("cause", "name", "way"),
    [
        ("collision", "inflation_margin", UP),
        ("collision", "turn_gain", UP),
        ("collision", "turn_in_place", DOWN),
        ("collision", "slow_dist", UP),
        ("no motion", "inflation_margin", DOWN),
        ("stuck", "blocked", UP),
        ("looping", "unstick_after", DOWN),
        ("spinning", "turn_gain", DOWN),
        ("oscillating", "turn_in_place", UP),
        ("missed goal", "cruise_speed", DOWN),
        ("too slow", "cruise_speed", UP),
        ("time-out", "look_steps", UP),
        ("held out", "inflation_margin", UP),
    ],
)
def test_each_failure_of_an_epuck_changes_its_parameter(cause, name, way):
    """The remedy moves the parameter the right way."""
    after, _ = repair(EPUCK_MIDDLE, report(("t", cause)), MarginBounds(), 0)
    assert (getattr(after, name) - getattr(EPUCK_MIDDLE, name)) * way > 0


def test_stuck_switches_the_manoeuvre_on(either):
    """Off by default, on after a robot was stuck."""
    parameters, _ = repair(either.kind(), report(("t", "stuck")), MarginBounds(), 0)
    assert parameters.unstick_after == 100.0


def test_late_progress_is_too_slow(template, builtin):
    """A progress test that failed though the goal was reached asks for speed."""
    failed = report((f"{END}test_progress", None))
    request = Request("edit", "", controller=template.render(MIDDLE), report=failed)
    after = parameters_of(builtin.complete(request))
    assert after.cruise_speed > MIDDLE.cruise_speed


def test_collision_is_laid_to_the_collision_test():
    """Of the tests that one collision failed, the notes name the plainest."""
    names = "test_progress", "test_no_collisions", "test_reaches_goal"
    failed = report(*((f"{END}{name}", "collision") for name in names))
    _, changes = repair(MIDDLE, failed, MarginBounds(), 0)
    assert {change.test for change in changes} == {f"{END}test_no_collisions"}


def test_first_cause_wins():
    """Where two failures want the same parameter, the more telling one has it."""
    failed = report(("slow", "too slow"), ("hit", "collision"))
    parameters, changes = repair(MIDDLE, failed, MarginBounds(), 0)
    behind = {change.name: change.test for change in changes}
    assert behind["slow_dist"] == "hit"
    assert behind["cruise_speed"] == "slow"
    assert parameters.slow_dist > MIDDLE.slow_dist


def test_margin_is_searched_from_both_sides():
    """Between a margin that collides and one that goes nowhere."""
    crash, halt = report(("t", "collision")), report(("t", "no motion"))
    parameters = replace(MIDDLE, inflation_margin=8.0)
    for failed, above, below in (
        (halt, 2, math.inf),
        (halt, 2, 8),
        (crash, 5, 8),
        (halt, 5, 6.5),
    ):
        parameters, _ = repair(parameters, failed, MarginBounds(above, below), 0)
    assert 4 < parameters.inflation_margin < 6.5


def test_rules_carry_the_parameters_over(template, builtin):
    """The next iteration starts where the last one ended, even from cut rules."""
    failed = report((f"{END}test_no_collisions", "collision"))
    text = template.render(MIDDLE)
    reply = builtin.complete(
        Request("summarise", "", controller=text, report=failed, sample=(0, 3, 1))
    )
    rules = [operation.text for operation in parse_operations(reply.text)]
    assert rules
    book = RuleBook().add("Turn in place when lost.", "task", 2, ())
    request = Request("generate", "", rules=texts_of(learnt(book, reply, 3)))
    wanted, _ = repair(MIDDLE, failed, MarginBounds(above=2.0), 301)
    assert parameters_of(builtin.complete(request)) == wanted
    assert read_rules(rules, map2d.MapParameters)[1].above == 2.0


def test_a_persons_rule_counts(builtin):
    """A rule in the documented words, written by hand, is obeyed."""
    request = Request("generate", "", rules=("set LOOKAHEAD = 55 px",))
    assert parameters_of(builtin.complete(request)).lookahead == 55.0


CAUSES = ("collision", "held out", None, "no motion", "too slow", "error")


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        *(("map2d", "collision"), pytest.param("epuck", "collision", marks=SLOW)),
        *(pytest.param("map2d", cause, marks=SLOW) for cause in CAUSES[1:]),
        *(pytest.param("epuck", cause, marks=SLOW) for cause in CAUSES[3:]),
    ],
)
def test_never_tries_the_same_twice(name, cause, templates):
    """Ten iterations that all fail in the same way are twenty different candidates."""
    template, book, tried = templates[name], RuleBook(), []
    builtin, failed = Builtin(template), report((f"{END}test_x", cause))
    for k in range(1, 11):
        texts = texts_of(book)
        reply = builtin.complete(Request("generate", "", rules=texts, sample=(0, k, 0)))
        for j, kind in enumerate(("edit", "summarise")):
            text = extract_source(reply.text)
            tried.append(read_parameters(text, template.kind))
            reply = builtin.complete(
                Request(kind, "", text, failed, texts, sample=(0, k, j))
            )
        book = learnt(book, reply, k)
    assert len(set(tried)) == len(tried)


def test_foreign_controller_is_replaced(builtin):
    """Code that is not from the template cannot be tuned; the notes say so."""
    failed = report((f"{END}test_x", "collision"))
    request = Request("edit", "", controller="def policy(obs): ...", report=failed)
    reply = builtin.complete(request)
    assert parameters_of(reply).inflation_margin > 0
    assert "not from the template" in reply.notes[0]


def test_edit_needs_a_report(builtin):
    """A question that lacks its report is refused."""
    with pytest.raises(ValueError, match="request to edit needs a report"):
        builtin.complete(Request("edit", "", controller=""))
