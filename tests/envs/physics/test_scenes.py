"""Promises of scenes: what MuJoCo's rays hit, and what its bodies touch."""

import math
import sys

import numpy as np
import pytest
from world_texts import text

import tdac_envs
from tdac_envs import read_world
from tdac_envs.core.errors import TaskError, WorldError
from tdac_envs.epuck import infrared
from tdac_envs.epuck.carried import scene_at
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.source import open_world
from tdac_envs.physics import boxes
from tdac_envs.physics.body import e_puck_body
from tdac_envs.physics.boxes import rectangles, scene_on
from tdac_envs.physics.engine import MujocoBody
from tdac_envs.physics.scene import scene_of

mujoco = pytest.importorskip("mujoco")
BODY = e_puck_body(0.16, 0.057)


def infrared_rays(x, y, heading, floor):
    """Origins and directions of ps0 to ps7, shapes (8, 3)."""
    places, rise = infrared.PLACES, infrared.ELEVATION
    cos, sin = math.cos(heading), math.sin(heading)
    turn = np.array([[cos, sin], [-sin, cos]])
    origins = np.empty((8, 3))
    origins[:, :2] = places[:, :2] @ turn + (x, y)
    origins[:, 2] = floor + infrared.HEIGHT
    azimuth = places[:, 2] + heading
    flat = np.column_stack([np.cos(azimuth), np.sin(azimuth)]) * math.cos(rise)
    return origins, np.column_stack([flat, np.full(8, math.sin(rise))])


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", tdac_envs.bundled_worlds())
def test_rays_agree_with_the_infrared_sensors(name):
    """On 300 poses in each of the bundled worlds, 2,100 in all: to 1 µm."""
    env = EPuckEnv(name, on_collision="block")
    env.reset(seed=0)
    ground, robot = env.task.ground, env.robot
    twin = MujocoBody(scene_at(ground), BODY)
    random, poses, hits = np.random.default_rng(4), 0, 0
    left, low, right, high = ground.bounds
    while poses < 300:
        x, y = random.uniform((left, low), (right, high))
        if not 0.037 <= ground.gap(x, y) <= 0.11:
            continue
        poses += 1
        heading = random.uniform(-math.pi, math.pi)
        robot.state[:3] = x, y, heading
        env._call_begin()
        found = twin.ranges(*infrared_rays(x, y, heading, ground.floor), infrared.RANGE)
        np.testing.assert_allclose(found, robot.hits[:, 0], rtol=0, atol=1e-6)
        hits += int((found < infrared.RANGE).sum())
    assert hits > 300


def test_rectangles_cover_each_occupied_cell_once():
    for seed in range(20):
        random = np.random.default_rng(seed)
        cells = random.random((17, 23)) < random.uniform(0.05, 0.95)
        count = np.zeros(cells.shape, int)
        for left, top, right, bottom in rectangles(cells):
            count[top:bottom, left:right] += 1
        np.testing.assert_array_equal(count, cells)


def test_a_wall_of_a_map_is_one_box():
    cells = np.zeros((40, 60), bool)
    cells[10:30, 20:25] = True
    assert rectangles(cells) == [(20, 10, 25, 30)]


def test_rays_on_a_map_agree_with_its_cells():
    """Straight right, down, left and up from the middle of a ring, y mirrored."""
    cells = np.zeros((20, 30), bool)
    cells[3, :], cells[15, :], cells[:, 5], cells[:, 26] = True, True, True, True
    twin = MujocoBody(scene_on(cells, 0.01, 0.1), BODY)
    origins = np.tile((0.10, -0.08, 0.05), (4, 1))
    ways = np.array([(1, 0, 0), (0, -1, 0), (-1, 0, 0), (0, 1, 0)], float)
    # From the centre of pixel (10, 8) to the near side of the walls.
    expected = np.array([26 - 10, 15 - 8, 10 - 5, 8 - 3]) - 0.5
    np.testing.assert_allclose(twin.ranges(origins, ways, 1.0), 0.01 * expected)


