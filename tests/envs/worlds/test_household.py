"""Small PROTOs: balls, drinks, jars, animals."""

import pytest
from world_texts import text

from tdac_envs.worlds.wbt.household import HOUSEHOLD
from tdac_envs.worlds.wbt.reader import read_world


@pytest.mark.parametrize("kind", sorted(HOUSEHOLD))
@pytest.mark.parametrize("version", ["R2025a", "R2021b"])
def test_each_type_is_solid_and_stands(kind, version):
    """Where it is put; it is visible where it is solid, and not below the floor."""
    content = text(f"{kind} {{ translation 1 2 0.2 }}").replace("R2025a", version)
    world = read_world(content, "w.wbt")
    assert world.unmodelled == ()
    (thing,) = world.obstacles
    assert thing.kind == kind
    assert thing.solid == thing.visible != ()
    assert min(part.bottom for part in thing.solid) > -0.2


@pytest.mark.parametrize(
    ("node", "height", "mass"),
    [
        ("Ball { translation 0 0 0.05 radius 0.05 }", 0.1, 0.055),
        ("Can { mass 0 }", 0.1211, None),
        ("MazeBlock { length 0.2 }", 0.065, 0.039),
        ("CerealBox { size 0.2 0.1 0.3 mass 2 }", 0.3, 2.0),
    ],
)
def test_sizes_and_masses(node, height, mass):
    """As the file gives them."""
    (thing,) = read_world(text(node), "w.wbt").obstacles
    assert max(part.top for part in thing.solid) == pytest.approx(height)
    assert thing.mass == (None if mass is None else pytest.approx(mass))
