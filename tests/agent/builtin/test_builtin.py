"""The repairs of `builtin`: each failure changes what it should."""

import math
from dataclasses import replace

import pytest

from tdac_agent.builtin.parameters import read_parameters
from tdac_agent.builtin.provider import Builtin
from tdac_agent.builtin.remedies import MarginBounds
from tdac_agent.builtin.repair import read_rules, repair
from tdac_agent.environments.map2d.builtin import (
    Parameters,
    render_controller,
    template_for,
)
from tdac_agent.models.provider import Request
from tdac_agent.prompting.extract import extract_source
from tdac_agent.prompting.rule_answer import apply, parse_operations
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.verification.diagnosis.report import Diagnosis, Failure, Report
from tdac_envs.mapping.params import RobotParams

MIDDLE = Parameters(
    inflation_margin=2.0,
    lookahead=60.0,
    slow_dist=10.0,
    stop_dist=4.0,
    turn_gain=0.6,
    turn_in_place=0.4,
    unstick_after=80.0,
    cruise_speed=0.6,
)
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
    return Builtin(template_for(RobotParams(), 0.05))


def source_of(reply):
    source = extract_source(reply.text)
    assert source is not None
    return source


def learnt(book, reply, k):
    """The rules after an answer of the optimizer."""
    return apply(book, parse_operations(reply.text), k, ()).book


def texts_of(book):
    return tuple(rule.text for rule in book.in_force)


def test_first_candidate_is_neutral(builtin):
    """Without rules, the parameters have their neutral values."""
    reply = builtin.complete(Request("generate", ""))
    assert read_parameters(source_of(reply), Parameters) == Parameters()
    assert reply.stop == "end"


UP, DOWN = 1, -1
SLOW = pytest.mark.slow


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
def test_each_failure_changes_its_parameter(builtin, cause, name, way):
    """The edit moves the parameter, and the notes name the test behind it."""
    text = render_controller(MIDDLE, RobotParams(), 0.05)
    failed = report((f"{END}test_x", cause))
    reply = builtin.complete(Request("edit", "", controller=text, report=failed))
    after = read_parameters(source_of(reply), Parameters)
    change = getattr(after, name) - getattr(MIDDLE, name)
    assert change * way > 0
    note = f"{END}test_x -> {name} {getattr(MIDDLE, name):g} -> "
    assert any(line.startswith(note) for line in reply.notes), reply.notes


def test_stuck_switches_the_manoeuvre_on():
    """Off by default, on after a robot was stuck."""
    parameters, _ = repair(Parameters(), report(("t", "stuck")), MarginBounds(), 0)
    assert parameters.unstick_after == 100.0


def test_late_progress_is_too_slow(builtin):
    """A progress test that failed though the goal was reached asks for speed."""
    text = render_controller(MIDDLE, RobotParams(), 0.05)
    failed = report((f"{END}test_progress", None))
    reply = builtin.complete(Request("edit", "", controller=text, report=failed))
    assert (
        read_parameters(source_of(reply), Parameters).cruise_speed > MIDDLE.cruise_speed
    )


def test_collision_is_laid_to_the_collision_test():
    """Of the tests that one collision failed, the notes name the plainest."""
    tests = (
        f"{END}test_progress",
        f"{END}test_no_collisions",
        f"{END}test_reaches_goal",
    )
    failed = report(*((test, "collision") for test in tests))
    _, changes = repair(MIDDLE, failed, MarginBounds(), 0)
    assert {change.test for change in changes} == {tests[1]}


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
    bounds = MarginBounds(above=2.0, below=math.inf)
    for failed, above, below in ((halt, 2, 8), (crash, 5, 8), (halt, 5, 6.5)):
        bounds = MarginBounds(above, below)
        parameters, _ = repair(parameters, failed, bounds, 0)
    assert 5 < parameters.inflation_margin < 6.5


def test_rules_carry_the_parameters_over(builtin):
    """The next iteration starts where the last one ended, even from cut rules."""
    text = render_controller(MIDDLE, RobotParams(), 0.05)
    failed = report((f"{END}test_no_collisions", "collision"))
    reply = builtin.complete(
        Request("summarise", "", controller=text, report=failed, sample=(0, 3, 1))
    )
    told = [operation.text for operation in parse_operations(reply.text)]
    assert told
    book = RuleBook().add("Turn in place when lost.", "task", 2, ())
    request = Request("generate", "", rules=texts_of(learnt(book, reply, 3)))
    parameters = read_parameters(source_of(builtin.complete(request)), Parameters)
    wanted, _ = repair(MIDDLE, failed, MarginBounds(above=2.0), 301)
    assert parameters == wanted
    assert read_rules(told, Parameters)[1].above == 2.0


def test_a_persons_rule_counts(builtin):
    """A rule in the documented words, written by hand, is obeyed."""
    request = Request("generate", "", rules=("set LOOKAHEAD = 55 px",))
    assert (
        read_parameters(source_of(builtin.complete(request)), Parameters).lookahead
        == 55.0
    )


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    "cause",
    [
        *("collision", "held out", None),
        *(pytest.param(c, marks=SLOW) for c in ("no motion", "too slow", "error")),
    ],
)
def test_never_tries_the_same_twice(builtin, cause):
    """Ten iterations that all fail in the same way are twenty different candidates."""
    book, tried = RuleBook(), []
    failed = report((f"{END}test_x", cause))
    for k in range(1, 11):
        texts = texts_of(book)
        reply = builtin.complete(Request("generate", "", rules=texts, sample=(0, k, 0)))
        for j, kind in enumerate(("edit", "summarise")):
            text = source_of(reply)
            tried.append(read_parameters(text, Parameters))
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
        book = learnt(book, reply, k)
    assert len(set(tried)) == len(tried)


def test_foreign_controller_is_replaced(builtin):
    """Code that is not from the template cannot be tuned; the notes say so."""
    failed = report((f"{END}test_x", "collision"))
    request = Request("edit", "", controller="def policy(obs): ...", report=failed)
    reply = builtin.complete(request)
    assert read_parameters(source_of(reply), Parameters).inflation_margin > 0
    assert "not from the template" in reply.notes[0]


def test_edit_needs_a_report(builtin):
    """A question that lacks its report is refused."""
    with pytest.raises(ValueError, match="request to edit needs a report"):
        builtin.complete(Request("edit", "", controller=""))