def test_a_map_of_too_many_boxes_is_refused(monkeypatch):
    monkeypatch.setattr(boxes, "MOST_BOXES", 10)
    cells = np.indices((10, 10)).sum(axis=0) % 2 == 0
    with pytest.raises(TaskError, match="are 50 boxes, more than 10; use a coarser"):
        scene_on(cells, 0.01, 0.1)


@pytest.mark.parametrize("wall", ["", "Wall { translation 1 0 0 }"])
def test_a_world_without_ground_is_refused_in_one_line(wall):
    world = read_world(text("E-puck { }", wall), goal=(1.0, 0.0))
    with pytest.raises(WorldError, match=r"no ground under the robot at .*add a Rect"):
        scene_of(world)


@pytest.mark.parametrize(
    "ground",
    [
        "RectangleArena { }",
        "Floor { }",
        "Solid { children [ Shape { geometry Plane { size 2 2 } } ]"
        " boundingObject Plane { size 2 2 } }",
        "SolidBox { translation 0 0 -0.05 size 2 2 0.1 }",
    ],
)
def test_a_floor_a_plane_or_a_table_is_ground(ground):
    world = read_world(text("E-puck { }", ground), goal=(1.0, 0.0))
    assert scene_of(world).floor == 0.0


def world_with(*nodes):
    return read_world(text("E-puck { }", "Floor { }", *nodes), goal=(-0.5, -0.5))


def driven(world, steps=40, speed=0.1256):
    """The body after some steps straight ahead from the origin, and its contacts."""
    ground = Ground.of(world)
    twin = MujocoBody(scene_at(ground), BODY)
    moved = [twin.step(speed, speed, 0.032) for _ in range(steps)]
    return twin, [each.touched for each in moved]


def test_a_wall_at_full_speed_is_a_contact_and_a_stop():
    wall = "SolidBox { translation 0.1 0 0.05 size 0.02 0.3 0.1 }"
    twin, touched = driven(world_with(wall))
    # The gap of 53 mm is driven in 13.2 steps, and the start takes half a step more.
    assert touched.index(True) in (13, 14)
    assert all(touched[15:])
    assert twin.pose()[0] == pytest.approx(0.09 - 0.037, abs=1e-3)


def test_what_is_lower_than_the_body_is_driven_over():
    plank = "SolidBox { translation 0.1 0 0.001 size 0.02 0.3 0.002 }"
    twin, touched = driven(world_with(plank))
    assert not any(touched)
    assert twin.pose()[0] > 0.14


def test_what_is_above_the_body_is_driven_under():
    bar = "SolidBox { translation 0.1 0 0.1 size 0.02 0.3 0.05 }"
    _, touched = driven(world_with(bar))
    assert not any(touched)


def test_a_light_thing_is_pushed_and_a_heavy_one_stops_the_robot():
    thing = "WoodenBox {{ translation 0.1 0 0.03 size 0.06 0.06 0.06 mass {} }}"
    light, touched = driven(world_with(thing.format(0.03)))
    assert any(touched)
    assert light.things()[0, 0] > 0.12
    heavy, touched = driven(world_with(thing.format(5)))
    assert any(touched)
    assert heavy.things()[0, 0] < 0.101


def test_things_are_at_rest_after_a_reset():
    """Also one that hangs in the air in the file; they stay while nobody comes."""
    ground = Ground.of(open_world("crates"))
    twin = MujocoBody(scene_at(ground), BODY)
    twin.reset(ground.world.robot.pose)
    np.testing.assert_allclose(twin.things()[:, :2], ground.centres, atol=1e-3)
    for _ in range(30):
        twin.step(0.0, 0.0, 0.032)
    np.testing.assert_allclose(twin.things()[:, :2], ground.centres, atol=1e-3)


def test_without_mujoco_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(TaskError, match=r"needs MuJoCo: .*pip.* install .*\[physics\]"):
        EPuckEnv("arena", physics="mujoco")
