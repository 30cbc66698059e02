"""Promises of `load_world`: what nodes become, in any version and coordinate system."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from world_texts import ARENA, EPUCK, EVERYTHING, OLD, text

from tdac_envs import load_world
from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.bodies import at_body_height, bodies, floor_under
from tdac_envs.worlds.footprint import Disc, Rectangle
from tdac_envs.worlds.materials import (
    INFINITE_FRICTION,
    Contact,
    friction_between,
)
from tdac_envs.worlds.wbt.frames import Y_UP_TO_Z_UP
from tdac_envs.worlds.wbt.reader import read_world
from tdac_envs.worlds.world import World, check_modelled


def one(content, **more):
    """The one obstacle of a world with one node."""
    (obstacle,) = read_world(text(content, **more)).obstacles
    return obstacle


def rectangle(x, y, length, width, yaw=0.0):
    """Equal to a Rectangle within rounding."""
    shape = Rectangle(x, y, yaw, length, width)
    keys = ("x", "y", "yaw", "length", "width")
    return pytest.approx([getattr(shape, key) for key in keys], abs=2e-9)


def measures(shape):
    return [getattr(shape, key) for key in ("x", "y", "yaw", "length", "width")]


BOXES = {
    "WoodenBox { }": ((0, 0, 0.6, 0.6), (0.0, 0.6)),
    "WoodenBox { size 0.001 0.2 5 }": ((0, 0, 0.2, 0.01), (-1.2, 1.8)),
    "WoodenBox { translation 1 2 0.05 size 0.3 0.2 0.1 }": ((1, 2, 0.3, 0.2), (0, 0.1)),
    "CardboardBox { size 0.1 0.2 0.3 }": ((0, 0, 0.2, 0.1), (0.15, 0.45)),
    "CardboardBox { size 2 2 2 }": ((0, 0, 0.6, 0.6), (0, 0.6)),
    "CardboardBox { size 0.001 0.01 0.01 }": ((0, 0, 0.6, 0.6), (0, 0.6)),
    "CardboardBox { size 0.005 2.6 2.6 }": ((0, 0, 2.5, 0.01), (-0.95, 1.55)),
    "PlasticCrate { }": ((0, 0, 0.6, 0.6), (0, 0.6)),
    "PlasticCrate { size 0.3 0.2 0.1 }": ((0, 0, 0.3, 0.2), (0, 0.1)),
    "WoodenPallet { translation 0 0 0.1 }": ((0, 0, 1.2, 0.8), (0.1, 0.24)),
    "SolidBox { }": ((0, 0, 2, 2), (0, 2)),
    "SolidBox { translation 0 0 0.1 size 0.4 0.2 0.2 }": ((0, 0, 0.4, 0.2), (0, 0.2)),
    "Wall { }": ((0, 0, 1, 0.2), (0, 2.4)),
    "Wall { translation 1 1 0.5 size 0.01 0.3 0.1 }": ((1, 1, 0.3, 0.01), (0.5, 0.6)),
    "Wall { size 0 1 1 }": ((0, 0, 1, 0.2), (0, 2.4)),
    "Solid { boundingObject Box { } }": ((0, 0, 2, 2), (-1, 1)),
    "Solid { boundingObject Box { size 1 -1 1 } }": ((0, 0, 1, 1), (-0.5, 0.5)),
}


@pytest.mark.parametrize("content", BOXES)
def test_boxes_and_their_defaults(content):
    """Size, clamps and origin of each PROTO; sensors see what is solid."""
    measured, heights = BOXES[content]
    obstacle = one(content)
    (part,) = obstacle.solid
    x, y, length, width = measured
    turned = length == 1 and width == 0.2  # a Wall is as wide as it is y long
    assert {round(v, 9) for v in (part.shape.length, part.shape.width)} == {
        length,
        width,
    }
    assert (part.shape.x, part.shape.y) == (x, y)
    assert (part.bottom, part.top) == pytest.approx(heights)
    assert obstacle.mass is None
    assert not turned or abs(part.shape.yaw) == pytest.approx(math.pi / 2)
    assert obstacle.visible in ((part,), ())


DISCS = {
    "OilBarrel { }": (0.305, (0, 0.88)),
    "OilBarrel { translation 0 0 0.1 height 0.2 radius 0.05 }": (0.05, (0, 0.2)),
    "Solid { boundingObject Cylinder { } }": (1, (-1, 1)),
    "Solid { boundingObject Cylinder { height 0.2 radius 0.1 } }": (0.1, (-0.1, 0.1)),
    "Solid { boundingObject Sphere { } }": (1, (-1, 1)),
    "Solid { boundingObject Sphere { radius -1 } }": (1, (-1, 1)),
    "Solid { boundingObject Capsule { height 0.2 radius 0.1 } }": (0.1, (-0.2, 0.2)),
}


@pytest.mark.parametrize("content", DISCS)
def test_discs_and_their_defaults(content):
    """Upright, they are exact discs."""
    radius, heights = DISCS[content]
    (part,) = one(content).solid
    assert part.shape == Disc(0, 0, radius)
    assert (part.bottom, part.top) == pytest.approx(heights)


def test_rocks_have_their_true_hull():
    """Ten corners, area and reach of the mesh, by scale and turn."""
    rock = one("Rock { translation 1 2 0 rotation 0 0 1 0.7 scale 3 }")
    (part,) = rock.solid
    reach = np.hypot(*(part.shape.vertices - (1, 2)).T).max()
    assert len(part.shape.points) == 10
    assert reach == pytest.approx(3 * 0.0836, rel=2e-3)
    assert part.shape.area == pytest.approx(9 * 0.01108, rel=2e-3)
    assert (part.bottom, part.top) == pytest.approx((3 * -0.056, 3 * 0.049))
    (flat,) = one('Rock { type "flat" }').solid
    assert len(flat.shape.points) == 9
    assert math.sqrt(flat.shape.area / math.pi) == pytest.approx(0.156, abs=5e-4)
    assert flat.shape.bounds == pytest.approx((-0.174, -0.128, 0.22, 0.13), abs=1e-3)


@pytest.mark.slow
def test_a_pipe_is_a_ring():
    """What is inside the inner radius is free, what is between both is not."""
    pipe = one(
        "SolidPipe { translation 0.5 0 0.1 height 0.2 radius 0.3 thickness 0.05 }"
    )
    for x, y in np.random.default_rng(0).uniform(-0.4, 0.4, (3000, 2)):
        away = math.hypot(x, y)
        inside = any(part.shape.contains(x + 0.5, y) for part in pipe.solid)
        if abs(away - 0.25) > 1e-3 and abs(away - 0.3) > 1e-3:
            assert inside == (0.25 < away < 0.3)
    area = sum(part.shape.area for part in pipe.solid)
    assert area == pytest.approx(math.pi * (0.3**2 - 0.25**2), rel=0.01)
    assert {(part.bottom, part.top) for part in pipe.solid} == {(0.0, 0.2)}


def test_a_lying_pipe_can_be_driven_through():
    """Only its two sides stand at the height of a robot's body."""
    pipe = one(
        "SolidPipe { translation 0 0 0 rotation 0 1 0 1.5707963 "
        "height 1 radius 0.2 thickness 0.01 }"
    )
    left, low, right, high = np.array([p.shape.bounds for p in pipe.solid]).T
    assert (left.min(), right.max()) == pytest.approx((-0.5, 0.5), abs=1e-6)
    assert (low.min(), high.max()) == pytest.approx((-0.2, 0.2), abs=1e-3)
    near = at_body_height(pipe.solid, 0.0)
    assert near
    sides = [part.shape.bounds for part in near]
    assert all(low > 0.17 or high < -0.17 for _, low, _, high in sides)


