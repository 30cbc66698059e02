"""Variations of a controller without a model."""

import ast
import re
from dataclasses import asdict
from pathlib import Path

import pytest

import tdac_agent
from tdac_agent.builtin.provider import make_builtin
from tdac_agent.builtin.template import read_parameters
from tdac_agent.builtin.variation import varied, varied_parameters
from tdac_agent.environments.epuck.builtin import EPuckParameters
from tdac_agent.environments.map2d.builtin import MapParameters
from tdac_agent.models.choice import Options
from tdac_agent.models.provider import Request

LEVELS = sorted((Path(tdac_agent.__file__).parent / "builtin" / "levels").glob("*.py"))
SOURCE = """A, B = 3, 0.5  # two ä
C = 2.0
d = 7
E = True
F = "text"
G = -1.0
"""


@pytest.mark.parametrize("seed", range(20))
def test_one_or_two_constants_change_and_nothing_else(seed):
    changed, notes = varied(SOURCE, (seed,))
    assert 1 <= len(notes) <= 2
    lines = list(zip(SOURCE.splitlines(), changed.splitlines(), strict=True))
    assert all(old == new for old, new in lines[2:])
    for note in notes:
        name, before, after = re.fullmatch(r"(\w) (\S+) -> (\S+)", note).groups()
        assert name in "ABC"
        assert before != after
        assert type(ast.literal_eval(after)) is (int if name == "A" else float)
        assert ast.literal_eval(after) > 0
    assert "# two ä" in changed


def test_the_same_seed_gives_the_same_variation():
    assert varied(SOURCE, (1, 2, 0)) == varied(SOURCE, (1, 2, 0))
    assert len({varied(SOURCE, (0, k, 0)) for k in range(10)}) == 10


def test_a_controller_without_constants_stays_as_it_is():
    assert varied("def policy(obs):\n    return 0.0, 0.0\n", (0,)) == (
        "def policy(obs):\n    return 0.0, 0.0\n",
        (),
    )


@pytest.mark.parametrize("path", LEVELS, ids=lambda path: path.stem)
def test_each_level_can_be_varied(path):
    source = path.read_text()
    changed, notes = varied(source, (0, 1, 0))
    assert notes
    assert changed != source
    compile(changed, path.name, "exec")


@pytest.mark.parametrize("kind", [MapParameters, EPuckParameters])
def test_one_or_two_parameters_move_within_their_bounds(kind):
    """A value out of bounds would be refused; one at its bound moves inwards."""
    changed, before = set(), asdict(kind())
    for k in range(40):
        parameters, notes = varied_parameters(kind(), (0, k, 0))
        assert (parameters, notes) == varied_parameters(kind(), (0, k, 0))
        after = asdict(parameters)
        others = {name for name in before if before[name] != after[name]}
        assert 1 <= len(others) == len(notes) <= 2
        assert {note.split()[0].lower() for note in notes} == others
        changed |= others
    assert changed == set(before)


@pytest.mark.parametrize("template", [True, False])
def test_the_built_in_learner_improves_any_controller(small_task, template):
    """One from its template by its parameters, another one by its constants."""
    learner = make_builtin("", Options(small_task.setting))
    source = SOURCE
    if template:
        source = learner.template.render(MapParameters())
    answer = learner.complete(Request("improve", "?", source, sample=(0, 7, 0)))
    changed = answer.text.removeprefix("```python\n").removesuffix("```\n")
    assert changed != source
    assert answer.notes
    assert (read_parameters(changed, MapParameters) is not None) == template
