"""What the models are told: counts of categories, at most three diagnoses."""

from few_worlds import write_set
from script import STILL

from tdac_agent.synthesis.set_reports import REFUSED, set_feedback, summary_of
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set


def test_counts_and_three_diagnoses(few, warm):
    report = verify_episodes(STILL, few, 5, split="dev", first=70, judge=warm)
    assert [episode.index for episode in report.episodes] == [70, 71, 72, 73, 74]
    told = set_feedback(report)
    assert told.text.startswith(
        "On 5 worlds that were new to it: the goal reached in 0 of 5 worlds; "
        "5 no motion. Mean score 0.000"
    )
    assert "3. world 72: no motion" in told.text
    assert "world 73" not in told.text
    assert told.line == "the goal reached in 0 of 5 worlds; 5 no motion"
    assert told.failed == ("no motion",)
    assert told.report is None


def test_a_file_that_may_not_drive(few, warm):
    """Each test that refused it is told."""
    report = verify_episodes(STILL, few, 1, split="dev", judge=warm)
    why = ("test_hygiene[sleep]: line 3", "test_imports: os")
    empty = {"count": 0, "episodes": (), "causes": {}, "scores": None, "told": why}
    told = set_feedback(report.model_copy(update=empty))
    assert told.failed == (REFUSED,)
    assert all(f"\n- {line}" in told.text for line in why)
    assert "refused the file" in told.line


def test_errors_are_told(tmp_path, warm):
    """Where the controller raised, with its message."""
    tasks = load_set(write_set(tmp_path / "few.yaml"))
    source = """
STEPS = []
def policy(obs):
    STEPS.append(0)
    return obs["pose" if len(STEPS) < 20 else "posse"][0] * 0.0, 0.0
"""
    report = verify_episodes(source, tasks, 2, split="dev", judge=warm)
    text = set_feedback(report).text
    assert "KeyError" in text
    assert "posse" in text
    assert summary_of(report).endswith("2 error")