def test_a_cone_has_a_foot():
    """A square of 0.5 m up to 22.5 mm, round above."""
    cone = one("TrafficCone { translation 1 1 0 }")
    foot, *body = cone.solid
    assert measures(foot.shape)[3:] == [0.5, 0.5]
    assert (foot.bottom, foot.top) == pytest.approx((0, 0.0225))
    assert max(part.shape.radius for part in body) == pytest.approx(0.157)
    assert foot in at_body_height(cone.solid, 0.0)


MASSES = {
    "WoodenBox { size 0.1 0.1 0.1 mass 0.5 }": 0.5,
    "WoodenBox { size 0.1 0.1 0.1 mass 0.001 }": 0.01,
    "WoodenBox { size 0.1 0.1 0.1 mass 99 }": 10,
    "WoodenBox { size 0.1 0.1 0.1 mass -1 }": None,
    "CardboardBox { size 0.1 0.1 0.1 mass 99 }": 1,
    "PlasticCrate { mass 2 }": 2,
    "SolidBox { size 1 1 1 }": None,
    "SolidBox { size 1 1 1 physics Physics { density 200 } }": 200,
    "Solid { boundingObject Box { size 1 1 1 } }": None,
    "Solid { boundingObject Box { size 1 1 1 } physics Physics { } }": 1000,
    "Solid { boundingObject Box { } physics Physics { density -1 mass 3 } }": 3,
    "Solid { boundingObject Sphere { radius 0.1 } physics Physics { density 1 } }": (
        4 / 3 * math.pi * 1e-3
    ),
    "Solid { boundingObject Cylinder { radius 0.1 height 2 } physics Physics { } }": (
        20 * math.pi
    ),
    "Solid { boundingObject Capsule { radius 0.1 height 1 } physics Physics { } }": (
        1000 * math.pi * 0.01 * (1 + 0.4 / 3)
    ),
    "Transform { scale 2 2 2 children Solid { boundingObject Box { size 1 1 1 } "
    "physics Physics { density 1 } } }": 8,
    "Solid { physics Physics { } }": 1,
}


