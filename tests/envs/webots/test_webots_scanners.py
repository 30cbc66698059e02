"""Lidars and range finders: their ranges, against geometry and plain ray marching."""

import math

import numpy as np
import pytest

from tdac_envs.core.errors import WorldError
from tdac_envs.webots.scanners import MOST_RANGES
from tdac_envs.webots.scenery import Scenery
from tdac_envs.webots.stage import open_stage
from tdac_envs.webots.views import Views
from tdac_envs.worlds.footprint import Disc, Rectangle
from tdac_envs.worlds.wbt.colours import BLACK_SKY
from tdac_envs.worlds.world import Obstacle, Part, World

HEAD = "#VRML_SIM R2025a utf8\nWorldInfo { }\n"
ARENA = "RectangleArena { floorSize 2 1 wallHeight 0.2 }\n"
LEVEL = "translation 0.0095 0 0.0514"
"""A place in the turret slot that is 0.1 m above the middle of the robot."""
UP = 0.1


def turret(device):
    """A world with an arena and an e-puck that looks along x."""
    return f"{HEAD}{ARENA}E-puck {{ turretSlot [ {device} ] }}\n"


@pytest.fixture
def opened(tmp_path):
    """A function of a world's text: its stage."""

    def make(content):
        file = tmp_path / "world.wbt"
        file.write_text(content)
        return open_stage(file)

    return make


@pytest.fixture
def seen(opened):
    """A function of a world's text: the device and its first range image."""

    def make(content, **options):
        stage = opened(content)
        env = stage.make_env(**options)
        env.reset(seed=0)
        views = Views(stage.viewers, stage.world, stage.sky, stage.robot, env)
        (facts,) = stage.scanners
        views.expose(facts.name)
        ranges = np.frombuffer(views.image(facts.name), "<f4")
        return facts, ranges.reshape(facts.rows, facts.columns)

    return make


def to_wall(angle):
    """Distance from the middle of the arena to its wall, in the plane."""
    x, y = abs(math.cos(angle)), abs(math.sin(angle))
    return min(1.0 / max(x, 1e-9), 0.5 / max(y, 1e-9))


class TestDirections:
    def test_a_fixed_lidar_looks_from_left_to_right(self, seen):
        """Each ray is in the middle of its part of the field of view."""
        device = f"Lidar {{ {LEVEL} numberOfLayers 1 maxRange 9 fieldOfView 3 }}"
        facts, ranges = seen(turret(device))
        assert ranges.shape == (1, 512)
        angles = 1.5 - (np.arange(512) + 0.5) * 3.0 / 512
        assert facts.azimuths == pytest.approx(angles)
        assert ranges[0] == pytest.approx([to_wall(a) for a in angles], rel=1e-6)

    def test_a_rotating_lidar_looks_all_around(self, seen):
        """From behind to the right-hand side, ahead, and to the left."""
        device = (
            f'Lidar {{ {LEVEL} type "rotating" numberOfLayers 1 maxRange 9\n'
            "  horizontalResolution 8 fieldOfView 1 }"
        )
        facts, ranges = seen(turret(device))
        assert facts.azimuths[[0, 4]] == pytest.approx([-math.pi, -2.0 * math.pi])
        diagonal = 0.5 * math.sqrt(2.0)
        wanted = [1.0, diagonal, 0.5, diagonal, 1.0, diagonal, 0.5, diagonal]
        assert ranges[0] == pytest.approx(wanted, rel=1e-6)
        turned = turret(device).replace("E-puck {", "E-puck { rotation 0 0 1 0.3")
        angles = 0.3 - math.pi - np.arange(8) * math.pi / 4
        assert seen(turned)[1][0] == pytest.approx([to_wall(a) for a in angles])

    def test_layers_begin_at_the_top(self, seen):
        """The rays of the lower layers meet the floor, tilted ones the sky."""
        device = (
            f"Lidar {{ {LEVEL} numberOfLayers 5 verticalFieldOfView 1 maxRange 9\n"
            "  horizontalResolution 7 fieldOfView 0.001 {} }}"
        )
        angles = np.array([0.5, 0.25, 0.0, -0.25, -0.5])
        facts, ranges = seen(turret(device.replace("{}", "").replace("}}", "}")))
        assert facts.elevations == pytest.approx(angles)
        floor = UP / np.sin(0.25), UP / np.sin(0.5)
        assert ranges[:, 3] == pytest.approx([np.inf, np.inf, 1.0, *floor], rel=1e-5)
        tilted = device.replace("{}", "tiltAngle 0.25").replace("}}", "}")
        facts, ranges = seen(turret(tilted))
        assert facts.elevations == pytest.approx(angles + 0.25)
        assert ranges[4, 3] == pytest.approx(UP / np.sin(0.25), rel=1e-5)

    def test_a_range_finder_measures_along_its_axis(self, seen):
        """All pixels of a wall at a right angle have one depth; a sphere's differ."""
        device = f"RangeFinder {{ {LEVEL} width 9 height 5 maxRange 9 %s }}"
        facts, ranges = seen(turret(device % "fieldOfView 0.1"))
        assert ranges == pytest.approx(np.ones((5, 9)), rel=1e-6)
        vertical = 2.0 * math.atan(math.tan(0.05) * 5 / 9)
        assert facts.vertical_field_of_view == pytest.approx(vertical)
        facts, ranges = seen(turret(device % "fieldOfView 0.9 spherical TRUE"))
        flat = np.cos(facts.azimuths)
        assert ranges[2] == pytest.approx(1.0 / flat, rel=1e-6)
        assert facts.vertical_field_of_view == pytest.approx(0.5)

    def test_a_plane_lidar(self, seen):
        """With `spherical FALSE` the rays are evenly spaced on a plane."""
        device = (
            f"Lidar {{ {LEVEL} numberOfLayers 1 maxRange 9 spherical FALSE\n"
            "  horizontalResolution 4 fieldOfView 1 }"
        )
        facts, ranges = seen(turret(device))
        pixel = 2.0 * math.tan(0.5) / 4
        aside = [1.5 * pixel, 0.5 * pixel, -0.5 * pixel, -1.5 * pixel]
        assert facts.directions[:, 1] == pytest.approx(aside)
        assert facts.directions[:, 0] == pytest.approx(1.0)
        assert ranges[0, 1] == pytest.approx(1.0, rel=1e-6)

    def test_worlds_with_y_up(self, seen):
        """A lidar of Webots before R2022a sees what that of today sees."""
        device = "Lidar { %s numberOfLayers 1 maxRange 9 fieldOfView 3 %s }"
        now = device % ("translation 0.01 0.02 0.05", "rotation 0 0 1 0.4")
        then = device % ("translation -0.02 0.05 -0.01", "rotation 0 1 0 0.4")
        old = turret(then).replace("R2025a", "R2021b").replace("2 1 wall", "1 2 wall")
        old = old.replace("WorldInfo { }", 'WorldInfo { coordinateSystem "NUE" }')
        new_facts, new = seen(turret(now))
        old_facts, ranges = seen(old)
        assert (new_facts.y_up, old_facts.y_up) == (False, True)
        assert old_facts.place == pytest.approx(new_facts.place)
        assert old_facts.axes == pytest.approx(new_facts.axes)
        assert ranges == pytest.approx(new, rel=1e-6)


