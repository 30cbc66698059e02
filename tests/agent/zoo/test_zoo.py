"""Every attack is refused and harms nothing; every good controller passes."""

import re
from pathlib import Path

import offers
import pytest
from cases import all_cases, tiers_of, working_tiers
from enclosure import Enclosure, differences
from grounds import KINDS, zoo_task

import tdac_agent
from tdac_agent.verification.verify import verify

CASES = all_cases()
ALWAYS = {"astar_pursuit", "forged_positions", "proc_walk", "tapes_of_known_starts"}
ALWAYS |= {"installation_secret"}
KEYS = {"idea", "profile", "verdict", "fails", "error", "why", "tiers", "onto", "also"}
KEYS |= {"repeat", "hides", "limits", "seed"}
# Of attacks, good controllers, and good ones in full contract, by kind of task.
AT_LEAST = {"map2d": (60, 20, 10), "epuck": (26, 8, 3)}


@pytest.mark.parametrize("kind", KINDS)
def test_the_zoo_is_complete(kind):
    """Attacks and good controllers for each kind of task, some in full contract."""
    attacks, good, paper = AT_LEAST[kind]
    assert sum(not case.good for case in CASES if case.kind == kind) >= attacks
    found = [c.header["profile"] for c in CASES if c.good and c.kind == kind]
    assert len(found) >= good
    assert found.count("paper") >= paper


@pytest.mark.parametrize("case", CASES, ids=str)
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


@pytest.mark.slow
def test_tapes_pass_where_the_starts_are_known():
    """The attack works but for the secret of the installation."""
    case = next(case for case in CASES if case.name == "tapes_of_known_starts")
    report = verify(case.body, zoo_task(case.kind), profile="policy", seed=0)
    assert report.passed


FEW_CASES = sorted((c for c in CASES if c.name in ALWAYS), key=lambda case: case.good)


@pytest.mark.slow
@pytest.mark.parametrize("case", FEW_CASES, ids=str)
def test_a_few_on_the_best_tier(case, check):
    """What is tried in each run of the tests."""
    check(case, working_tiers()[0])


RUNS = [(case, tier) for case in CASES for tier in tiers_of(case)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "tier"), RUNS, ids=[f"{case}-{tier}" for case, tier in RUNS]
)
def test_the_zoo(case, tier, check):
    """Verdict, failing tests, messages and harm are as each header says."""
    check(case, tier)


OFFERS = offers.all_offers()
SURFACES = {"maps": 30, "worlds": 11, "projects": 17, "tasks": 30, "records": 10}
SURFACES |= {"policies": 40, "robots": 35}
AT_ONCE = [offer for offer in OFFERS if not offer.endless]
FEW = {"maps/pipe", "worlds/endless", "tasks/endless", "records/pipe", "policies/bomb"}
SECONDS = 60


def test_each_surface_has_its_attacks():
    """So many for each, no two of one name."""
    names = [str(offer) for offer in OFFERS]
    assert len(names) == len(set(names))
    for surface, least in SURFACES.items():
        assert sum(name.startswith(f"{surface}/") for name in names) >= least


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("offer", AT_ONCE, ids=str)
def test_a_hostile_file_is_refused_in_one_line(offer, tdac, tmp_path, alarm):
    """With exit code 2, or used without harm; no traceback, nothing is written."""
    if offer.needs:
        pytest.importorskip(offer.needs)
    here = tmp_path / "here"
    offer.make(here)
    alarm(SECONDS)  # ends a wait for what never comes
    before = sorted(here.rglob("*"))
    code, _, errors = tdac(*offer.words)
    assert offers.line_problems(offer, code, errors) == []
    assert sorted(here.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    "offer", [offer for offer in OFFERS if str(offer) in FEW], ids=str
)
def test_what_has_no_end_is_not_waited_for(offer):
    """A device, a pipe and a bomb: refused at once, in little memory."""
    assert offers.differences(offer, offers.take(offer)) == []


@pytest.mark.slow
@pytest.mark.parametrize("offer", OFFERS, ids=str)
def test_the_offers(offer):
    """As a process: exit code, line, time and memory are as expected, nothing left."""
    if offer.needs:
        pytest.importorskip(offer.needs)
    assert offers.differences(offer, offers.take(offer)) == []


def test_attacks_reach_for_files_that_exist():
    """An attack on a file that has moved would prove nothing."""
    package = Path(tdac_agent.__file__).parent
    files = Path(__file__).parent.glob("*/attacks/*.py")
    texts = [file.read_text("utf-8", "replace") for file in files]
    named = re.findall(r'@PACKAGE@/([\w./]+)"', "\n".join(texts))
    named += re.findall(r'"((?:verification|environments)/[\w./]+)"', "\n".join(texts))
    assert len(named) >= 4
    assert [name for name in named if not (package / name).exists()] == []
