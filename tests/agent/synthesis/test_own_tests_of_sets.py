"""The user's own tests in a run on a task set: as for a task, before the worlds."""

import json

import pytest
from script import STILL, Script, code

from tdac_agent.prompting.feedback import feedback_of
from tdac_agent.runs.ownership import is_own_folder
from tdac_agent.runs.run_record import load_run
from tdac_agent.verification.diagnosis.report import Report

TEST = """
def test_moves(rollout):
    episode = rollout(steps=30)
    assert abs(episode.trajectory.actions).max() > 0, "it stands still"
"""


@pytest.fixture
def suite(tmp_path):
    """A folder with a test."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "test_mine.py").write_text(TEST)
    return folder


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["on_task", "on_set"])
def test_a_failed_test_is_repaired(write, request, name, suite, out):
    """The failure is told in the words of a task, and nothing else was driven."""
    ground = request.getfixturevalue(name)
    model, run = write(ground, code(STILL), code(ground.good), suite=suite)
    assert run.status == ("passed" if ground.is_task else "selected")
    first = out / "iterations" / "k01" / "j0"
    report = Report.model_validate_json((first / "report.json").read_text())
    assert report.tests["own/test_mine.py::test_moves"] == "failed"
    told = feedback_of(report)
    assert "own/test_mine.py::test_moves" in told.text
    assert told.text in model.requests[1].prompt
    assert model.requests[1].report == report
    assert not list(first.glob("feedback-*"))
    assert (out / "suite" / "test_mine.py").read_text() == TEST
    known = load_run(out)
    assert known.suite_sha256 == report.provenance.suite_sha256
    assert is_own_folder(known)
    (out / "suite" / "test_mine.py").write_text("")
    assert not is_own_folder(known)


@pytest.mark.slow
def test_a_run_goes_on_without_testing_again(write, on_set, solver, suite, out):
    """A report on record is reused; a budget of episodes has nothing of the tests."""
    answers = code(STILL), KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        write(on_set, *answers, suite=suite)
    report = out / "iterations" / "k01" / "j0" / "report.json"
    before = report.stat().st_mtime_ns
    model, run = write(on_set, model=Script(code(solver)), suite=suite)
    assert (run.status, model.asked()) == ("selected", [("edit", 1, 1)])
    assert report.stat().st_mtime_ns == before
    selection = json.loads((out / "report.json").read_text())
    assert selection["feedback_used"] == 6


@pytest.mark.slow
def test_a_broken_suite_costs_nothing(write, on_set, suite):
    """The tests are tried before the first answer is paid for."""
    (suite / "test_mine.py").write_text("def test_mine(rolout):\n    pass\n")
    model = Script(code(STILL))
    model.paid = True
    with pytest.raises(Exception, match="did you mean 'rollout'"):
        write(on_set, model=model, suite=suite, max_cost=1.0)
    assert not model.requests
