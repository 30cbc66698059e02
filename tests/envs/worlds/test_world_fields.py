"""Fields that a node does not have are named, and not used."""

import re

import pytest
from world_texts import text

from tdac_envs import bundled_worlds, load_world
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.wbt import protos
from tdac_envs.worlds.wbt.arenas import ARENAS
from tdac_envs.worlds.wbt.known_fields import KNOWN
from tdac_envs.worlds.wbt.reader import read_world
from tdac_envs.worlds.wbt.unknown import MOST_NOTES

ODD = re.compile(r"field '\S+' of \S+ is not used")


def odd(world):
    """The notes of a world on fields."""
    return [note for note in world.notes if ODD.search(note)]


def test_a_field_that_a_proto_does_not_have_is_named_with_its_line():
    """The size remains Webots' own, so somebody who changes it has to know."""
    cone = 'TrafficCone {\n  translation 1 0 0\n  sise 0.12 naem "x" }'
    world = read_world(text(cone))
    (thing,) = world.obstacles
    assert max(part.top for part in thing.solid) == pytest.approx(0.51)
    first = text("").count("\n") + 1
    assert [note.split(":")[0] for note in odd(world)] == [f"line {first + 2}"] * 2
    assert "Webots' TrafficCone has no such field" in odd(world)[0]
    assert "(did you mean 'name'?)" in odd(world)[1]


@pytest.mark.parametrize(
    ("release", "top", "notes"), [("R2025a", 0.051, 0), ("R2022b", 0.51, 1)]
)
def test_traffic_cones_have_a_scale_since_r2023b(release, top, notes):
    """Before, Webots skipped it: the cone has its full size, and that is said."""
    content = text("TrafficCone { translation 1 0 0 scale 0.1 }")
    world = read_world(re.sub("R20[0-9]+[ab]", release, content, count=1))
    (thing,) = world.obstacles
    assert max(part.top for part in thing.solid) == pytest.approx(top)
    assert len(odd(world)) == notes


@pytest.mark.parametrize(
    "content",
    [
        "Solid { boundingBox NULL }",
        "Solid { boundingObject Box { sise 1 1 1 } }",
        "Solid { children [ Shape { geometry Cylinder { diameter 1 } } ] }",
        "Solid { physics Physics { wheight 3 } }",
        "Robot { children [ GPS { precision 1 } ] }",
        "RectangleArena { size 1 1 }",
        "E-puck { gpsSlot [ GPS { } ] }",
        "E-puck { turretSlot [ Lidar { range 3 } ] }",
        "PointLight { position 0 0 1 }",
        "WorldInfo { timeStep 16 }",
    ],
)
def test_fields_of_any_depth_are_checked(content):
    """Of nodes and PROTOs, of devices, lights and the world."""
    assert len(odd(read_world(text(content)))) == 1


@pytest.mark.parametrize(
    "content",
    [
        "Solid { hidden linearVelocity_0 1 2 3 }",
        "Dragon { size 3 }",
        "Wall { appearance OwnPaint { shine 3 } }",
        "WoodenBox { locked TRUE recognitionColors [ 1 0 0 ] immersionProperties [ ] }",
        'RectangleArena { floorTextureUrl [ "x.png" ] wallColor 1 0 0 }',
        "Transform { scale 2 2 2 children [ Solid { } ] }",
    ],
)
def test_no_false_alarm(content):
    """Old and hidden fields are known; unknown nodes are listed, not their fields."""
    assert odd(read_world(text(content))) == []


@pytest.mark.parametrize("kind", ["Solid", "Robot", "Pose"])
def test_scale_went_with_r2023b(kind):
    """Solids had a `scale` until then; today only Transform has it, as in Webots."""
    box = "children [ Solid { boundingObject Box { size 0.1 0.1 0.1 } } ]"
    if kind == "Solid":
        box = "boundingObject Box { size 0.1 0.1 0.1 }"
    content = f"{kind} {{ scale 2 2 2 {box} }}"
    new = read_world(text(content))
    assert len(odd(new)) == 1
    assert all(thing.solid[0].top == 0.05 for thing in new.obstacles)
    old = read_world(text(content, version="R2023a"))
    assert len(odd(old)) == (kind == "Pose")
    if kind == "Solid":
        assert old.obstacles[0].solid[0].top == 0.1


def test_the_fields_of_the_projects_own_protos_are_known(tmp_path):
    """They are those of the PROTO's file."""
    (tmp_path / "Brick.proto").write_text(
        "PROTO Brick [ field SFVec3f size 1 1 1 ] { Solid { boundingObject Box "
        "{ size IS size } } }"
    )
    file = tmp_path / "w.wbt"
    file.write_text(text("Brick { size 1 2 3 height 3 }"))
    (note,) = odd(load_world(file))
    assert "field 'height' of Brick is not used; the project's Brick" in note


def test_many_unknown_fields_are_few_notes():
    """One note for a field of a type; no flood, however many there are."""
    assert len(odd(read_world(text("Wall { x 1 }\n" * 99)))) == 1
    many = "Wall { " + " ".join(f"x{k} 1" for k in range(99)) + " }"
    notes = read_world(text(many)).notes
    assert len(notes) == MOST_NOTES + 1
    assert notes[-1] == f"{99 - MOST_NOTES} further fields are not used, either"


def test_every_node_that_the_reader_models_is_checked():
    """Also those that are added later."""
    assert set(protos.PROTOS) | ARENAS <= set(KNOWN)


@pytest.mark.parametrize("name", bundled_worlds())
def test_bundled_worlds_have_only_known_fields(name):
    """They are correct."""
    assert odd(load_world(world_file(name))) == []


def test_public_worlds_have_only_known_fields(real_data):
    """But for the slots of an e-puck that its author made."""
    found = {
        (path.name[:2], note)
        for path in sorted((real_data / "worlds").glob("*.wbt"))
        for note in odd(load_world(path))
    }
    assert {(name, ODD.search(note)[0]) for name, note in found} == {
        ("39", f"field 'extensionSlot{k}' of E-puck is not used") for k in (1, 2)
    }