@pytest.mark.parametrize("content", MASSES)
def test_masses(content):
    """By mass or density, within what the PROTO allows; without, it is fixed."""
    mass = MASSES[content]
    found = one(content).mass
    assert found is None if mass is None else found == pytest.approx(mass)


LOOK = "Solid {{ children Shape {{ {} geometry Box {{ size 1 1 1 }} }} }}"
LOOKS = {
    "": 1.0,
    "appearance Appearance { }": 1.0,
    "appearance Appearance { material Material { } }": 0.2 + 0.8 * 0.8,
    "appearance Appearance { material Material { diffuseColor 1 0 0 } }": 1.0,
    "appearance Appearance { material Material { diffuseColor 0 1 1 } }": 0.2,
    "appearance Appearance { material Material { diffuseColor 1 0 0 "
    "transparency 0.5 } }": 0.6,
    "appearance Appearance { material Material { diffuseColor 0 0 0 } "
    "texture ImageTexture { } }": 1.0,
    "appearance PBRAppearance { }": 1.0,
    "appearance PBRAppearance { baseColor 0.5 0 0 roughness 1 metalness 0 }": 0.4,
    "appearance PBRAppearance { baseColor 0 0 0 baseColorMap ImageTexture { } }": 1.0,
    "appearance Roughcast { colorOverride 0 0 0 }": 1.0,
}


@pytest.mark.parametrize("appearance", LOOKS)
def test_reflectance(appearance):
    """By Webots' formula where the file alone decides it, else 1."""
    assert one(LOOK.format(appearance)).reflectance == pytest.approx(LOOKS[appearance])
    assert one("WoodenBox { }").reflectance == pytest.approx(0.3, abs=0.01)


def test_what_is_seen_is_not_what_is_hit():
    """Shapes are visible, boundingObjects solid; either may be missing."""
    marker = one("Solid { children Shape { geometry Sphere { radius 0.1 } } }")
    assert (marker.solid, len(marker.visible)) == ((), 1)
    ghost = one("Solid { boundingObject Sphere { radius 0.1 } }")
    assert (len(ghost.solid), ghost.visible) == (1, ())
    both = one(
        "Solid { children [ DEF S Shape { geometry Box { size 1 1 1 } } "
        "Pose { translation 2 0 0 children USE S } ] boundingObject USE S }"
    )
    assert [part.shape.x for part in both.solid] == [0]
    assert [part.shape.x for part in both.visible] == [0, 2]
    pallet = one("WoodenPallet { boundingObject FALSE }")
    assert (pallet.solid, len(pallet.visible)) == ((), 1)
    box = one("SolidBox { enableBoundingObject FALSE }")
    assert (box.solid, len(box.visible)) == ((), 1)
    shape = one("Shape { geometry Box { size 1 1 1 } }")
    assert (shape.kind, shape.solid, len(shape.visible)) == ("Shape", (), 1)


def test_what_bounds_a_mesh_is_seen_in_its_place():
    """A Mesh cannot be drawn; sensors see the boundingObject, and a note says so."""
    world = read_world(
        text('Solid { name "pot" children Shape { geometry Mesh { url "pot.obj" } } '
             "boundingObject Cylinder { radius 0.1 height 0.2 } }")
    )  # fmt: skip
    (pot,) = world.obstacles
    assert pot.visible == pot.solid
    assert world.notes == (
        "line 3: pot: Mesh is not modelled; sensors see its boundingObject",
    )


