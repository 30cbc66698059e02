"""Writing for a task set: what is asked, driven, selected, and kept."""

import json
import os
import re
import stat

import pytest
from few_worlds import KNOWN, half_of, write_set
from script import AHEAD, NO_RULES, STILL, Paid, code
from unconfirmed import synthesize
from without_marks import reading

from tdac_agent.errors import RunError
from tdac_agent.html_report.set_part import MOST_DRAWN
from tdac_agent.runs.run_record import load_run
from tdac_agent.runs.selection_record import Selection
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError


def selection(folder):
    return Selection.model_validate_json((folder / "report.json").read_text())


@pytest.mark.slow
def test_a_repaired_candidate_is_selected(write, on_set, solver, out, few):
    """The failure is told; all episodes count; a pass on dev is not `verified`."""
    model, run = write(on_set, code(STILL), code(solver))
    assert run.status == "selected"
    assert not run.verified
    assert run.finished
    assert model.asked() == [("generate", 1, 0), ("edit", 1, 1)]
    edit = model.requests[1].prompt
    assert "the goal reached in 0 of 2 worlds; 2 no motion" in edit
    assert STILL in edit
    report = selection(out)
    for number in (report.first_feedback, report.first_feedback + 1):
        assert f"world {number}: no motion: in" in edit
    assert (report.k, report.j) == (1, 1)
    assert report.feedback_used == 6
    assert report.validation_used <= 6
    first, second = report.candidates
    assert (first.feedback_worlds, first.feedback_reached) == (2, 0)
    assert (second.feedback_worlds, second.feedback_reached) == (4, 4)
    assert second.validation_time > 0.5 > first.validation_time
    assert report.optimistic.success == 1.0
    assert (out / "controller.py").read_text() == solver
    assert load_set(out / "set.yaml").sha256 == few.sha256
    assert json.loads((out / "params.json").read_text())["map"] is True
    assert load_run(out).status == "selected"


@pytest.mark.slow
def test_the_only_controller_of_a_learner_has_one_test(write, on_set, out):
    """Nothing else can be asked of it, so more feedback tells nobody anything."""
    _, run = write(on_set, model="builtin", candidates=3)
    report = selection(out)
    assert (run.status, report.stopped) == ("selected", "builtin has one controller")
    assert [each.feedback_worlds for each in report.candidates] == [2]
    assert (report.feedback_used, report.candidates[0].feedback_reached) == (2, 2)
    assert report.validation_used == 6
    assert [each.unchanged for each in run.attempts].count(True) == 2


@pytest.mark.slow
def test_a_replay_asks_no_more_than_the_recorded_run(tmp_path, out, warm):
    """Of a controller that fails, too, when nobody was there to repair it."""
    horizon = {"factor": 1, "least": 20, "most": 20}
    short = load_set(write_set(tmp_path / "short.yaml", horizon=horizon))
    given = {
        "search": "paper",
        "episodes": 8,
        "feedback_episodes": 2,
        "seed": 3,
        "judge": warm,
    }
    run = synthesize(short, "builtin", out=out, **given)
    assert (run.status, len(run.attempts)) == ("not verified", 1)
    again = synthesize(short, f"replay:{out}", out=tmp_path / "again", **given)
    assert (again.status, again.attempts) == (run.status, run.attempts)


@pytest.mark.slow
def test_a_given_controller_is_tested_until_it_fails(write, on_set, out):
    """Only then is the one of `builtin` driven, once."""
    write(on_set, model="builtin", start_from=KNOWN.read_text() + "\nGIVEN = True\n")
    report = selection(out)
    assert report.stopped == "all feedback episodes were driven"
    assert [each.feedback_worlds for each in report.candidates] == [6]
    write(on_set, model="builtin", start_from=STILL, out=out.parent / "other")
    report = selection(out.parent / "other")
    assert report.stopped == "builtin has one controller"
    assert [each.feedback_worlds for each in report.candidates] == [2, 2]


@pytest.mark.slow
def test_each_test_has_new_worlds(write, on_set, out):
    """Feedback worlds are never used twice, nor for the selection."""
    write(on_set, code(STILL), code(AHEAD), iterations=1, refine=False)
    driven = {"feedback": [], "validation": []}
    for path in sorted(out.glob("iterations/*/*/*/episodes.json")):
        episodes = json.loads(path.read_text())["episodes"]
        numbers = [episode["index"] for episode in episodes]
        driven[path.parent.name.partition("-")[0]].append(numbers)
    feedback = [number for numbers in driven["feedback"] for number in numbers]
    assert sorted(feedback) == list(range(min(feedback), min(feedback) + 4))
    validation = {number for numbers in driven["validation"] for number in numbers}
    assert validation.isdisjoint(feedback)
    # Both candidates drove on the same ones first.
    assert driven["validation"][0] == driven["validation"][1]


