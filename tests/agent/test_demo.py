"""`tdac demo`: what was recorded is what a language model said, and it still holds."""

import json

import pytest

from tdac_agent.cli import main
from tdac_agent.providers.replay import DEMO
from tdac_agent.records import load_run


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
    assert (tmp_path / "runs" / "demo-1" / "controller.py").is_file()


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
