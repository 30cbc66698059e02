"""`--improve E` on a task: variations of a verified controller."""

import json
import re
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from script import STILL, Script, code
from small import write_small_task
from without_marks import reading, unmarked

from tdac_agent.errors import RunError
from tdac_agent.html_report.page import make_page
from tdac_agent.library.listing import row_of, variations_text
from tdac_agent.metrics import frames_of
from tdac_agent.runs.improvement_record import NOT_SHOWN, read_improvement
from tdac_agent.runs.run_record import load_run
from tdac_agent.runs.selection_record import read_selection
from tdac_agent.synthesis.workload import LEAST_IMPROVE, shares
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.core.errors import TaskError

FRAGILE = """

LAST = [0.0, 0.0]
LATE = []


def policy(obs):
    if any(LAST) and not obs["wheel_speeds"].any():
        LATE.append(True)
    LAST[:] = (0.0, 0.0) if LATE else drive(obs)
    return tuple(LAST)
"""
"""It stops for ever if an action takes effect a step late, as in disturbed episodes."""


INTERRUPTING = """
import os, pathlib, signal, sys, time

reply = pathlib.Path(__file__).with_name("reply.md")
if not reply.exists():
    os.kill(os.getppid(), signal.SIGINT)
    time.sleep(60)
print(reply.read_text())
reply.unlink()
"""
"""A model that presses Ctrl-C when it is asked again."""

ENOUGH_FOR_ONE = 40_000
"""Tokens that are enough for one question and not for two."""


@pytest.fixture
def fragile(good_source):
    return good_source.replace("def policy(", "def drive(") + FRAGILE


def report_of(folder):
    return Report.model_validate_json((folder / "report.json").read_text())


@given(st.integers(LEAST_IMPROVE, 10_000))
def test_the_shares_of_a_task_are_all_episodes(improve):
    """And there are at least some variations."""
    parts = shares(None, improve)
    assert parts.explore + 2 * parts.comparison == improve
    assert parts.variations >= 4
    assert (parts.variations + 1) * parts.block <= parts.explore
    assert parts.asked == 2 * parts.variations
    assert shares(None).asked == 0


@pytest.mark.slow
def test_a_more_robust_variation_is_asked_for_and_delivered(
    improve, on_task, fragile, good_source, tmp_path
):
    """The model sees the parent, its figures, and what was tried with it."""
    answers = (fragile, STILL, fragile, good_source, STILL, STILL, STILL)
    model = Script(*map(code, answers))
    run = improve(on_task, model, ask="repair")
    out = tmp_path / "run"
    assert model.asked() == [
        ("generate", 1, 0),
        *(("improve", k, 0) for k in range(7, 13)),
    ]

    first, second, third = model.requests[1:4]
    assert "LATE.append(True)" in first.prompt
    assert "- candidate 1: goals reached 0.000, mean time score 0.000" in first.prompt
    assert "| mean of 4 |" in first.prompt
    assert "4 of 4 failed:\n- episode 1: no motion" in first.prompt
    assert not re.search(r"seed \d", first.prompt)
    assert "What was tried" not in first.prompt
    assert "All tests must still pass" in first.prompt
    assert re.search(r"Failed: \d+ of \d+ tests failed.*:\n```diff\n", second.prompt)
    assert second.prompt == third.prompt

    assert (run.status, run.tau, run.censored) == ("passed", 1, False)
    assert (out / "controller.py").read_text() == good_source
    report, own = report_of(out), report_of(out / "iterations/k09/j0")
    assert report == own
    assert report.passed
    for file in (out / "trajectories").glob("*.npz"):
        there = out / "iterations/k09/j0/trajectories" / file.name
        assert file.read_bytes() == there.read_bytes()

    attempts = [(each.k, each.passed, each.parent) for each in run.attempts]
    assert attempts[:4] == [
        *((1, True, None), (7, False, (1, 0)), (8, True, (1, 0)), (9, True, (1, 0)))
    ]
    assert {each.parent for each in run.attempts[4:]} <= {(1, 0), (9, 0)}
    assert run.attempts[2].unchanged
    assert run.attempts[2].notes[-1] == "same code as k=1 j=0"
    assert run.attempts[4].failed_tests == run.attempts[1].failed_tests
    assert "4 of 4 disturbed episodes" in run.attempts[3].notes[-1]

    found = read_improvement(out)
    assert (found.first, found.selected) == ((1, 0), (9, 0))
    assert [each.robustness for each in found.members] == [0.0, 1.0]
    assert found.members[1].nominal > found.members[1].time > 0.5
    assert found.members[1].clearance > 0.0
    assert found.used == 2 * 4 + 2 * 4
    assert (found.robustness.before, found.robustness.after) == (0.0, 1.0)
    assert found.robustness.low > 0.0
    # With four episodes, nothing can be shown.
    assert found.robustness.p == 0.125
    assert found.told.endswith(NOT_SHOWN)
    seeds = {
        name: [
            each["seed"]
            for each in json.loads(
                (out / "iterations" / name / "episodes.json").read_text()
            )["episodes"]
        ]
        for k in ("k01/j0", "k09/j0")
        for name in (f"{k}/improve-1", f"{k}/comparison-1")
    }
    assert seeds["k01/j0/improve-1"] == seeds["k09/j0/improve-1"]
    assert seeds["k01/j0/comparison-1"] == seeds["k09/j0/comparison-1"]
    assert not {*seeds["k01/j0/improve-1"]} & {*seeds["k01/j0/comparison-1"]}
    assert min(map(min, seeds.values())) > 2**32  # the seeds of `verify --robust`

    frames = frames_of([run])
    assert frames.runs[["tau", "done", "censored"]].values.tolist() == [[1, 1, False]]
    assert frames.candidates["k"].tolist() == [1]
    row = row_of(out)
    assert (row["k"], row["variations"], row["tau"]) == (1, 6, 1)
    assert variations_text(row) == ", 6 variations"
    page = reading(out)
    assert "Variations of what works" in page
    assert "varies iteration 1" in page