def test_nesting():
    """Groups, Transforms, Poses, Solids and joints carry what is in them."""
    world = read_world(
        text(
            "Group { children Transform { translation 1 0 0",
            "  rotation 0 0 1 1.5707963267949 scale 2 1 1 children [",
            '  Solid { name "outer" translation 1 0 0',
            "    boundingObject Box { size 1 1 1 } children [",
            '      Solid { name "inner" translation 0 2 0 boundingObject Pose {',
            "        translation 0 0 1 children Box { size 0.5 0.5 0.5 } } }",
            '      HingeJoint { endPoint Solid { name "door" translation 1 0 0',
            "        boundingObject Sphere { radius 0.1 } } }",
            "    ] }",
            "] } }",
        )
    )
    outer, inner, door = world.obstacles
    # The Transform stretches its x axis, which points along y in the world.
    assert measures(outer.solid[0].shape) == rectangle(1, 2, 2, 1, math.pi / 2)
    assert measures(inner.solid[0].shape) == rectangle(-1, 2, 1, 0.5, math.pi / 2)
    assert (inner.solid[0].bottom, inner.solid[0].top) == (0.75, 1.25)
    assert (door.x, door.y) == (1, 4)
    assert "door: modelled as fixed, although on a HingeJoint" in world.notes


def test_definitions_may_change_their_meaning():
    """Each USE is the latest DEF above it."""
    body = "DEF W Shape {{ geometry Box {{ size {} 1 1 }} }}"
    solid = "Solid {{ children [ {} ] boundingObject USE W }}"
    world = read_world(
        text(*[solid.format(body.format(length)) for length in (1, 2, 3)])
    )
    assert [o.solid[0].shape.length for o in world.obstacles] == [1, 2, 3]


@pytest.mark.parametrize(
    ("content", "inside", "wall"),
    [
        ("CircleArena { }", Disc(0, 0, 1), (0.01, 0.1)),
        ("CircleArena { radius 0.5 wallThickness 0.1 }", Disc(0, 0, 0.5), (0.1, 0.1)),
        ("RectangleArena { }", Rectangle(0, 0, 0, 1, 1), (0.01, 0.1)),
        (
            "RectangleArena { translation 1 2 0 rotation 0 0 -1 0.5 floorSize 3 2 }",
            Rectangle(1, 2, -0.5, 3, 2),
            (0.01, 0.1),
        ),
        ("RectangleArena { wallHeight 0 }", Rectangle(0, 0, 0, 1, 1), (0.01, 0.1)),
        ("Floor { size 3 4 }", Rectangle(0, 0, 0, 3, 4), (0.0, 0.0)),
        ("Floor { }", Rectangle(0, 0, 0, 10, 10), (0.0, 0.0)),
    ],
)
def test_arenas(content, inside, wall):
    """The floor inside, and the wall around it."""
    world = read_world(text(content))
    (arena,) = world.arenas
    assert arena.inside == inside
    assert (arena.wall_thickness, arena.wall_height) == wall
    assert arena.kind == content.split()[0]
    assert world.arena == (arena if wall[0] else None)
    assert world.obstacles == ()


def test_an_arena_that_is_not_level_is_not_modelled():
    world = read_world(text("RectangleArena { rotation 1 0 0 1.57 }"))
    assert world.arenas == ()
    assert world.unmodelled[0].why == "it is not level"


def test_the_robots_arena_is_the_one_around_it():
    """Of several arenas."""
    world = read_world(
        text("CircleArena { }", "CircleArena { translation 3 0 0 }",
             "E-puck { translation 3.1 0 0 }")
    )  # fmt: skip
    assert world.arena.inside.x == 3


@pytest.mark.parametrize("version", ["1", "2"])
def test_an_epuck(version):
    """Pose, version, wheel limit, mass with wheels, axle and controller."""
    world = read_world(
        text(
            'E-puck { translation 0.1 -0.2 0.003 rotation 0 0 -1 1 name "rob" '
            f'version "{version}" controller "c" }}'
        )
    )
    robot = world.robot
    assert robot.pose == pytest.approx((0.1, -0.2, -1.0))
    assert (robot.name, robot.version, robot.controller) == ("rob", version, "c")
    assert robot.max_wheel_speed == {"1": 6.28, "2": 7.536}[version]
    assert robot.mass == pytest.approx({"1": 0.15, "2": 0.13}[version] + 2 * 0.005)
    assert robot.axle_length == pytest.approx(0.052 + 0.005)


