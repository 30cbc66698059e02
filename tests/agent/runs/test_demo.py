"""`tdac demo`: what was recorded is what a language model said, and it still holds."""

import json
from pathlib import Path

import pytest
from small import write_small_task
from unconfirmed import synthesize

from tdac_agent import load_task
from tdac_agent.errors import Fault
from tdac_agent.prompting.extract import extract_source
from tdac_agent.runs.replay import DEMO, RULES
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.journal import read_records
from tdac_agent.verification.verify import verify

SHIPPED = pytest.mark.parametrize("folder", [DEMO, RULES], ids=["demo", "rules"])


@pytest.mark.slow
def test_the_demo_is_the_recorded_run_with_live_tests(done):
    """The same candidates fail and pass; each question is worded as it was answered."""
    out = done("demo", "--json")
    run, recorded = json.loads(out), load_run(DEMO)
    assert (run["status"], recorded.status) == ("passed", "verified")
    assert run["learner"] == "replay:demo"
    assert (run["tau"], run["tokens_out"]) == (recorded.tau, 0)
    assert fates(run["attempts"]) == fates(recorded.attempts)
    again = Path("runs/demo-1")
    assert (again / "controller.py").is_file()
    replies = [r for r in read_records(again / "journal.jsonl") if "blob" in r]
    assert [reply["kind"] for reply in replies] == ["generate", "edit"]
    for reply in replies:
        assert not any("worded differently" in note for note in reply["notes"])
        assert question(again, reply) == question(DEMO, reply)


@pytest.mark.slow
def test_rules_are_learnt_again(done, tmp_path):
    """A change of a question is noted; new code is asked for in the very same words."""
    words = "--task", "maze", "--prompt", "underspecified", "--seed", "0"
    words = *words, "--learner", "replay:rules", "--no-confirm", "--patience", "1"
    again, recorded = tmp_path / "run", load_run(RULES)
    run = json.loads(done("synth", *words, "--json", "--out", str(again)))
    assert run["status"] == "passed"
    assert fates(run["attempts"]) == fates(recorded.attempts)
    replies = [r for r in read_records(again / "journal.jsonl") if "blob" in r]
    for reply in replies:
        reworded = any("worded differently" in note for note in reply["notes"])
        assert reworded == (question(again, reply) != question(RULES, reply))
        assert not (reworded and reply["kind"] == "generate")


def fates(attempts):
    """What came of each candidate."""
    facts = [a if isinstance(a, dict) else a.model_dump() for a in attempts]
    return [(a["k"], a["j"], a["passed"], tuple(a["failed_tests"])) for a in facts]


def question(folder, reply):
    """The prompt that was answered."""
    place = folder / "iterations" / f"k{reply['k']:02}" / f"j{reply['j']}"
    return (place / f"{reply['kind']}.prompt.md").read_text()


@pytest.mark.slow
@SHIPPED
@pytest.mark.parametrize("which", [0, -1], ids=["first", "last"])
def test_a_recorded_candidate_fares_as_it_did(folder, warm, which):
    """The tests of today fail the first one, and pass the last one, as they did."""
    recorded = load_run(folder)
    attempt = recorded.attempts[which]
    task = load_task(recorded.task).with_profile(recorded.profile)
    place = folder / "iterations" / f"k{attempt.k:02d}" / f"j{attempt.j}"
    kind = "edit" if attempt.j else "generate"
    source = extract_source((place / f"{kind}.reply.md").read_text())
    report = verify(source, task, seed=recorded.seed, judge=warm)
    assert report.passed == attempt.passed
    assert tuple(f.test for f in report.failures) == attempt.failed_tests


def test_it_answers_no_other_task(tmp_path, warm):
    """The wording of failures may differ, but never the task."""
    task = load_task(write_small_task(tmp_path / "task"))
    with pytest.raises(Fault, match=r"question differs .* line \d+: generate k=1 j=0"):
        synthesize(
            task,
            "replay:rules",
            out=tmp_path / "run",
            prompt="underspecified",
            judge=warm,
        )


def test_it_shows_a_failure_of_the_drive_and_its_repair():
    """What fails is the drive, not a helper function."""
    first, last = load_run(DEMO).attempts
    assert "test_end_to_end.py::test_reaches_goal" in first.failed_tests
    assert last.passed


@SHIPPED
def test_every_answer_has_its_question(folder):
    """Prompts and replies are kept side by side, as they were."""
    replies = sorted(folder.rglob("*.reply*.md"))
    assert len(replies) >= len(load_run(folder).attempts)
    for reply in replies:
        prompt = reply.with_name(reply.name.replace(".reply", ".prompt"))
        assert prompt.stat().st_size > 1000
        assert reply.stat().st_size > 100