@pytest.mark.slow
def test_without_a_better_one_the_first_stays(
    improve, on_task, task, fragile, good_source, tmp_path, warm
):
    """It is delivered before the search begins, and has driven as in `--robust`."""
    model = Script(*map(code, (good_source, fragile, *[STILL] * 4)))
    seen = []

    def watch(record):
        if record["event"] == "drive.start":
            seen.append((tmp_path / "run" / "controller.py").read_text())

    run = improve(on_task, model, ask="repair", on_event=watch)
    assert set(seen) == {good_source}
    assert (run.folder / "controller.py").read_text() == good_source
    found = read_improvement(run.folder)
    assert found.selected == found.first == (1, 0)
    assert (found.episodes, found.used, found.time) == (0, 8, None)
    assert found.told.endswith("none was better than k=1 j=0, which stays")
    robust = verify_episodes(
        run.controller, task, 4, first=found.first_seed, judge=warm
    )
    own = run.folder / "iterations/k01/j0/improve-1/episodes.json"
    driven = EpisodeReport.model_validate_json(own.read_text()).episodes
    for episode in robust.worst:
        (same,) = (each for each in driven if each.seed == episode.seed)
        assert (same.steps, same.d_min) == (episode.steps, episode.d_min)
    assert len(robust.worst) == found.block == 4


@pytest.mark.slow
def test_all_verified_candidates_of_a_group_found_the_archive(
    improve, on_task, fragile, good_source
):
    """The run is still compared with its first one."""
    answers = (fragile, good_source, fragile, *[STILL] * 4)
    run = improve(on_task, Script(*map(code, answers)), candidates=3)
    found = read_improvement(run.folder)
    assert [(each.k, each.parent) for each in found.members] == [(1, None), (2, None)]
    assert (found.first, found.selected, run.tau) == ((1, 0), (2, 0), 1)
    assert (run.folder / "controller.py").read_text() == good_source


@pytest.mark.slow
@pytest.mark.parametrize("place", [1, 2])
def test_a_race_on_a_task(improve, on_task, fragile, good_source, place):
    """The best first answer is delivered if nothing beats it, whichever it is."""
    answers = [fragile, STILL]
    answers.insert(place - 1, good_source)
    words = {"search": "race", "candidates": 3, "iterations": 3}
    run = improve(on_task, Script(*map(code, answers)), **words)
    assert (run.status, run.setting) == ("passed", "first answers")
    assert (run.folder / "controller.py").read_text() == good_source
    assert report_of(run.folder).passed
    found = read_improvement(run.folder)
    assert found.first == found.selected == (place, 0)
    assert (found.founders, len(found.members), found.asked) == (2, 2, 0)
    assert row_of(run.folder)["variations"] == 0


@pytest.mark.slow
def test_the_end_of_the_budget_ends_the_search_alone(improve, on_task, good_source):
    """The verified controller stays verified."""
    model = Script(code(good_source))
    model.paid = True
    run = improve(on_task, model, max_tokens=ENOUGH_FOR_ONE)
    assert (run.status, run.tau) == ("passed", 1)
    assert model.asked() == [("generate", 1, 0)]
    assert "tokens" in run.reason
    found = read_improvement(run.folder)
    assert (found.asked, found.stopped) == (0, run.reason)
    assert (run.folder / "controller.py").read_text() == good_source


