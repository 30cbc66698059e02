"""`tdac demo`: what was recorded is what a language model said, and it still holds."""

import json

import pytest
from small import write_small_task

from tdac_agent.cli import main
from tdac_agent.errors import Fault
from tdac_agent.journal import read_records
from tdac_agent.providers.replay import DEMO
from tdac_agent.records import load_run
from tdac_agent.synthesis import synthesize
from tdac_agent.task import load_task


@pytest.fixture
def recorded():
    """The run that is shipped."""
    return load_run(DEMO)


def test_the_demo_is_the_recorded_run_with_live_tests(
    recorded, tmp_path, monkeypatch, capsys
):
    """The same candidates fail and pass as when it was recorded; none is paid for."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["tdac", "demo", "--json"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    run = json.loads(capsys.readouterr().out)
    assert run["status"] == "verified"
    assert run["learner"] == "replay:demo"
    assert (run["tau"], run["tokens_out"]) == (recorded.tau, 0)
    places = [(a["k"], a["j"], a["passed"]) for a in run["attempts"]]
    assert places == [(a.k, a.j, a.passed) for a in recorded.attempts]
    failed = [tuple(a["failed_tests"]) for a in run["attempts"]]
    assert failed == [a.failed_tests for a in recorded.attempts]
    again = tmp_path / "runs" / "demo-1"
    assert (again / "controller.py").is_file()
    replies = [r for r in read_records(again / "journal.jsonl") if "blob" in r]
    for reply in replies:
        reworded = any("worded otherwise" in note for note in reply["notes"])
        assert reworded == (question(again, reply) != question(DEMO, reply))
        # A new controller was asked for in the very same words.
        assert not (reworded and reply["kind"] == "generate")


def question(folder, reply):
    """The prompt that was answered."""
    place = folder / "iterations" / f"k{reply['k']:02}" / f"j{reply['j']}"
    return (place / f"{reply['kind']}.prompt.md").read_text()


def test_it_answers_no_other_task(tmp_path):
    """What is worded otherwise may be how failures are told, never the task."""
    task = load_task(write_small_task(tmp_path / "task"))
    with pytest.raises(
        Fault, match=r"another question than generate k=1 j=0 in .*line"
    ):
        synthesize(task, "replay:demo", out=tmp_path / "run", prompt="underspecified")


def test_it_shows_a_failure_and_its_repair(recorded):
    """That is what happened."""
    assert recorded.verified
    assert not recorded.attempts[0].passed


def test_every_answer_has_its_question(recorded):
    """Prompts and replies are kept side by side, as they were."""
    replies = sorted(DEMO.rglob("*.reply*.md"))
    assert len(replies) >= len(recorded.attempts)
    for reply in replies:
        prompt = reply.with_name(reply.name.replace(".reply", ".prompt"))
        assert prompt.stat().st_size > 1000
        assert reply.stat().st_size > 100