class TestLimits:
    def test_what_is_too_near_or_too_far_is_infinite(self, seen):
        """A near object hides what is behind it."""
        device = (
            f"Lidar {{ {LEVEL} numberOfLayers 1 horizontalResolution 3 fieldOfView 3\n"
            "  minRange 0.3 maxRange 0.9 }"
        )
        angles = np.array([1.0, 0.0, -1.0])
        ranges = seen(turret(device))[1][0]
        assert ranges == pytest.approx([to_wall(1), np.inf, to_wall(1)], rel=1e-6)
        post = "Solid { translation %s 0.1 children [ Shape { geometry Cylinder {\n"
        post += "  radius 0.02 height 0.2 } } ] }\n"
        near = 0.2 * np.array([math.cos(angles[0]), math.sin(angles[0])])
        hidden = turret(device) + post % f"{near[0]} {near[1]}"
        assert seen(hidden)[1][0, 0] == np.inf
        assert seen(turret(device) + post % "0.5 0")[1][0, 1] == pytest.approx(0.48)

    def test_resolution(self, seen):
        """Ranges are multiples of it."""
        device = f"Lidar {{ {LEVEL} maxRange 9 numberOfLayers 1 resolution 0.04 }}"
        _, ranges = seen(turret(device))
        steps = ranges / 0.04
        assert steps == pytest.approx(np.round(steps), abs=1e-5)
        assert len(np.unique(ranges)) > 3

    def test_noise_only_with_the_sensors_of_webots(self, seen):
        """Its standard deviation is a fraction of the largest range."""
        device = f"Lidar {{ {LEVEL} maxRange 2 numberOfLayers 1 %s }}"
        _, exact = seen(turret(device % ""))
        _, without = seen(turret(device % "noise 0.01"))
        assert (exact == without).all()
        _, noisy = seen(turret(device % "noise 0.01"), webots_sensors=True)
        spread = np.std(noisy - exact)
        assert 0.017 < spread < 0.023  # 512 samples of 0.02 m
        assert (seen(turret(device % ""), webots_sensors=True)[1] == exact).all()

    def test_odd_fields(self, opened):
        """Values that no lidar can have are replaced as in Webots."""
        device = (
            "Lidar { horizontalResolution 0 numberOfLayers -2 fieldOfView 7\n"
            "  near 0.5 minRange 0.2 maxRange 0.1 noise -1 }"
        )
        (facts,) = opened(turret(device)).scanners
        assert (facts.columns, facts.rows) == (512, 4)
        assert facts.field_of_view == pytest.approx(math.pi / 2)
        assert (facts.near, facts.min_range, facts.max_range) == (0.2, 0.2, 1.2)
        assert facts.noise == 0.0

    def test_too_many_ranges(self, opened):
        """Such a device is listed as not modelled; it exists and sees nothing."""
        device = f'Lidar {{ name "huge" horizontalResolution {MOST_RANGES // 2} }}'
        stage = opened(turret(device))
        assert stage.scanners == ()
        assert "huge" in stage.absent

    def test_a_lidar_without_a_direction(self, opened):
        """A Robot that is scaled to a point is refused, with the place in the file."""
        robot = 'Robot { model "epuck" children [ Lidar { name "eye" } ] }'
        world = f"{HEAD}Transform {{ scale 1e-9 1e-9 1e-9 children [ {robot} ] }}\n"
        with pytest.raises(WorldError, match="the device 'eye' has the scale 0"):
            opened(world)


