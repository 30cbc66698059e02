"""The strip at the top: what each version did, and what changed after it."""

import pytest

from tdac_agent.html_report.animation import animations
from tdac_agent.html_report.code import is_new_file, is_rewritten
from tdac_agent.html_report.scene import scene_of
from tdac_agent.html_report.story import MOST_CARDS, story_of
from tdac_agent.runs.history import gather_run


def cards_of(folder):
    history = gather_run(folder)
    return story_of(history, animations(history, history.task, scene_of(history.task)))


@pytest.fixture(scope="module")
def cards(runs):
    """Those of a run whose first version hits a wall."""
    return cards_of(runs / "verified")


def test_what_each_version_did(cards):
    """The first ends at a wall, where its mark is; the second passes."""
    first, second = cards
    assert first.told == "Hits a wall after 0.5 s."
    assert first.contact is not None
    assert 0 < first.contact[0] - first.end[0] < 60
    assert second.told == "Passes all 21 tests."
    assert second.contact is None
    assert len(second.line.split()) > 5


def test_what_changed(cards):
    """No arrow leads to the first version."""
    first, second = cards
    assert (first.changed, second.changed) == ("", "484 lines added, 1 removed")


@pytest.mark.slow
def test_a_long_run_has_the_first_ones_and_the_last(long_run):
    """The number of those in between is told."""
    cards = cards_of(long_run)
    assert len(cards) == MOST_CARDS
    assert [card.version for card in cards] == [1, 2, 3, 4, 5, 40]
    assert cards[-1].skipped == 34


def test_a_single_version_is_no_story(copied):
    """The page begins with its verdict."""
    history = gather_run(copied)
    one = history.tried[0]
    assert story_of(_only(history, one), []) == []


def _only(history, one):
    return type(history)(
        **{
            name: (one,) if name == "tried" else getattr(history, name)
            for name in history.__dataclass_fields__
        }
    )


def test_both_stand_in_the_page(page):
    """The strip, and what the confirmation means."""
    assert page.count('<ol class="story">') == 2
    assert "Hits a wall after " in page


@pytest.mark.parametrize(
    ("diff", "source", "expected"),
    [
        ("--- a\n+++ b\n@@ -0,0 +1,2 @@\n+x\n+y\n", "x\ny\n", (True, False)),
        (
            "--- a\n+++ b\n@@ -1,3 +1,3 @@\n a\n-b\n+x\n c\n",
            "a\nx\nc\n",
            (False, False),
        ),
        ("--- a\n+++ b\n@@ -1,2 +1,2 @@\n-a\n-b\n+x\n+y\n", "x\ny\n", (False, True)),
    ],
    ids=["new", "edited", "rewritten"],
)
def test_kinds_of_changes(diff, source, expected):
    """A new file is none that was rewritten."""
    assert (is_new_file(diff), is_rewritten(diff, source)) == expected