@pytest.mark.slow
def test_the_built_in_learner_varies_the_same_way_twice(improve, ground, tmp_path):
    """With one seed, folders agree but for clocks: after a break, and as a replay."""

    class Stop(Exception):
        pass

    def stop(record):
        if record["event"] == "drive.end" and record.get("k") == one.iterations + 2:
            raise Stop

    def record_of(folder):
        if ground.is_task:
            return read_improvement(folder)
        return read_selection(folder).model_copy(update={"stopped": None})

    one = improve(ground, out=tmp_path / "a")
    with pytest.raises(Stop):
        improve(ground, out=tmp_path / "b", on_event=stop)
    broken = load_run(tmp_path / "b")
    assert (broken.status, broken.improve) == ("fault", 32)
    if ground.is_task:
        assert (broken.tau, broken.censored) == (1, False)
        assert frames_of([broken]).runs["censored"].tolist() == [False]
    other = improve(ground, out=tmp_path / "b")
    again = improve(ground, f"replay:{tmp_path / 'a'}", out=tmp_path / "c")
    for run in (other, again):
        assert run.status == one.status
        assert run.attempts == one.attempts
        assert record_of(run.folder) == record_of(one.folder)
        assert sources(run.folder) == sources(one.folder)
    assert len(sources(one.folder)) > 4
    with pytest.raises(RunError, match="number of improving episodes 32 instead of 40"):
        improve(ground, out=tmp_path / "b", improve=40)


@pytest.mark.slow
def test_an_interrupted_search_leaves_a_verified_run(
    improve, on_task, good_source, tmp_path, tdac
):
    """All places say so, and how to go on; also after a break in resuming it."""
    out = tmp_path / "run"
    model = Script(code(good_source), code(STILL), KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        improve(on_task, model)

    def check():
        run = load_run(out)
        assert (run.passed, run.finished, run.censored) == (True, False, False)
        assert (run.tau, [each.k for each in run.attempts]) == (1, [1, 7])
        assert run.controller.read_text() == good_source
        assert row_of(out)["status"] == "passed"
        words = f"{out} has passed; to go on improving it: tdac synth --resume {out}"
        assert words in tdac("runs", tmp_path)[1]
        page = make_page(out)
        assert page.verified == 0
        html = unmarked(page.html.decode())
        assert "the search for a better one has not ended" in html
        assert "The controller that passed: controller.py" in html
        assert "Iteration 8</b>, a variation of what works" in html

    check()

    def interrupt(record):
        if record["event"] == "verify.start":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        improve(on_task, Script(), on_event=interrupt)
    check()
    run = improve(on_task, Script(*[code(STILL)] * 3))
    assert (run.status, len(run.attempts)) == ("passed", 5)


@pytest.mark.slow
def test_ctrl_c_in_a_search_tells_of_the_verified_controller(
    tdac, good_source, tmp_path
):
    folder, program = write_small_task(tmp_path / "task"), tmp_path / "model.py"
    (tmp_path / "reply.md").write_text(code(good_source).text)
    program.write_text(INTERRUPTING)
    learner = f"command:{sys.executable} {program}"
    words = ("synth", "--task", folder, "--learner", learner, "--improve", 32)
    words = (*words, "--no-confirm")
    exit_code, told, err = tdac(*words, "--out", "run")
    assert (exit_code, err.splitlines()[-1]) == (130, "interrupted")
    assert told.splitlines()[-1] == (
        "passed all tests in iteration 1: run/controller.py; to go on improving it: "
        "tdac synth --resume run"
    )


def sources(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("controller.*")
    }


def test_too_few_episodes_are_refused(improve, ground):
    with pytest.raises(TaskError, match="improve"):
        improve(ground, improve=31)


def test_a_seed_is_drawn_for_a_search(improve, on_task, good_source):
    """So that its record says which episodes it drove."""
    run = improve(
        on_task, Script(code(good_source), *[code(good_source)] * 3), seed=None
    )
    assert isinstance(run.seed, int)
    found = read_improvement(run.folder)
    assert found.first_seed > 2**33


@pytest.mark.slow
def test_the_command_improves_a_task(tdac, done, tmp_path, good_source):
    """It tells what the given controller reached, and what the best one is."""
    folder, slow = write_small_task(tmp_path / "task"), tmp_path / "slow.py"
    fast = "CRUISE_SPEED = 1.0"
    assert good_source.count(fast) == 1
    slow.write_text(good_source.replace(fast, "CRUISE_SPEED = 0.4"))
    words = ("synth", "--task", folder, "--from", slow, "--improve", 32, "--seed", 1)
    code_, out, err = tdac(*words, "--dry-run", "--json")
    assert (code_, err) == (0, "")
    told = json.loads(out)
    assert told["variations"] == shares(None, 32).asked == 10
    assert told["questions"] == 20 * 3 + 10
    code_, out, err = tdac(*words, "--out", "run")
    assert (code_, err) == (0, "")
    assert "~ k=21 j=0" in out
    found = read_improvement(Path("run"))
    first, best = found.members[0], max(found.members, key=lambda each: each.time)
    said = f"time score {first.time:.3f}; the goal reached in 4 of 4 disturbed episodes"
    assert out.count(said) == 2  # before the variations, and in the table
    assert re.search(r"improving: \d+ variations?, \d of them passed; ", out)
    assert (found.k, found.j) == (best.k, best.j) != (1, 0)
    assert f"; improved in iteration {best.k}" in out
    assert f"in iteration {best.k} (" in out
    listed = tdac("runs", ".")[1]
    assert f"1/20 +{found.asked}" in listed
    assert "k: iterations begun / allowed, + variations of what works" in listed
    out = done("synth", "--resume", "run")
    assert "has already finished" in out