def test_a_kinematic_epuck_has_the_axle_of_its_joints():
    """Webots then moves it without physics; a Robot node has no such field."""
    assert read_world(text("E-puck { kinematic TRUE }")).robot.axle_length == 0.052
    node = 'Robot { model "GCtronic e-puck" kinematic TRUE }'
    assert read_world(text(node)).robot.axle_length == 0.057


@pytest.mark.parametrize(
    "rotation",
    ["0 0 1 2", "0 0 -1 -2", "0 0 3 2", "0 0 1 8.283185307", "0 0 -1 4.283185307"],
)
def test_a_heading_has_many_forms(rotation):
    """Sign and length of the axis, and turns of any number."""
    world = read_world(text(f"E-puck {{ rotation {rotation} }}"))
    assert world.robot.heading == pytest.approx(2.0, abs=1e-8)


def test_the_first_robot_is_driven_unless_another_is_named():
    """The others stand in its way."""
    content = text('E-puck { name "a" }', 'E-puck { name "b" translation 1 0 0 }')
    world = read_world(content)
    assert [robot.name for robot in world.robots] == ["a", "b"]
    (standing,) = bodies(world)
    assert standing.solid[0].shape == Disc(1, 0, 0.037)
    assert "'a' is driven; 'b' stand still" in world.notes
    assert read_world(content, robot="b").robot.name == "b"
    with pytest.raises(WorldError, match="no e-puck named 'c'; there are 'a', 'b'"):
        read_world(content, robot="c")


WRITTEN_OUT = """Robot {{
  translation 0.1 0.2 0
  rotation {rotation}
  children [
    HingeJoint {{ device RotationalMotor {{ name "left wheel motor" }} }}
    {sensors}
  ]
  name "mine"
  boundingObject Cylinder {{ radius 0.037 height 0.045 }}
}}"""


@pytest.mark.parametrize(
    ("version", "front", "rotation", "heading"),
    [
        ("R2022a", ("0.03 -0.01 0.033", "0.03 0.01 0.033"), "0 0 1 0.5", 0.5),
        ("R2021b", ("0.01 0.033 -0.03", "-0.01 0.033 -0.03"), "0 1 0 0.5", 0.5),
        # Written out by an old version, upgraded by hand.
        ("R2023b", ("0.01 0.033 -0.03", "-0.01 0.033 -0.03"), "0 1 0 0.5", 0.5),
    ],
)
def test_an_epuck_that_is_written_out(version, front, rotation, heading):
    """A Robot with ps0 to ps7; it drives to where ps0 and ps7 are."""
    places = dict.fromkeys(range(8), "0 0 0") | {0: front[0], 7: front[1]}
    sensors = "\n".join(
        f'DistanceSensor {{ translation {place} name "ps{k}" }}'
        for k, place in places.items()
    )
    info = 'coordinateSystem "NUE"' if version != "R2022a" else ""
    node = WRITTEN_OUT.format(rotation=rotation, sensors=sensors)
    world = read_world(text(node, version=version, info=info))
    assert world.robot.name == "mine"
    assert world.robot.heading == pytest.approx(heading)
    assert world.unmodelled == ()


@pytest.mark.parametrize("kind", ["E-puck", "EPuck"])
def test_names_of_the_epuck(kind):
    """EPuck up to Webots 7."""
    assert len(read_world(text(f"{kind} {{ }}", version="V6.0")).robots) == 1


@pytest.mark.parametrize(
    "content",
    [
        "DEF GOAL Solid { translation 0.5 0.2 0 }",
        'Solid { translation 0.5 0.2 0 name "GOAL" }',
        'Solid { translation 0.5 0.2 0 name "goal" }',
        "Group { children Pose { translation 0.5 0 0 children DEF GOAL Solid { "
        "translation 0 0.2 0 } } }",
        "DEF GOAL Transform { translation 0.5 0.2 0 children Shape { "
        "geometry Sphere { } } }",
    ],
)
def test_the_goal(content):
    """A node that is named or defined GOAL."""
    world = read_world(text(content))
    assert world.goal == (0.5, 0.2)
    assert all(thing.is_goal for thing in world.obstacles)


def test_the_goal_can_be_given():
    """What was marked as the goal is then an ordinary thing."""
    content = text("DEF GOAL Solid { translation 0.5 0.2 0 }")
    world = read_world(content, goal=(0.1, 0.3))
    assert world.goal == (0.1, 0.3)
    assert not any(thing.is_goal for thing in world.obstacles)
    assert read_world(text(), goal=(1, 2)).goal == (1, 2)
    assert read_world(text()).goal is None


