"""What comes from somebody else runs nothing and reaches nobody, unless allowed."""

import pytest
from foreign import ATTACKS, make_own_run, problems_of

# What a folder could bring to be run, filled in or reached.
WAYS = {
    *("tests_of_a_run", "conftest_of_a_run", "program_as_learner"),
    *("template_that_computes", "server_that_gets_the_key"),
}


@pytest.fixture(scope="session")
def own(tmp_path_factory):
    """A run of this installation."""
    return make_own_run(tmp_path_factory.mktemp("own") / "run")


def test_each_way_is_tried():
    """Each way of a folder to have something run, filled in or reached."""
    assert {one.name for one in ATTACKS} >= WAYS


@pytest.mark.slow
@pytest.mark.parametrize("one", ATTACKS, ids=lambda one: one.name)
def test_nothing_runs_and_a_line_says_what_was_wanted(one, own, tmp_path):
    """Exit 2, with the flag that allows it; no canary was touched."""
    assert problems_of(one, own, tmp_path, trust=False) == []


ALLOWED = [one for one in ATTACKS if one.works is not None]


@pytest.mark.slow
@pytest.mark.parametrize("one", ALLOWED, ids=lambda one: one.name)
def test_it_works_with_trust(one, own, tmp_path):
    """So the attack is one; a template computes nothing even then."""
    assert problems_of(one, own, tmp_path, trust=True) == []
