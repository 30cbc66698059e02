"""A seeded sample of the mutation benchmark: no harmful mutant survives."""

import pytest

from benchmarks.ground import good_controllers, small_task
from benchmarks.mutants import choose, domain_mutants, normal
from benchmarks.mutation import Row, examine

SAMPLE = 12


@pytest.fixture(scope="module")
def template():
    """The template's controller with neutral parameters."""
    return good_controllers(small_task())[0]


def test_mutants_are_many_and_differ(template):
    """Each parses and is another program than its original and all others."""
    mutants = choose([template], 150, 0, seed=1)
    programs = {normal(mutant.text) for mutant in mutants}
    assert len(programs) == len(mutants) == 150
    assert not programs & {None, normal(template.text)}
    assert len({mutant.mutation for mutant in mutants}) >= 50


def test_a_mutant_names_its_line(template):
    """The line and what it became, as the table shows them."""
    candidates = domain_mutants(template)
    chosen = next(item for item in candidates if item.mutation == "swapped wheels")
    mutant = choose([template], 400, 0, seed=1)
    (found,) = [m for m in mutant if m.text == chosen.make()]
    line, change = found.change()
    assert "return" in template.text.splitlines()[line - 1]
    assert change.startswith("return")


@pytest.mark.slow
@pytest.mark.parametrize("number", range(SAMPLE))
def test_no_harmful_mutant_survives(template, number):
    """What the independent judge calls harmful, the suite does not pass."""
    mutant = choose([template], SAMPLE, 0, seed=7)[number]
    row = Row(**examine(mutant))
    assert row.killed or not row.harmful, str(row)
