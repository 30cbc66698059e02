"""Promises of `write_world`: a flat file that is read back to an equal world."""

import dataclasses
import re
import string

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from world_texts import ARENA, EPUCK, EVERYTHING, OLD, mutated, text

from tdac_envs import load_world, read_world, write_world
from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle
from tdac_envs.worlds.materials import Contact
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, Unmodelled, World

metres = st.floats(-50, 50, allow_nan=False)
sizes = st.floats(0.001, 5, allow_nan=False)
angles = st.floats(-7, 7, allow_nan=False)
names = st.text(st.sampled_from(string.printable + "é東\\\"'#{}[]"), max_size=12).map(
    lambda name: re.sub(r"[\r\x0b\x0c]", "", name)
)


def polygon(x, y, size, corners):
    """The hull of some points, or a triangle where that is a sliver."""
    points = [(x + size * u, y + size * v) for u, v in corners]
    try:
        shape = Polygon.around(points)
    except WorldError:
        shape = None
    if shape is not None and shape.area > 0.01 * size**2:
        return shape
    return Polygon.around([(x, y), (x + size, y), (x, y + size)])


unit = st.floats(-1, 1, allow_nan=False)
corners = st.lists(st.tuples(unit, unit), min_size=3, max_size=7)
shapes = st.one_of(
    st.builds(Disc, metres, metres, sizes),
    st.builds(Rectangle, metres, metres, angles, sizes, sizes),
    st.builds(polygon, metres, metres, st.floats(0.05, 5), corners),
)
parts = st.builds(
    lambda shape, bottom, height: Part(shape, bottom, bottom + height),
    shapes,
    metres,
    sizes,
)
materials = st.just("default") | names
pieces = st.lists(parts, max_size=2).map(tuple)
obstacles = st.builds(
    Obstacle,
    name=names,
    kind=st.sampled_from(["Solid", "WoodenBox", "Rock", "odd one"]),
    x=metres,
    y=metres,
    solid=pieces,
    visible=pieces,
    mass=st.none() | st.floats(0.001, 1e4),
    reflectance=st.floats(0.2, 1),
    material=materials,
).filter(lambda thing: "goal" not in thing.name.lower())
arenas = st.one_of(
    st.builds(
        Arena,
        st.builds(Disc, metres, metres, sizes),
        sizes,
        sizes,
        metres,
        st.integers(8, 200),
        material=materials,
    ),
    st.builds(
        Arena, st.builds(Rectangle, metres, metres, angles, sizes, sizes), sizes, sizes
    ),
    st.builds(Arena, st.builds(Rectangle, metres, metres, angles, sizes, sizes)),
)
robots = st.builds(
    EPuck, names, metres, metres, angles, metres, st.sampled_from(["1", "2"]), names,
    st.booleans(),
)  # fmt: skip
frictions = st.builds(
    Contact, materials, materials, st.floats(0, 1000, allow_nan=False)
)


@st.composite
def worlds(draw):
    things = draw(st.lists(obstacles, max_size=2))
    goal = draw(st.none() | st.tuples(metres, metres))
    if goal is not None and things and draw(st.booleans()):
        mark = dataclasses.replace(things[0], is_goal=True)
        things[0] = mark
        goal = (mark.x, mark.y) if draw(st.booleans()) else goal
    return World(
        robots=tuple(draw(st.lists(robots, max_size=2))),
        goal=goal,
        arenas=tuple(draw(st.lists(arenas, max_size=2))),
        obstacles=tuple(things),
        time_step=draw(st.floats(1, 100)),
        contacts=tuple(draw(st.lists(frictions, max_size=2))),
    )


def twin(thing):
    """An obstacle that is hit where it is seen, in its middle: the usual case."""
    shape = thing.solid[0].shape if thing.solid else Disc(thing.x, thing.y, 0.1)
    if not isinstance(shape, Polygon):
        shape = dataclasses.replace(shape, x=thing.x, y=thing.y)
    part = (Part(shape, 0.0, 0.1),)
    return dataclasses.replace(thing, solid=part, visible=part)


def comes_back(world, usual):
    """Writes a world, or one with nothing but usual obstacles, and reads it."""
    if usual:
        things = tuple(map(twin, world.obstacles))
        world = dataclasses.replace(world, obstacles=things)
    assert read_world(write_world(world)) == world


@settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck))
@given(world=worlds(), usual=st.booleans())
def test_a_world_is_read_back_as_it_was_written(world, usual):
    """Any world, to the last digit it keeps."""
    comes_back(world, usual)


