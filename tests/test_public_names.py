"""Names that users import stay where the docs say that they are."""

import json
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import gymnasium as gym
import pytest

import tdac_agent
import tdac_envs

ROOT = Path(__file__).parents[1]
MODULES = {
    "tdac_agent",
    "tdac_agent.bench",
    "tdac_agent.bench.bench",
    "tdac_agent.budget",
    "tdac_agent.html_report",
    "tdac_agent.metrics",
    "tdac_agent.plots",
    "tdac_agent.provider",
    "tdac_envs",
    "tdac_envs.epuck.env",
    "tdac_envs.ladder",
    "tdac_envs.map2d",
    "tdac_envs.sb3",
    "tdac_envs.wrappers",
}
OF_SB3 = {"tdac_agent.save_policy"}
"""Exports that need Stable-Baselines3."""
IMPORT = re.compile(
    r"from (tdac_(?:envs|agent)(?:\.\w+)*) import (\([^)]*\)|[^\n;#(]+)"
)
DOTTED = re.compile(r"(?:help\(|pydoc |python -m |`)(tdac_(?:envs|agent)(?:\.\w+)+)")


def documents():
    """Text of each document, and of the code and prose of each notebook."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        yield path.name, path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        yield path.name, "\n".join("".join(cell["source"]) for cell in cells)


def imported():
    """(document, module, name) of what documents import."""
    for document, text in documents():
        for module, names in IMPORT.findall(text):
            for name in re.findall(r"\w+", names.partition(" as ")[0]):
                yield document, module, name


def named():
    """(document, dotted name) of what documents name."""
    for document, text in documents():
        for name in DOTTED.findall(text):
            yield document, name


def found(dotted):
    """What a dotted name stands for; skips where an extra is not installed."""
    if dotted.startswith("tdac_envs.sb3") or dotted in OF_SB3:
        pytest.importorskip("stable_baselines3")
    parts = dotted.split(".")
    for k in range(len(parts), 0, -1):
        try:
            thing = import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            thing = getattr(thing, part)
        return thing
    raise ModuleNotFoundError(dotted)


@pytest.mark.parametrize(("document", "module", "name"), sorted(set(imported())))
def test_what_documents_import_is_there_and_public(document, module, name):
    """Whoever copies a line from the docs gets what it says."""
    assert module in MODULES
    found(f"{module}.{name}")


@pytest.mark.parametrize(("document", "name"), sorted(set(named())))
def test_what_documents_name_is_there(document, name):
    """Public or not: a name that has moved is corrected where it is explained."""
    found(name)


@pytest.mark.parametrize("module", sorted(MODULES))
def test_every_public_module_is_in_the_documents(module):
    """The list above has nothing that nobody is told of."""
    texts = "\n".join(text for _, text in documents())
    assert re.search(rf"\b{re.escape(module)}\b", texts)
    found(module)


@pytest.mark.parametrize("package", [tdac_agent, tdac_envs])
def test_every_export_is_there(package):
    without = set() if find_spec("stable_baselines3") else OF_SB3
    for name in package.__all__:
        if f"{package.__name__}.{name}" not in without:
            assert getattr(package, name) is not None


@pytest.mark.parametrize("name", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
def test_gymnasium_knows_both_environments(name):
    assert gym.spec(name).id == name
