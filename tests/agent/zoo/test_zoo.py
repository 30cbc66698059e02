"""Every attack is refused and harms nothing; every good controller passes."""

import pytest
from enclosure import (
    ATTACKS,
    GOOD,
    Enclosure,
    differences,
    load_case,
    tiers_of,
    working_tiers,
)

CASES = [load_case(path) for path in (*GOOD, *ATTACKS)]
ALWAYS = {"astar_pursuit", "policy_minimal", "forged_positions", "proc_walk", "daemon"}
KEYS = {"idea", "profile", "verdict", "fails", "error", "why", "tiers", "onto"}
KEYS |= {"repeat", "hides", "limits"}


def name_of(case):
    return f"{'good' if case.good else 'attack'}-{case.name}"


def test_the_zoo_is_complete():
    """60 attacks and 20 good controllers at least, 10 of these in full contract."""
    assert sum(not case.good for case in CASES) >= 60
    good = [case.header["profile"] for case in CASES if case.good]
    assert len(good) >= 20
    assert good.count("paper") >= 10


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_a_header_says_what_must_come_of_it(case):
    """Each has an idea and a profile; each attack that fails says why."""
    plain = {key for key in case.header if key.split()[0] not in {"error", "harm"}}
    assert plain <= KEYS
    assert case.header["idea"]
    assert case.header["profile"] in {"policy", "paper"}
    if not case.passes:
        assert case.header["why"]
        assert case.header.get("fails") or case.header.get("error")


@pytest.fixture(scope="module")
def check():
    """Judges a case; its result must be as its header says."""

    def judged(case, tier):
        assert differences(case, enclosure.judge(case, tier)) == []

    with Enclosure() as enclosure:
        yield judged


@pytest.mark.parametrize("case", [c for c in CASES if c.name in ALWAYS], ids=name_of)
def test_a_few_on_the_best_tier(case, check):
    """What is tried in each run of the tests."""
    check(case, working_tiers()[0])


RUNS = [(case, tier) for case in CASES for tier in tiers_of(case)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "tier"), RUNS, ids=[f"{name_of(case)}-{tier}" for case, tier in RUNS]
)
def test_the_zoo(case, tier, check):
    """Verdict, failing tests, messages and harm are as each header says."""
    check(case, tier)