@pytest.mark.slow
@settings(max_examples=1000, deadline=None, suppress_health_check=list(HealthCheck))
@given(world=worlds(), usual=st.booleans())
def test_a_thousand_worlds_are_read_back(world, usual):
    """As above, a thousand times."""
    comes_back(world, usual)


@pytest.mark.parametrize("source", [EVERYTHING, OLD, text(), text(ARENA, EPUCK)])
def test_what_was_read_is_written_and_read_again(source):
    """All but what is not modelled, which a comment names."""
    world = read_world(source)
    again = read_world(write_world(world))
    assert again == dataclasses.replace(world, unmodelled=())
    for node in world.unmodelled:
        assert f"# not modelled: {node.kind}" in write_world(world)


@pytest.mark.slow
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(rng=st.randoms(use_true_random=False))
def test_odd_worlds_are_written_too(rng):
    """What a broken file still says comes back as it was."""
    try:
        world = read_world(mutated(EVERYTHING, rng))
    except WorldError:
        return
    again = read_world(write_world(world))
    assert again == dataclasses.replace(world, unmodelled=())


def test_the_file_is_flat():
    """ENU, R2025a, one Solid for each obstacle, numbers without exponents."""
    content = write_world(read_world(EVERYTHING))
    assert content.startswith("#VRML_SIM R2025a utf8\n")
    assert "coordinateSystem" not in content
    assert not re.search(r"\d[eE][-+]?\d", re.sub(r'".*?"|#.*', "", content))
    top = re.findall(r"^(?:DEF GOAL )?([\w-]+) \{", content, re.MULTILINE)
    assert top.count("Solid") == len(read_world(EVERYTHING).obstacles)
    assert set(top) == {
        "WorldInfo", "Viewpoint", "TexturedBackground", "TexturedBackgroundLight",
        "RectangleArena", "Floor", "E-puck", "Solid",
    }  # fmt: skip
    assert not re.search(r"\b(USE|Transform)\b", content)


def test_every_proto_is_declared():
    """Webots R2025a loads no PROTO without."""
    content = write_world(read_world(text(ARENA, EPUCK)))
    declared = set(re.findall(r"(\S+)\.proto\"$", content, re.MULTILINE))
    declared = {url.rsplit("/", 1)[-1] for url in declared}
    assert declared == {
        "TexturedBackground", "TexturedBackgroundLight", "CircleArena", "E-puck",
    }  # fmt: skip
    assert content.index("EXTERNPROTO") < content.index("WorldInfo")


USUAL = """
Solid {
  translation 1 2 0.05
  rotation 0 0 1 0
  children [
    Shape {
      appearance Appearance { material Material { diffuseColor 0.1225 0.4 0.35 } }
      geometry Box { size 0.2 0.1 0.1 }
    }
  ]
  name ""
  model "WoodenBox"
  boundingObject Box { size 0.2 0.1 0.1 }
  physics Physics { density -1 mass 1 }
}
"""


def test_a_box_is_one_solid_with_a_box():
    """The usual obstacle is as short as a file can say it."""
    content = write_world(
        read_world(text("WoodenBox { translation 1 2 0.05 size 0.2 0.1 0.1 mass 1 }"))
    )
    solid = content[content.index("Solid {") :]
    assert " ".join(solid.split()) == " ".join(USUAL.split())


def test_the_goal_can_always_be_found():
    """As DEF GOAL: the marker, or a Pose where the goal was given."""
    marked = write_world(read_world(EVERYTHING))
    assert marked.count("DEF GOAL") == 1
    assert "DEF GOAL Solid {\n  translation 0.5 0.2 0.02" in marked
    given_ = write_world(read_world(text(EPUCK), goal=(0.25, -0.5)))
    assert "DEF GOAL Pose {\n  translation 0.25 -0.5 0\n}" in given_


def test_odd_names_do_no_harm(tmp_path):
    """Quotes, brackets and line ends in names, and in what is not modelled."""
    odd = 'a "b" \\ { # \n end'
    world = World(
        obstacles=(Obstacle(odd, "Solid", 0, 0),),
        robots=(EPuck(odd, 0, 0, 0),),
        unmodelled=(Unmodelled(odd, "Odd", 0, 0, "odd"),),
    )
    path = tmp_path / "odd.wbt"
    path.write_text(write_world(world))
    assert load_world(path) == dataclasses.replace(world, unmodelled=())