def test_frictions_are_those_of_pairs_of_materials():
    """The first of a pair, in either order; 1 if the file does not list it."""
    world = read_world(
        text(
            'Floor { contactMaterial "ice" }',
            'Solid { contactMaterial "wax" boundingObject Box { } }',
            "WoodenBox { }",
            info="""contactProperties [
              ContactProperties { material1 "wax" material2 "ice" coulombFriction 0.1 }
              ContactProperties { material1 "ice" material2 "wax" coulombFriction 0.2 }
              ContactProperties { material2 "ice" coulombFriction [ 0.3, 0.5 ] }
              ContactProperties { material1 "wax" coulombFriction -1 }
              ContactProperties { material1 "wax" material2 "wax" }
            ]""",
        )
    )
    assert [thing.material for thing in world.obstacles] == ["wax", "default"]
    assert world.arenas[0].material == "ice"
    pairs = {
        ("ice", "wax"): 0.1,
        ("default", "ice"): 0.3,
        ("default", "wax"): INFINITE_FRICTION,
        ("wax", "wax"): 1.0,
        ("default", "default"): 1.0,
        ("ice", "ice"): 1.0,
    }
    for (one, other), friction in pairs.items():
        assert friction_between(world.contacts, one, other) == friction
        assert friction_between(world.contacts, other, one) == friction


@pytest.mark.parametrize("friction", [-0.1, 1001.0, math.nan])
def test_a_contact_has_a_possible_friction(friction):
    """From 0 to the coefficient for infinite friction."""
    with pytest.raises(WorldError, match="expected a friction from 0 to 1000, got"):
        Contact(friction=friction)


def test_the_time_step():
    """32 ms, unless the file says otherwise."""
    assert read_world(text()).time_step == 32
    assert read_world(text(info="basicTimeStep 16")).time_step == 16
    world = read_world(text(info="basicTimeStep 0"))
    assert world.time_step == 32
    assert world.notes == ("basicTimeStep 0 is replaced by 32, as in Webots",)


def test_nothing_is_silently_dropped():
    """Unknown nodes, other robots and unknown bounds are listed with place and line."""
    world = read_world(
        text(
            'LegoTallWall { translation 1 2 0 name "LEGO" flavour 3 }',
            "DEF D Pose { translation 1 0 0 children Dragon { translation 1 0 0 } }",
            "Robot { boundingObject Box { } }",
            'Robot { name "sup" children Emitter { } }',
            'Solid { name "pot" boundingObject Mesh { } }',
            'Solid { name "leaning" rotation 1 0 0 1 boundingObject Plane { } }',
            "Odd { translation TRUE }",
        )
    )
    listed = [
        (n.kind, n.name, n.x, n.y, n.line, n.may_be_solid) for n in world.unmodelled
    ]
    assert listed == [
        ("LegoTallWall", "LEGO", 1, 2, 3, True),
        ("Dragon", "", 2, 0, 4, True),
        ("Robot", "", 0, 0, 5, True),
        ("Robot", "sup", 0, 0, 6, False),
        ("Solid", "pot", 0, 0, 7, True),
        ("Solid", "leaning", 0, 0, 8, True),
        ("Odd", "", 0, 0, 9, True),
    ]
    assert [n.why for n in world.unmodelled] == [
        "an unknown node or PROTO",
        "an unknown node or PROTO",
        "a robot that may move",
        "a robot without a body",
        "its boundingObject is Mesh",
        "its boundingObject is a Plane that is not the ground",
        "an unknown node or PROTO",
    ]


def test_scenery_is_no_obstacle():
    """Lights, backgrounds, viewpoints, and grounds that are Planes."""
    world = read_world(
        text(
            "Viewpoint { }", "Background { }", "TexturedBackground { }", "Fog { }",
            "TexturedBackgroundLight { }", "DirectionalLight { }", "PointLight { }",
            'Solid { name "ground" boundingObject Plane { } }',
        )
    )  # fmt: skip
    assert world.unmodelled == ()
    assert [thing.solid for thing in world.obstacles] == [()]


@pytest.mark.parametrize(
    ("heights", "left_out"), [("", 0), ("0 0 0 0", 0), ("0 0 0 0.1", 1)]
)
def test_a_grid_of_one_height_is_the_ground(heights, left_out):
    """Hills are not modelled."""
    world = read_world(
        text(f"Solid {{ boundingObject ElevationGrid {{ height [ {heights} ] }} }}")
    )
    assert len(world.unmodelled) == left_out


