"""`tdac demo`: what was recorded is what a language model said, and it still holds."""

import json
from pathlib import Path

import pytest
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import Fault
from tdac_agent.prompting.extract import extract_source
from tdac_agent.runs.replay import DEMO
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.journal import read_records
from tdac_agent.verification.verify import verify


@pytest.fixture
def recorded():
    """The run that is shipped."""
    return load_run(DEMO)


@pytest.mark.slow
def test_the_demo_is_the_recorded_run_with_live_tests(recorded, done):
    """The same candidates fail and pass as when it was recorded; none is paid for."""
    out = done("demo", "--json")
    run = json.loads(out)
    assert run["status"] == "passed"
    assert run["learner"] == "replay:demo"
    assert (run["tau"], run["tokens_out"]) == (recorded.tau, 0)
    places = [(a["k"], a["j"], a["passed"]) for a in run["attempts"]]
    assert places == [(a.k, a.j, a.passed) for a in recorded.attempts]
    failed = [tuple(a["failed_tests"]) for a in run["attempts"]]
    assert failed == [a.failed_tests for a in recorded.attempts]
    again = Path("runs/demo-1")
    assert (again / "controller.py").is_file()
    replies = [r for r in read_records(again / "journal.jsonl") if "blob" in r]
    for reply in replies:
        reworded = any("worded differently" in note for note in reply["notes"])
        assert reworded == (question(again, reply) != question(DEMO, reply))
        # A new controller was asked for in the very same words.
        assert not (reworded and reply["kind"] == "generate")


def question(folder, reply):
    """The prompt that was answered."""
    place = folder / "iterations" / f"k{reply['k']:02}" / f"j{reply['j']}"
    return (place / f"{reply['kind']}.prompt.md").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("which", [0, -1], ids=["first", "last"])
def test_a_recorded_candidate_fares_as_it_did(recorded, warm, which):
    """The tests of today fail the first one, and pass the last one, as they did."""
    attempt, task = recorded.attempts[which], load_task(recorded.task)
    place = DEMO / "iterations" / f"k{attempt.k:02d}" / f"j{attempt.j}"
    source = extract_source((place / "generate.reply.md").read_text())
    report = verify(source, task, seed=recorded.seed, judge=warm)
    assert report.passed == attempt.passed
    assert tuple(f.test for f in report.failures) == attempt.failed_tests


def test_it_answers_no_other_task(tmp_path, warm):
    """The wording of failures may differ, but never the task."""
    task = load_task(write_small_task(tmp_path / "task"))
    with pytest.raises(Fault, match=r"question differs .* line \d+: generate k=1 j=0"):
        synthesize(
            task,
            "replay:demo",
            out=tmp_path / "run",
            prompt="underspecified",
            judge=warm,
        )


def test_it_shows_a_failure_and_its_repair(recorded):
    """That is what happened."""
    assert recorded.passed
    assert not recorded.attempts[0].passed


def test_every_answer_has_its_question(recorded):
    """Prompts and replies are kept side by side, as they were."""
    replies = sorted(DEMO.rglob("*.reply*.md"))
    assert len(replies) >= len(recorded.attempts)
    for reply in replies:
        prompt = reply.with_name(reply.name.replace(".reply", ".prompt"))
        assert prompt.stat().st_size > 1000
        assert reply.stat().st_size > 100
