"""PROTO files of a project replace their nodes."""

import pytest

from tdac_envs.worlds.wbt.protofiles import read_proto
from tdac_envs.worlds.wbt.reader import load_world

PROTO = """#VRML_SIM R2025a utf8
# A gate: two posts. The bracket ] in this comment means nothing.
PROTO Gate [
  field SFVec3f translation 0 0 0
  field SFFloat{0.1, 0.2} width 0.2  # "m"
  field SFString name "gate"
]
{
  Solid {
    translation IS translation
    name IS name
    children [
      Wall { translation 0 0.3 0 size 0.02 IS_NOT_A_FIELD 1 }
      Post { height IS width }
    ]
  }
}
"""
POST = """PROTO Post [ field SFFloat height 1 ]
{ Solid { name "post" boundingObject Cylinder { height IS height radius 0.05 } } }
"""


@pytest.fixture
def project(tmp_path):
    """A project with the PROTOs Gate and Post; gives a reader of worlds in it."""
    (tmp_path / "worlds").mkdir()
    (tmp_path / "protos").mkdir()
    gate = PROTO.replace("size 0.02 IS_NOT_A_FIELD 1", "size 0.02 0.1 0.1")
    (tmp_path / "protos" / "Gate.proto").write_text(gate)
    (tmp_path / "protos" / "Post.proto").write_text(POST)

    def read(content):
        file = tmp_path / "worlds" / "w.wbt"
        file.write_text(f"#VRML_SIM R2025a utf8\n{content}\n")
        return load_world(file)

    return read


def test_a_proto_is_what_it_consists_of(project):
    """Nested PROTOs, default values and values of the file."""
    world = project('Gate { translation 1 2 0 name "north" }')
    assert world.unmodelled == ()
    solid = [thing for thing in world.obstacles if thing.solid]
    assert [thing.kind for thing in solid] == ["Wall", "Solid"]
    wall, post = solid
    assert (wall.x, wall.y) == (1.0, 2.3)
    assert (post.name, post.x, post.y) == ("post", 1.0, 2.0)
    (part,) = post.solid
    assert part.top == pytest.approx(0.1)  # half the default width


def test_a_proto_that_is_not_in_the_project(project):
    """It is unknown, as before."""
    (missing,) = project("Castle { }").unmodelled
    assert missing.kind == "Castle"


@pytest.mark.parametrize("body", ["Solid { name %<= 1 >% }", "%{ local x }% Solid { }"])
def test_templates_are_not_run(body):
    """A PROTO with code stays unknown."""
    assert read_proto(f"PROTO A [ ] {{ {body} }}", "A", "R2025a") is None


def test_a_proto_that_contains_itself(project, tmp_path):
    """It ends, and is listed."""
    (tmp_path / "protos" / "Ring.proto").write_text("PROTO Ring [ ] { Ring { } }")
    (left,) = project("Ring { }").unmodelled
    assert left.kind == "Ring"