def test_unmodelled_nodes_are_refused_unless_named():
    """By name or type; a name that fits none is refused, too."""
    world = read_world(
        text('Dragon { name "Smaug" }', "Dragon { }", "Robot { }", "Ogre { }"), "w.wbt"
    )
    with pytest.raises(
        WorldError, match=r"w\.wbt: 3 nodes may be solid .*Dragon, Ogre"
    ):
        check_modelled(world)
    with pytest.raises(WorldError, match=r"2 nodes may be solid .*--ignore NAME"):
        check_modelled(world, ["Smaug"])
    left_out = check_modelled(world, ["Dragon", "Ogre"])
    assert [node.kind for node in left_out] == ["Dragon", "Dragon", "Ogre"]
    with pytest.raises(
        WorldError, match="no node called 'Orc' to ignore; not modelled: "
    ):
        check_modelled(world, ["Dragon", "Ogre", "Orc"])
    assert check_modelled(read_world(text())) == ()


def test_the_ground_may_be_a_table():
    """The robot stands on what is under it; what is below does not block it."""
    world = read_world(
        text(
            "E-puck { translation 0 0 0.5 }",
            "SolidBox { translation 0 0 0.25 size 1 1 0.5 }",
            "WoodenBox { translation 0.3 0 0.55 size 0.1 0.1 0.1 }",
            "WoodenBox { translation 0.9 0 0.05 size 0.1 0.1 0.1 }",
        )
    )
    assert floor_under(world) == 0.5
    blocking = [bool(at_body_height(thing.solid, 0.5)) for thing in bodies(world)]
    assert blocking == [False, True, False]
    assert any("stands 0.5 m above the ground" in note for note in world.notes)


def test_what_has_a_mass_falls():
    """Onto the floor, or onto what is below it; what is fixed hangs."""
    world = read_world(
        text(
            "E-puck { translation 2 0 0 }",
            "WoodenBox { translation 0 0 0.05 size 0.1 0.1 0.1 }",
            "WoodenBox { translation 0 0 0.5 size 0.1 0.1 0.1 mass 1 }",
            "WoodenBox { translation 1 0 0.5 size 0.1 0.1 0.1 mass 1 }",
            "WoodenBox { translation 1 1 0.5 size 0.1 0.1 0.1 }",
        )
    )
    bottoms = [thing.solid[0].bottom for thing in bodies(world)]
    assert bottoms == pytest.approx([0, 0.1, 0, 0.45])
    assert world.obstacles[1].solid[0].bottom == pytest.approx(0.45)
    assert sum("modelled as fallen" in note for note in world.notes) == 2


def converted(points):
    """ENU to NUE: the inverse of what Webots' converter does."""
    return np.asarray(points, float) @ Y_UP_TO_Z_UP


def written(kind, translation, rotation, size, more=""):
    axis_angle = " ".join(f"{v:.15g}" for v in rotation)
    where = " ".join(f"{v:.15g}" for v in translation)
    what = " ".join(f"{v:.15g}" for v in size)
    return f"{kind} {{ translation {where} rotation {axis_angle} {more} size {what} }}"


def as_axis_angle(spin):
    vector = spin.as_rotvec()
    angle = float(np.linalg.norm(vector))
    return (*(vector / angle if angle > 1e-12 else (0.0, 0.0, 1.0)), angle)


@settings(deadline=None, max_examples=60)
@given(
    place=st.tuples(*[st.floats(-2, 2)] * 3),
    size=st.tuples(*[st.floats(0.02, 1)] * 3),
    vector=st.tuples(*[st.floats(-3, 3)] * 3),
    kind=st.sampled_from(["WoodenBox", "Wall", "PlasticCrate"]),
)
def test_all_conventions_say_the_same(place, size, vector, kind):
    """A box in ENU with FLU objects, NUE with FLU, NUE with RUB, and ENU with RUB."""
    to_nue = Rotation.from_matrix(Y_UP_TO_Z_UP.T)
    spin = Rotation.from_rotvec(vector)
    flat, rub_size = as_axis_angle(spin), (size[1], size[2], size[0])
    new = read_world(text(written(kind, place, flat, size)))
    nue = written(kind, converted(place), as_axis_angle(to_nue * spin), size)
    rub = as_axis_angle(to_nue * spin * to_nue.inv())
    old = written(kind, converted(place), rub, rub_size)
    mixed = written(kind, place, as_axis_angle(spin * to_nue.inv()), rub_size)
    others = [
        read_world(text(nue, version="R2023a", info='coordinateSystem "NUE"')),
        read_world(text(old, version="R2021b", info='coordinateSystem "NUE"')),
        read_world(text(old, version="V8.6")),
        read_world(text(mixed, version="R2021b", info='coordinateSystem "ENU"')),
        read_world(text(mixed, version="R2021b")),
        read_world(text(mixed, version="V8.0", info="gravity 0 0 -9.81")),
    ]
    (part,) = new.obstacles[0].solid
    for world in others:
        (other,) = world.obstacles[0].solid
        assert other.bottom == pytest.approx(part.bottom, abs=1e-7)
        assert other.top == pytest.approx(part.top, abs=1e-7)
        assert other.shape.area == pytest.approx(part.shape.area, abs=1e-6)
        assert other.shape.bounds == pytest.approx(part.shape.bounds, abs=1e-6)