def test_lidars_of_the_library(opened):
    """The PROTOs of two makers have the fields of Webots' files."""
    stage = opened(turret("RobotisLds01 { } RpLidarA2 { }"))
    lds, rp = stage.scanners
    assert (lds.name, lds.columns, lds.rows) == ("LDS-01", 360, 1)
    assert (lds.min_range, lds.max_range, lds.is_rotating) == (0.12, 3.5, False)
    assert lds.place == pytest.approx((-0.0095, 0.0, 0.0686))
    assert (rp.name, rp.columns, rp.is_rotating) == ("RPlidar A2", 800, True)
    assert rp.place == pytest.approx((-0.0095, 0.0, 0.0486))
    assert stage.absent == ()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("seed", range(4))
def test_any_scene_as_marched_along_its_rays(opened, seed):
    """Every ray ends where a point moving along it first is inside of an object."""
    rng = np.random.default_rng(seed)
    things = [_thing(rng) for _ in range(12)]
    device = (
        "Lidar { horizontalResolution 90 fieldOfView 6.28 numberOfLayers 3\n"
        "  verticalFieldOfView 0.3 maxRange 1.2 }"
    )
    (facts,) = opened(turret(device)).scanners
    scenery = Scenery.of(World(obstacles=tuple(things)), BLACK_SKY)
    place, turn = np.array([0.1, -0.1, 0.08]), np.eye(3)
    ranges = facts.ranges(scenery, place, turn, np.empty((0, 3)))
    at = np.arange(0.01, 1.2, 5e-4)
    wrong = 0
    for way, found in zip(facts.directions, ranges, strict=True):
        points = place + at[:, None] * way
        inside = np.zeros(len(at), bool)
        for thing in things:
            inside |= _is_inside(thing.visible[0], points)
        marched = at[inside.argmax()] if inside.any() else np.inf
        wrong += not (marched == found or abs(marched - found) < 1.1e-3)
    assert wrong <= 1  # a step may miss a corner
    assert np.isfinite(ranges).sum() > 40


def _thing(rng):
    angle, away = rng.uniform(0.0, 6.3), rng.uniform(0.3, 0.9)
    x, y = 0.1 + away * math.cos(angle), -0.1 + away * math.sin(angle)
    size = rng.uniform(0.03, 0.12)
    shape = Disc(x, y, size)
    if rng.random() < 0.6:
        shape = Rectangle(x, y, rng.uniform(0, 3), size, 2.0 * size)
    low = rng.uniform(0.0, 0.08)
    part = Part(shape, low, low + rng.uniform(0.02, 0.2))
    return Obstacle(name="thing", kind="Solid", x=x, y=y, visible=(part,))


def _is_inside(part, points):
    x, y, z = points.T
    level = (z >= part.bottom) & (z <= part.top)
    shape = part.shape
    if isinstance(shape, Disc):
        return level & (np.hypot(x - shape.x, y - shape.y) <= shape.radius)
    inside = level
    for one, two in zip(
        shape.vertices, np.roll(shape.vertices, -1, axis=0), strict=True
    ):
        across = (two[0] - one[0]) * (y - one[1]) - (two[1] - one[1]) * (x - one[0])
        inside = inside & (across >= 0.0)
    return inside


def test_movable_objects_are_seen_where_they_are(opened):
    """Not where they were at the start."""
    box = "WoodenBox { translation 0.4 0 0.1 size 0.1 0.1 0.2 mass 0.05 }\n"
    device = f"Lidar {{ {LEVEL} numberOfLayers 1 horizontalResolution 1 maxRange 9 }}"
    stage = opened(turret(device) + box)
    (facts,) = stage.scanners
    scenery = Scenery.of(stage.world, BLACK_SKY)
    view = scenery, facts.place, facts.axes
    for x in (0.4, 0.6):
        (ahead,) = facts.ranges(*view, np.array([(x, 0.01, 0.0)]))
        assert ahead == pytest.approx(x - 0.05)
