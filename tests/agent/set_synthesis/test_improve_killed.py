"""Searches whose process is killed with -9 at random moments end the same."""

import json

import pytest
from few_worlds import write_set
from killed_synthesis import finish, kill_again_and_again

KILLS = 20
WORDS = ("--set", "few.yaml", "--episodes", "4", "--feedback-episodes", "2")
WORDS += ("--improve", "32", "--seed", "5")


def state(folder):
    """All that a run says of its result, without what the clock has a say in."""
    run = json.loads((folder / "run.json").read_text())
    for name in ("started", "seconds", "id", "mark"):
        del run[name]
    sources = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("controller.*")
    }
    return run, (folder / "report.json").read_text(), sources


@pytest.mark.slow
def test_a_search_that_is_killed_twenty_times_ends_the_same(tmp_path):
    write_set(tmp_path / "few.yaml")
    finish(tmp_path, WORDS, "undisturbed")
    kill_again_and_again(tmp_path, WORDS, "killed", KILLS, 12.0)
    finish(tmp_path, WORDS, "killed")
    assert state(tmp_path / "killed") == state(tmp_path / "undisturbed")
