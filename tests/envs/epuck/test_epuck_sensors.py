"""Promises of the infra-red sensors: what they see, what they read."""

import math

import numpy as np
import pymunk
import pytest
from test_epuck_contact import oracle_gap, scattered, space_of
from world_texts import text

from tdac_envs import read_world
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.infrared import (
    ELEVATION,
    PLACES,
    RANGE,
    TABLE,
    response,
    sense,
    spread,
)
from tdac_envs.epuck.prisms import Owned, Prisms
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.world import Part

STILL = np.zeros(2, np.float32)
TOWARDS_IT = (0.0, 0.0, -float(PLACES[0, 2]))
QUIET = pytest.approx(67.19, rel=1e-5)


def box(x, y, width=0.02, length=0.3, height=0.1, kind="SolidBox", z=None):
    """A box with its near side across the robot's x axis."""
    at = height / 2 if z is None else z
    size = f"size {width} {length} {height}"
    return f'{kind} {{ name "{x} {y}" translation {x} {y} {at} {size} }}'


def readings(*nodes, **options):
    """Of a robot in the origin that looks along +x, as floats."""
    world = read_world(text("E-puck { }", *nodes), goal=(-2.0, -2.0))
    observation, _ = EPuckEnv(world, **options).reset(seed=0)
    return observation["ps"].astype(float)


@pytest.mark.parametrize("row", TABLE.tolist(), ids=lambda row: f"{row[0]:g} m")
def test_the_function_at_each_tabulated_distance(row):
    """Within 1 %, and the spread, too."""
    distance, value, sigma = row
    assert response(distance) == pytest.approx(value, rel=0.01)
    assert spread(distance) == pytest.approx(sigma, rel=0.01)


def test_between_the_rows_it_is_linear_and_beyond_them_constant():
    distances = np.linspace(-0.01, 0.1, 1000)
    for column, function in ((1, response), (2, spread)):
        expected = np.interp(distances, TABLE[:, 0], TABLE[:, column])
        found = [function(float(d)) for d in distances]
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_contact_reads_as_the_manual_says():
    """A flat wall across a ray that touches the hull; the sensors lie inside of it."""
    forward = PLACES[:, 0] * np.cos(PLACES[:, 2]) + PLACES[:, 1] * np.sin(PLACES[:, 2])
    ways = (BODY_RADIUS - forward) / math.cos(ELEVATION)
    found = [response(float(way)) for way in ways]
    assert round(min(found), -2) == 2000
    assert round(max(found), -2) == 2700
    assert "67 with nothing near, 2000 to 2700 at a contact" in EPuckEnv.__doc__