@given(heading=st.floats(-3.1, 3.1), place=st.tuples(*[st.floats(-2, 2)] * 2))
def test_an_epuck_in_all_conventions(heading, place):
    """x forward since R2022a, -z before; the world's up is z or y."""
    x, y, z = converted((*place, 0.01)).tolist()
    to_nue = Rotation.from_matrix(Y_UP_TO_Z_UP.T)
    spin = as_axis_angle(to_nue * Rotation.from_rotvec((0, 0, heading)))
    turn = " ".join(f"{v:.15g}" for v in spin)
    flat = f"{place[0]!r} {place[1]!r} 0.01"
    new = f"E-puck {{ translation {flat} rotation 0 0 1 {heading!r} }}"
    old = f"E-puck {{ translation {x!r} {y!r} {z!r} rotation 0 1 0 {heading!r} }}"
    nue = f"E-puck {{ translation {x!r} {y!r} {z!r} rotation {turn} }}"
    for world in (
        read_world(text(new)),
        read_world(text(old, version="V7.2.5")),
        read_world(text(nue, version="R2023b", info='coordinateSystem "NUE"')),
    ):
        assert world.robot.pose == pytest.approx((*place, heading), abs=1e-7)
        assert world.robot.z == pytest.approx(0.01, abs=1e-8)


def test_old_cylinders_stand_along_y():
    """And floors lie across it, their sizes along x and z."""
    world = read_world(
        text(
            "Solid { translation 1 0.5 2 "
            "boundingObject Cylinder { radius 0.1 height 1 } }",
            "RectangleArena { floorSize 1 3 }",
            version="R2021b", info='coordinateSystem "NUE"',
        )
    )  # fmt: skip
    (part,) = world.obstacles[0].solid
    assert part.shape == Disc(-2, -1, 0.1)
    assert (part.bottom, part.top) == (0, 1)
    # z of the file points to -x, so 3 m along z are 3 m along x.
    assert world.arenas[0].inside.bounds == pytest.approx((-1.5, -0.5, 1.5, 0.5))


def test_a_world_with_everything():
    """All of it in one file, and nothing lost."""
    world = read_world(EVERYTHING)
    kinds = [thing.kind for thing in world.obstacles]
    assert len(world.robots) == 2
    assert world.goal == (0.5, 0.2)
    assert [arena.kind for arena in world.arenas] == ["RectangleArena", "Floor"]
    assert kinds == [
        "WoodenBox", "CardboardBox", "PlasticCrate", "WoodenPallet", "SolidBox", "Wall",
        "Rock", "Rock", "OilBarrel", "TrafficCone", "SolidPipe", "Solid", "Solid",
        "Shape", "Solid", "Solid", "Solid", "Solid",
    ]  # fmt: skip
    assert [node.kind for node in world.unmodelled] == ["CustomThing", "Robot"]
    assert pickle.loads(pickle.dumps(world)) == world
    old = read_world(OLD)
    assert len(old.robots) == 1
    assert old.unmodelled == ()
    assert [thing.kind for thing in old.obstacles] == [
        "WoodenBox",
        "Wall",
        "Solid",
        "Solid",
    ]


def test_load_world_reads_a_file(tmp_path):
    """By path or name; the world knows what it is called."""
    path = tmp_path / "small.wbt"
    path.write_text(text(ARENA, EPUCK))
    world = load_world(str(path), goal=(0.2, 0.2))
    assert isinstance(world, World)
    assert (world.source, world.version, world.goal) == (
        "small.wbt",
        "R2025a",
        (0.2, 0.2),
    )
    assert world.robot.pose == pytest.approx((-0.4, 0.1, 0.5))
    assert world.arena.inside == Disc(0, 0, 0.8)