@pytest.mark.slow
def test_rules_and_categories(write, on_set, solver):
    """A rule's evidence are the categories of failure, and it is told what came."""
    rule = '```json\n[{"op": "add", "scope": "task", "text": "Do move."}]\n```'
    rules = type(NO_RULES)(rule)
    model, run = write(on_set, code(STILL), code(AHEAD), rules, code(solver))
    assert run.status == "selected"
    asked = [("generate", 1, 0), ("edit", 1, 1), ("summarise", 1, 1)]
    assert model.asked() == [*asked, ("generate", 2, 0)]
    assert "Do move." in model.requests[3].prompt
    assert "`task` (this task set)" in model.requests[2].prompt
    book = json.loads((run.folder / "rules.json").read_text())
    assert book["rules"][0]["evidence"] == ["collision with a wall"]


def test_no_question_without_episodes_for_its_answer(write, on_set):
    """Two episodes are for feedback, and the first test uses them."""
    model, run = write(on_set, code(STILL), episodes=4)
    assert model.asked() == [("generate", 1, 0)]
    assert selection_or_none(run) is None
    assert run.status == "not verified"


def selection_or_none(run):
    path = run.folder / "report.json"
    return selection(run.folder) if path.exists() else None


FOR_ONE = 30_000
"""Tokens that are enough for one question and not for two."""


@pytest.fixture
def half(solver):
    return half_of(solver)


@pytest.mark.slow
def test_the_report_draws_failures_of_the_selected_controller(write, on_set, half, out):
    """Beside the counts of each candidate; nothing is drawn of a run from elsewhere."""
    write(on_set, code(half), iterations=1, patience=0, refine=False)
    found, page = selection(out).candidates[0], reading(out)
    driven = found.feedback_worlds + found.validation_worlds
    failed = driven - found.feedback_reached - found.validation_reached
    assert 0 < failed < driven
    assert f"{failed} of {driven} recorded episodes failed" in page
    drawn = re.findall(r'alt="(\w+ world \d+): ([\w ]+)">', page)
    assert len({name for name, _ in drawn}) == min(failed, MOST_DRAWN)
    assert {cause for _, cause in drawn} == {"no motion"}
    reached = f"{found.validation_reached} of {found.validation_worlds}"
    assert f'<td class="n">{reached}</td>' in page
    assert ">no motion</th>" in page  # a cause of failures
    assert reading(out) == page
    record = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps({**record, "mark": ""}))
    page = reading(out)
    said = "Not drawn: the folder contains a run that this installation did not begin"
    assert said in page
    assert 'alt="feedback world' not in page


@pytest.mark.slow
def test_the_best_is_selected_when_the_budget_ends(write, on_set, half, out):
    """One that reaches some goals is worth a selection."""
    _, run = write(on_set, model=Paid(code(half)), max_tokens=FOR_ONE)
    assert run.status == "selected"
    assert "tokens" in run.reason
    report = selection(out)
    assert 0.0 < report.optimistic.success < 1.0
    assert report.stopped == run.reason


@pytest.mark.slow
def test_another_run_is_refused(write, on_set):
    write(on_set, code(STILL), iterations=1, patience=0, refine=False)
    with pytest.raises(RunError, match="number of episodes 12 instead of 14"):
        write(on_set, episodes=14, iterations=1, patience=0, refine=False)


@pytest.mark.slow
def test_then_verify_drives_once_on_hidden_worlds(write, on_set, solver, out):
    """Also of a finished run; the salt stays in a folder of the user alone."""
    write(on_set, code(solver))
    model, run = write(on_set, then_verify=True)
    assert model.asked() == []
    assert run.status == "verified"
    assert stat.S_IMODE(os.stat(out / "sealed").st_mode) == 0o700
    salt = out / "sealed" / "salt"
    assert stat.S_IMODE(salt.stat().st_mode) == 0o600
    assert len(salt.read_bytes()) == 32
    text = (out / "hidden.json").read_text()
    assert json.loads(text)["episodes"] == []
    assert json.loads(text)["hidden"]["lineage"] == 1
    reached = "{successes} of {count}".format(**json.loads(text))
    said = f"On hidden worlds, it then reached the goal in {reached}."
    assert said in reading(out)
    secret = salt.read_bytes()
    for path in out.rglob("*"):
        if path.is_file() and path != salt:
            content = path.read_bytes()
            assert secret not in content
            assert secret.hex().encode() not in content
    _, again = write(on_set, then_verify=True)
    assert again.status == "verified"
    assert (out / "hidden.json").read_text() == text


def test_arguments_that_are_refused(write, on_set):
    with pytest.raises(TaskError, match="episodes"):
        write(on_set, episodes=1)
    with pytest.raises(TaskError, match="feedback_episodes"):
        write(on_set, feedback_episodes=0)