@pytest.mark.parametrize("gap", [0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
def test_head_on_the_env_agrees_with_the_function(gap):
    """A wall at a gap from the hull, ahead, behind, to the right and to the left."""
    far = 0.037 + gap
    tilt = math.cos(ELEVATION)
    ahead = readings(box(far + 0.01, 0.0))
    front = (far - 0.030) / (tilt * math.cos(PLACES[0, 2]))
    for sensor in (0, 7):
        assert ahead[sensor] == pytest.approx(response(front), rel=0.01)
    beside = response((far - 0.031) / tilt)
    assert readings(box(0.0, -far - 0.01, 0.3, 0.02))[2] == pytest.approx(
        beside, rel=0.01
    )
    assert readings(box(0.0, far + 0.01, 0.3, 0.02))[5] == pytest.approx(
        beside, rel=0.01
    )
    rear = readings(box(-far - 0.01, 0.0))
    back = (far - 0.030) / (tilt * abs(math.cos(PLACES[3, 2])))
    for sensor in (3, 4):
        assert rear[sensor] == pytest.approx(response(back), rel=0.02)


def test_nothing_near_reads_as_the_end_of_the_table():
    assert readings().tolist() == [QUIET] * 8


def test_the_first_four_are_on_the_right():
    """A wall to the robot's right (-y) is seen by ps1, ps2; to the left by ps5, ps6."""
    right = readings(box(0.0, -0.06, 0.5, 0.02))
    left = readings(box(0.0, 0.06, 0.5, 0.02))
    assert min(right[1], right[2]) > 150
    assert right[4:].tolist() == [QUIET] * 4
    assert min(left[5], left[6]) > 150
    assert left[:4].tolist() == [QUIET] * 4
    np.testing.assert_allclose(right, left[::-1], rtol=0.03)


def test_a_ray_stops_at_the_nearest_thing():
    near, both = box(0.08, 0.0), [box(0.08, 0.0), box(0.095, 0.0)]
    np.testing.assert_array_equal(readings(near), readings(*both))


@pytest.mark.parametrize(
    ("height", "gap", "seen"),
    [
        (0.03, 0.02, False),
        (0.035, 0.001, True),
        (0.035, 0.03, False),
        (0.042, 0.04, True),
        (0.042, 0.055, False),
        (0.046, 0.055, True),
    ],
)
def test_low_things_are_not_seen(height, gap, seen):
    """The ray is 33 mm high at the sensor and 44 mm high at its end."""
    value = readings(box(0.0, -(0.037 + gap) - 0.05, 0.3, 0.1, height))[2]
    assert (value > 68) == seen


def test_what_hangs_above_the_rays_is_not_seen():
    assert readings(box(0.07, 0.0, 0.02, 0.3, 0.1, z=0.1)).tolist() == [QUIET] * 8


@pytest.mark.parametrize(
    ("gap", "expected"), [(0, 471), (0.01, 118), (0.02, 67.19), (0.05, 67.19)]
)
def test_wood_as_webots_shows_it(gap, expected):
    """Known figures of factor 0.3 (wood has 0.298), along the ray of ps0."""
    wood = box(0.03701 + gap + 0.05, 0.0, 0.1, kind="WoodenBox")
    value = readings(wood, start=TOWARDS_IT, reflectance="webots")[0]
    assert value == pytest.approx(expected, rel=0.04)


@pytest.mark.parametrize(
    ("gap", "expected"),
    [(0, 2080), (0.01, 584), (0.02, 303), (0.03, 193), (0.05, 111)],
)
def test_ideal_things_along_a_ray(gap, expected):
    """Known figures, along the ray of ps0; they leave its tilt out, 1.3 %."""
    wood = box(0.03701 + gap + 0.05, 0.0, 0.1, kind="WoodenBox")
    assert readings(wood, start=TOWARDS_IT)[0] == pytest.approx(expected, rel=0.025)


def test_the_goal_is_invisible_unless_wanted():
    ball = """DEF GOAL Solid { translation 0.09 0 0.02 children [
      Shape { geometry Sphere { radius 0.05 } } ] }"""
    world = read_world(text("E-puck { }", ball))
    unseen = EPuckEnv(world).reset()[0]["ps"]
    seen = EPuckEnv(world, goal_visible=True).reset()[0]["ps"]
    assert unseen[[0, 7]].tolist() == [QUIET] * 2
    assert seen[[0, 7]].min() > 100


@pytest.mark.slow
def test_rays_are_those_of_a_physics_engine():
    """Distances to discs and convex polygons, of all sensors, at random poses."""
    rng = np.random.default_rng(5)
    checked = 0
    for _ in range(60):
        shapes = scattered(rng)
        space = space_of(shapes)
        prisms = Prisms.of(Owned(Part(shape, -1.0, 1.0)) for shape in shapes)
        for _ in range(20):
            state = rng.uniform(-0.6, 0.6, 3) * (1, 1, 5)
            if oracle_gap(space, *state[:2]) < 0.037:
                continue
            every = (*prisms.arrays(), np.empty(0, np.int64), 0, len(shapes))
            hits, found = np.zeros((8, 3)), np.zeros(8, np.float32)
            sense(*every, 0.0, state, found, hits)
            x, y, heading = state.tolist()
            for sensor, (ahead, aside, azimuth) in enumerate(PLACES.tolist()):
                cos, sin = math.cos(heading), math.sin(heading)
                begin = (x + cos * ahead - sin * aside, y + sin * ahead + cos * aside)
                reach = RANGE * math.cos(ELEVATION)
                end = (
                    begin[0] + reach * math.cos(heading + azimuth),
                    begin[1] + reach * math.sin(heading + azimuth),
                )
                hit = space.segment_query_first(begin, end, 0.0, pymunk.ShapeFilter())
                expected = RANGE if hit is None else RANGE * hit.alpha
                assert hits[sensor, 0] == pytest.approx(expected, abs=1e-6)
                assert found[sensor] == pytest.approx(response(expected), rel=1e-3)
                checked += hit is not None
    assert checked > 300


class TestNoise:
    @pytest.mark.slow
    @pytest.mark.parametrize("distance", [0.015, 0.03, 0.05])
    def test_it_is_that_of_the_table(self, distance):
        """Mean and spread of 10^5 readings, within 5 %."""
        side = 0.031 + distance * math.cos(ELEVATION) + 0.01
        walls = [box(0.0, s * side, 0.3, 0.02) for s in (1, -1)]
        world = read_world(text("E-puck { }", *walls), goal=(-2.0, -2.0))
        env = EPuckEnv(world, sensor_noise=1.0, horizon=10**6)
        env.reset(seed=1)
        both = np.array([env.step(STILL)[0]["ps"][[2, 5]] for _ in range(50_000)])
        value, sigma = response(distance), spread(distance)
        assert both.size == 10**5
        assert both.mean() == pytest.approx(value, rel=0.01)
        assert both.std() / value == pytest.approx(sigma, rel=0.05)

    @pytest.mark.slow
    def test_in_the_open_it_is_that_of_the_last_row(self):
        env = EPuckEnv("arena", sensor_noise=1.0, horizon=10**6)
        env.reset(seed=2)
        found = np.array([env.step(STILL)[0]["ps"] for _ in range(12_500)])
        assert found.std() / 67.19 == pytest.approx(0.04897, rel=0.05)

    def test_a_factor_scales_it_and_nothing_leaves_the_space(self):
        env = EPuckEnv("arena", sensor_noise=40.0, horizon=10**6)
        env.reset(seed=2)
        found = np.array([env.step(STILL)[0]["ps"] for _ in range(500)])
        assert found.min() == 0.0
        assert found.max() <= 4200.0

    def test_it_is_off_by_default(self):
        env = EPuckEnv("arena")
        first = env.reset(seed=1)[0]["ps"]
        np.testing.assert_array_equal(first, env.reset(seed=2)[0]["ps"])


class TestOtherSensors:
    def test_ground_sensors_see_a_dark_plate(self):
        """White floor 3 mm below; a plate under the left one only."""
        plate = """Solid { translation 0.05 0.02 0.0005 children [ Shape {
          appearance PBRAppearance { baseColor 0 0 0 roughness 0 metalness 0 }
          geometry Box { size 0.1 0.03 0.001 } } ] }"""
        world = read_world(text("E-puck { }", plate), goal=(-2.0, -2.0))
        env = EPuckEnv(world, ground_sensors=True, reflectance="webots")
        left, middle, right = env.reset()[0]["ground"].tolist()
        assert middle == right == pytest.approx(1000 - 700 * 0.003 / 0.016, rel=1e-4)
        assert left == pytest.approx(1000 - 700 * (0.002 / 0.2) / 0.016, rel=1e-3)

    def test_gps_and_compass(self):
        world = read_world(text("E-puck { }"), goal=(-2.0, -2.0))
        env = EPuckEnv(world, (0.2, 0.3, math.pi / 2), gps=True, compass=True)
        observation, _ = env.reset()
        np.testing.assert_allclose(observation["gps"], [0.2, 0.3, 0.0], rtol=1e-6)
        np.testing.assert_allclose(observation["compass"], [1, 0, 0], atol=1e-7)

    def test_they_are_not_there_by_default(self):
        keys = {"pose", "goal", "wheel_speeds", "ps", "wheel_positions"}
        assert set(EPuckEnv().reset()[0]) == keys
