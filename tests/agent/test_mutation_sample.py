"""A seeded sample of the mutation benchmark: no harmful mutant survives."""

import random
from dataclasses import replace

import pytest

from benchmarks.drawn_worlds import Drawn, points_in, room_at
from benchmarks.ground import GROUNDS
from benchmarks.mutants import Mutant, choose, domain_mutants, normal
from benchmarks.mutation import Row, examine
from tdac_agent.environments.epuck.oracle import gap_to, prisms_of
from tdac_envs import read_world
from tdac_envs.worlds.bodies import bodies

SAMPLE = 12


@pytest.fixture(scope="module", params=GROUNDS)
def template(request):
    """The template's controller with neutral parameters, for each kind of task."""
    ground = GROUNDS[request.param]
    return ground.originals(ground.task())[0]


@pytest.mark.slow
@pytest.mark.parametrize(("count", "kinds"), [(40, 30), (150, 50)])
def test_mutants_are_many_and_differ(template, count, kinds):
    """Each parses and is another program than its original and all others."""
    mutants = choose([template], count, 0, seed=1)
    programs = {normal(mutant.text) for mutant in mutants}
    assert len(programs) == len(mutants) == count
    assert not programs & {None, normal(template.text)}
    assert len({mutant.mutation for mutant in mutants}) >= kinds


def test_mutants_are_of_their_kind():
    """Each good controller is judged, and changed, as one for its kind of task."""
    for kind, ground in GROUNDS.items():
        originals = ground.originals(ground.task())
        assert {original.kind for original in originals} == {kind}
        assert {original.profile for original in originals} == {"paper", "policy"}


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("seed", range(6))
def test_drawn_worlds_are_what_their_files_say(seed):
    """Our reader finds them, and our distances agree with the sampled outlines."""
    draw = random.Random(seed)
    drawn = Drawn.at_random(draw)
    world = read_world(drawn.text)
    assert world.robot.pose == pytest.approx(drawn.start)
    assert world.goal == pytest.approx(drawn.goal)
    solid = prisms_of(part for thing in bodies(world) for part in thing.solid)
    points = [(x, y, room_at(drawn, x, y)) for x, y in points_in(drawn, draw)]
    assert min(room for *_, room in points) < 0.0 < max(room for *_, room in points)
    # Sampled outlines are a little farther than they are; round walls have facets.
    for x, y, room in points:
        if room > 0.0:
            assert gap_to(solid, x, y) == pytest.approx(room, abs=4e-3)
        elif room < -4e-3 and _is_on(drawn, x, y):
            assert gap_to(solid, x, y) < 0.0


def _is_on(drawn, x, y):
    """Whether a point is on the floor."""
    return room_at(replace(drawn, solids=()), x, y) > 0.0


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
