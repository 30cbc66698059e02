"""The questions of a race: what is known without code, and what is about whom."""

import re
from types import SimpleNamespace

import pytest
from pool_drives import FIRST, archive_of, candidate_of, member_of

from tdac_agent.synthesis.archive import Refused
from tdac_agent.synthesis.candidates import Explored
from tdac_agent.synthesis.pool_feedback import PoolFeedback
from tdac_agent.synthesis.race_questions import AIMS, RaceQuestions

GOOD, BAD = [0.9, 0.9, 0.3, 0.3], [0.3, 0.3, 0.8, 0.8]


def marked(k):
    """A source that no text without code has a part of."""
    return f"def policy(obs):\n    return 0.0, MARK_{k}\n"


def member(k, *scores, **about):
    return member_of(k, *scores, source=marked(k), **about)


@pytest.fixture
def archive():
    """Two founders that are good in different episodes."""
    return archive_of(member(1, *GOOD, founder=True), member(2, *BAD, founder=True))


@pytest.fixture
def texts(archive):
    told = PoolFeedback("world", FIRST, scene=None)
    trials = SimpleNamespace(
        pool_feedback=told, aim="Be quick.", counterexample=lambda candidate: ""
    )
    return RaceQuestions(archive, trials)


def failed(archive, k, parent, said="test_imports: os"):
    candidate = candidate_of(k, source=marked(k))
    candidate.explored = Explored(None, said, feedback=f"It failed: {said}")
    archive.refused.append(Refused(candidate, parent, said))


def test_what_is_known_has_no_code(archive, texts):
    """Figures of all, the table of the best one, failures, and what was refused."""
    archive.members.append(member(3, 0.9, 0.9, None, None))
    failed(archive, 4, None)
    failed(archive, 5, archive.members[0], "test_hygiene: sleep")
    text = texts.known()
    assert "MARK" not in text
    assert "def policy" not in text
    lines = [line for line in text.splitlines() if line.startswith("- candidate")]
    assert [line[:14] for line in lines] == [f"- candidate {k}:" for k in (1, 2, 3)]
    assert "mean time score 0.600; the goal reached in 4 of 4 worlds" in lines[0]
    assert "lost by failure 0.500, detour 0.025, standing 0.025" in lines[2]
    assert "### The best one, candidate 1\n| world |" in text
    assert "### Failures of candidate 3\n2 of 4 failed:\n- world 3: stuck" in text
    assert "### Candidate 4 failed tests, and did not drive\nIt failed: test_im" in text
    assert "It failed: test_hygiene: sleep" in text
    assert not re.search(r"7000\d\d\d", text)


def test_what_was_dropped_is_never_the_best(archive, texts):
    """Its figures are those of its first episodes, which may have been easy."""
    archive.dropped.append(member(3, 0.8, 0.8))
    text = texts.known()
    assert "### The best one, candidate 1" in text
    last = text.index("- candidate 3: mean time score 0.800")
    assert text.index("- candidate 2:") < last
    assert "of 2 worlds" in text[last:]


def test_nothing_is_known_before_a_drive(texts, archive):
    archive.members.clear()
    assert texts.known() == ""


@pytest.mark.parametrize("kind", ["repair", "faster"])
def test_about_a_controller(archive, texts, kind):
    """Its figures beside those of the best one, and no other code."""
    text, aim = texts.about(kind, (archive.members[1],))
    assert aim == f"{AIMS[kind]} Be quick."
    assert text.startswith("- candidate 2: mean time score 0.550")
    assert "\n- candidate 1: mean time score 0.600" in text
    assert "| candidate 1 |" in text
    assert "MARK" not in text  # the question has its source already
    assert "What was tried" not in text


def test_a_merge_has_both_sources(archive, texts):
    """One in the question, the other one in the text, with the table of each."""
    pair = texts.partners()
    assert pair == tuple(archive.members)
    text, aim = texts.about("merge", pair)
    assert aim.startswith(AIMS["merge"])
    assert f"### The other controller, candidate 2\n```python\n{marked(2)}```" in text
    assert "MARK_1" not in text
    assert text.count("| world |") == 2


@pytest.mark.parametrize(
    ("one", "other", "worth"),
    [
        ([0.9, 0.1], [0.1, 0.9], True),
        ([0.9, 0.5], [0.8, 0.5], False),
        ([0.90, 0.50], [0.80, 0.53], False),
        ([0.90, 0.50], [0.80, 0.55], True),
    ],
)
def test_partners_are_good_in_different_episodes(archive, texts, one, other, worth):
    """If the better one of both in each would be ahead by some hundredths."""
    archive.members[:] = [member(1, *one), member(2, *other)]
    assert len(texts.partners()) == (2 if worth else 0)


def test_one_alone_has_no_partner(archive, texts):
    """Nor is one that a child has replaced."""
    archive.replace((archive.members[1],))
    assert texts.partners() == ()


def test_what_was_tried(archive, texts):
    """Children that were not better, with their diff and what they changed."""
    parent = archive.members[0]
    worse = [0.8, 0.8, 0.3, 0.3]
    archive.members.append(member(3, *worse, parent=parent))
    archive.dropped.append(member(4, 0.5, 0.5, parent=parent))
    failed(archive, 5, parent)
    archive.members.append(member(6, *GOOD, parent=archive.members[1]))
    text, _ = texts.about("repair", (parent,))
    tried = text.partition("### What was tried with it\n")[2]
    assert "Mean time score -0.050 in 4 episodes; lost more or less by detour" in tried
    assert "detour +0.025, standing +0.025:\n```diff" in tried
    assert "Mean time score -0.400 in 2 episodes" in tried
    assert "Failed: test_imports: os:\n```diff" in tried
    for k in (3, 4, 5):
        assert f"-    return 0.0, MARK_1\n+    return 0.0, MARK_{k}\n" in tried
    assert "MARK_6" not in tried
    assert tried.count("```diff") == 3
