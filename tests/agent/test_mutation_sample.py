"""A seeded sample of the mutation benchmark: no harmful mutant survives."""

import pytest

from benchmarks.ground import GROUNDS
from benchmarks.mutants import Mutant, choose, domain_mutants, normal
from benchmarks.mutation import Row, examine

SAMPLE = 12


@pytest.fixture(scope="module", params=GROUNDS)
def template(request):
    """The template's controller with neutral parameters, for each kind of task."""
    ground = GROUNDS[request.param]
    return ground.originals(ground.task())[0]


def test_mutants_are_many_and_differ(template):
    """Each parses and is another program than its original and all others."""
    mutants = choose([template], 150, 0, seed=1)
    programs = {normal(mutant.text) for mutant in mutants}
    assert len(programs) == len(mutants) == 150
    assert not programs & {None, normal(template.text)}
    assert len({mutant.mutation for mutant in mutants}) >= 50


def test_mutants_are_of_their_kind():
    """Each good controller is judged, and changed, as one for its kind of task."""
    for kind, ground in GROUNDS.items():
        originals = ground.originals(ground.task())
        assert {original.kind for original in originals} == {kind}
        assert {original.profile for original in originals} == {"paper", "policy"}


def test_a_mutant_names_its_line(template):
    """The line and what it became, as the table shows them."""
    candidates = domain_mutants(template)
    chosen = next(item for item in candidates if item.mutation == "swapped wheels")
    line, change = Mutant(chosen.mutation, template, chosen.make()).change()
    assert "return" in template.text.splitlines()[line - 1]
    assert change.startswith("return")


@pytest.mark.slow
@pytest.mark.parametrize("number", range(SAMPLE))
def test_no_harmful_mutant_survives(template, number):
    """What the independent judge calls harmful, the suite does not pass."""
    mutant = choose([template], SAMPLE, 0, seed=7)[number]
    row = Row(**examine(mutant))
    assert row.killed or not row.harmful, str(row)
