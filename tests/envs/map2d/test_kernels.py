"""Promises of the compiled geometry: rays, motion, contact, way to the goal."""

import math

import brute_force
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_envs.core.compiled import read_only
from tdac_envs.drive import stepping
from tdac_envs.drive.stepping import move, wrap_angle
from tdac_envs.grid.grid import OccupancyGrid, body_free, clearance
from tdac_envs.grid.plan import distance_field
from tdac_envs.map2d import kernels
from tdac_envs.map2d.contact import first_contact
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.kernels import advance, path_distance
from tdac_envs.map2d.rays import cast_ray, cast_rays, directions_of, leaps_of, sees
from tdac_envs.map2d.terrain import Terrain
from tdac_envs.mapping.ray_angles import fan

ANGLES = [k * math.pi / 4 for k in range(-3, 5)]
exact = settings(derandomize=True, deadline=None, max_examples=150)
many = settings(derandomize=True, deadline=None, max_examples=3000)


def padded(cells):
    """The clearance with its border, as the contact test takes it."""
    return read_only(np.pad(clearance(cells), 1))


def open_map(width, height, *occupied):
    """A free map with some occupied windows."""
    cells = np.zeros((height, width), bool)
    for window in occupied:
        cells[window] = True
    return cells


def some_map(seed, side=24):
    """A random map: empty, sparse, dense, or with one-pixel walls."""
    random = np.random.default_rng(seed)
    height, width = random.integers(side // 2, side, 2)
    cells = random.random((height, width)) < random.choice([0, 0.01, 0.05, 0.2])
    if seed % 3 == 0:
        cells[:, random.integers(width)] = True
        cells[random.integers(height)] |= random.random(width) < 0.7
    return cells, random


def free_point(cells, random, room):
    """A point with at least `room` px to all squares, or None."""
    height, width = cells.shape
    x = random.uniform(-0.5, width - 0.5, 200)
    y = random.uniform(-0.5, height - 0.5, 200)
    good = np.flatnonzero(brute_force.distance(cells, x, y) >= room)
    return (float(x[good[0]]), float(y[good[0]])) if good.size else None


class TestRays:
    @given(st.integers(0, 10**6))
    @exact
    def test_ranges_are_those_of_brute_force(self, seed):
        cells, random = some_map(seed)
        point = free_point(cells, random, 1e-6)
        if point is None:
            return
        leaps = leaps_of(cells)
        for angle in [*random.uniform(-7, 7, 6), float(random.choice(ANGLES))]:
            expected = brute_force.ray(cells, *point, angle, 18.0)
            measured = cast_ray(leaps, *point, angle, 18.0)
            assert measured == pytest.approx(expected, abs=1e-9)

    @pytest.mark.parametrize("seed", range(20))
    def test_ranges_after_leaps_through_open_space(self, seed):
        random = np.random.default_rng(seed)
        cells = random.random((150, 200)) < 0.0005
        x, y = free_point(cells, random, 1.0)
        leaps = leaps_of(cells)
        for angle in random.uniform(-4, 4, 10):
            expected = brute_force.ray(cells, x, y, angle, 300.0)
            measured = cast_ray(leaps, x, y, angle, 300.0)
            assert measured == pytest.approx(expected, abs=1e-9)

    def test_a_one_pixel_wall_stops_every_ray_that_crosses_it(self):
        cells = open_map(101, 101, np.s_[:, 60], np.s_[20, :])
        leaps = leaps_of(cells)
        for angle in np.linspace(-math.pi, math.pi, 2001):
            expected = brute_force.ray(cells, 40.3, 50.7, angle, 200.0)
            measured = cast_ray(leaps, 40.3, 50.7, angle, 200.0)
            assert measured == pytest.approx(expected, abs=1e-9)

    def test_a_staircase_of_corners_lets_no_ray_through(self):
        cells = np.eye(31, dtype=bool)
        leaps = leaps_of(cells)
        for x in np.arange(17.0, 26.0, 0.25):
            measured = cast_ray(leaps, x, 30 - x, 3 * math.pi / 4, 50.0)
            to_corner = (x - 15) * math.sqrt(2)
            assert to_corner - 0.75 < measured <= to_corner

    def test_a_ray_along_a_border_of_pixels_belongs_to_the_next_row(self):
        cells = open_map(40, 20, np.s_[9, 30])
        leaps = leaps_of(cells)
        assert cast_ray(leaps, 5.0, 8.5, 0.0, 100.0) == 24.5
        assert cast_ray(leaps, 5.0, 9.5, 0.0, 100.0) == 34.5
        assert cast_ray(leaps, 5.0, np.nextafter(9.5, 0), 0.0, 100.0) == 24.5

    def test_a_ray_into_a_pinch_of_two_corners_stops_there(self):
        cells = open_map(20, 20, np.s_[10, 11], np.s_[11, 10])
        measured = cast_ray(leaps_of(cells), 5.0, 5.0, math.pi / 4, 30.0)
        assert measured == pytest.approx(5.5 * math.sqrt(2))

    @pytest.mark.parametrize("angle", ANGLES)
    def test_no_hit_is_range_max(self, angle):
        leaps = leaps_of(open_map(50, 50))
        assert cast_ray(leaps, 25.0, 25.0, angle, 10.0) == 10.0

    @pytest.mark.parametrize("point", [(5.0, 5.0), (-3.0, 4.0), (4.0, 90.0)])
    def test_an_occupied_origin_or_one_outside_reads_0(self, point):
        leaps = leaps_of(open_map(10, 10, np.s_[5, 5]))
        assert cast_ray(leaps, *point, 0.3, 10.0) == 0.0

    def test_the_border_of_the_map_is_a_wall(self):
        leaps = leaps_of(open_map(30, 20))
        assert cast_ray(leaps, 10.0, 10.0, 0.0, 99.0) == 19.5
        assert cast_ray(leaps, 10.0, 10.0, math.pi, 99.0) == 10.5
        assert cast_ray(leaps, 10.0, 10.0, math.pi / 2, 99.0) == 9.5

    def test_the_first_ray_is_the_leftmost(self):
        """Looking right along +x, a wall above on the picture is at the left."""
        leaps = leaps_of(open_map(100, 100, np.s_[:30, :]))
        out = np.zeros(5, np.float32)
        cast_rays(leaps, directions_of(fan(180.0, 5)), 50.0, 50.0, 0.0, 40.0, out)
        assert out[0] == 20.5 - 0.0
        assert out[-1] == 40.0

    def test_ray_i_points_where_it_says(self):
        cells, _ = some_map(8)
        leaps = leaps_of(open_map(30, 30) | np.pad(cells, 8)[:30, :30])
        out = np.zeros(7, np.float32)
        cast_rays(leaps, directions_of(fan(95.0, 7)), 4.0, 4.0, 0.4, 25.0, out)
        for i, measured in enumerate(out):
            angle = 0.4 + math.radians(-47.5 + i * 95.0 / 6)
            assert measured == np.float32(cast_ray(leaps, 4.0, 4.0, angle, 25.0))

    def test_a_single_ray_points_ahead(self):
        out = np.zeros(1, np.float32)
        ahead = directions_of(fan(110.0, 1))
        cast_rays(leaps_of(open_map(30, 30)), ahead, 10.0, 10.0, 0.0, 99.0, out)
        assert out[0] == 19.5

    @pytest.mark.slow
    @given(st.integers(0, 10**6))
    @exact
    def test_sees_is_symmetric_and_stops_at_walls(self, seed):
        cells, random = some_map(seed)
        here, there = (free_point(cells, random, 1e-3) for _ in range(2))
        if here is None or there is None:
            return
        leaps = leaps_of(cells)
        gap = math.dist(here, there)
        angle = math.atan2(there[1] - here[1], there[0] - here[0])
        clear = brute_force.ray(cells, *here, angle, gap) >= gap
        assert sees(leaps, *here, *there) == clear
        assert sees(leaps, *there, *here) == clear

    def test_a_point_sees_itself(self):
        assert sees(leaps_of(open_map(3, 3)), 1.0, 1.0, 1.0, 1.0)


class TestMotion:
    @pytest.mark.parametrize("heading", [*ANGLES, 1.0])
    @pytest.mark.parametrize("turn", [0.0, 1e-12, 1e-7, 2e-4, 0.3, -2.0, 9.0])
    @pytest.mark.parametrize("forward", [3.0, -2.0, 0.0])
    def test_the_closed_form_of_an_arc(self, heading, turn, forward):
        x, y = brute_force.arc(5.0, 7.0, heading, forward, turn, 1.0)
        end = move(5.0, 7.0, heading, forward, turn)
        assert end == pytest.approx((x, y, heading + turn), abs=1e-13)

    @pytest.mark.parametrize(
        ("left", "right", "expected"),
        [
            (10.0, 10.0, (51.0, 50.0, 0.0)),
            (-10.0, -10.0, (49.0, 50.0, 0.0)),
            (10.0, -10.0, (50.0, 50.0, 0.2)),
            (0.0, 0.0, (50.0, 50.0, 0.0)),
        ],
    )
    def test_straight_and_in_place(self, left, right, expected):
        state = np.array([50.0, 50.0, 0.0])
        touched, _ = advance(
            padded(open_map(101, 101)), state, left, right, 10.0, 0.1, 5.0
        )
        assert not touched
        np.testing.assert_allclose(state, expected, atol=1e-12)

    def test_the_faster_right_wheel_turns_up_on_the_picture(self):
        """At heading 0 the robot looks right; left is up, where y falls."""
        state = np.array([50.0, 50.0, 0.0])
        advance(padded(open_map(101, 101)), state, 5.0, 10.0, 10.0, 1.0, 3.0)
        assert state[1] < 50.0
        assert state[2] == pytest.approx(-0.5)

    def test_the_heading_is_wrapped(self):
        world, state = padded(open_map(9, 9)), np.array([4.0, 4.0, 3.0])
        for _ in range(50):
            advance(world, state, 5.0, -5.0, 10.0, 0.3, 1.0)
            assert -math.pi < state[2] <= math.pi
        turned = 3.0 + 50 * 0.3
        assert math.remainder(state[2] - turned, 2 * math.pi) == pytest.approx(
            0, abs=1e-9
        )

    @given(st.floats(-1e3, 1e3))
    @exact
    def test_wrapping_keeps_the_direction(self, angle):
        wrapped = wrap_angle(angle)
        assert -math.pi < wrapped <= math.pi
        assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-12)
        assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-12)

    @pytest.mark.parametrize("angle", [math.pi, -math.pi, 3 * math.pi, -5 * math.pi])
    def test_half_a_turn_is_plus_pi(self, angle):
        assert abs(wrap_angle(angle)) == pytest.approx(math.pi)
        assert wrap_angle(-math.pi) == math.pi


def gaps_along(cells, pose, forward, turn, radius, parts):
    x, y = brute_force.arc(*pose, forward, turn, parts)
    return brute_force.distance(cells, x, y) - radius


def assert_first_contact(cells, pose, forward, turn, radius):
    """No overlap before the contact, none missed, and a touch where it is."""
    touch = first_contact(padded(cells), *pose, forward, turn, radius)
    parts = np.linspace(0.0, min(touch, 1.0), 400)
    gaps = gaps_along(cells, pose, forward, turn, radius, parts)
    assert gaps.min() >= min(gaps[0], 0.0) - 1e-6
    assert 0.0 <= touch < 1.0 or touch == 2.0
    if touch <= 1.0:
        assert gaps[-1] == pytest.approx(0.0, abs=1e-6)
    return touch


TURNS = [0.0, 1e-9, -1e-7, 3e-5, 0.01, -0.25, 1.0, -3.0, 7.0]


def check_random_arc(seed):
    cells, random = some_map(seed)
    radius = float(random.choice([0.05, 0.3, 0.49, 0.9, 1.5, 3.3, 5.0]))
    point = free_point(cells, random, radius)
    if point is None:
        return None
    length = float(random.choice([0.2, 3.0, 12.0, 40.0]))
    forward = math.copysign(length, random.uniform(-1, 1))
    turn = float(random.choice(TURNS)) * random.uniform(0.5, 1.0)
    heading = float(random.choice([random.uniform(-4, 4), *ANGLES]))
    pose = (*point, heading)
    return assert_first_contact(cells, pose, forward, turn, radius)


class TestFirstContact:
    @given(st.integers(0, 10**6))
    @exact
    def test_any_arc_on_any_map(self, seed):
        check_random_arc(seed)

    @pytest.mark.slow
    @given(st.integers(0, 10**9))
    @many
    def test_many_arcs_on_many_maps(self, seed):
        check_random_arc(seed)

    def test_the_random_arcs_both_touch_and_pass(self):
        found = [check_random_arc(seed) for seed in range(60)]
        assert sum(touch == 2.0 for touch in found if touch is not None) > 5
        assert sum(touch < 1.0 for touch in found if touch is not None) > 5

    @pytest.mark.slow_after(5)
    @pytest.mark.parametrize("turn", TURNS)
    @pytest.mark.parametrize("forward", [20.0, -20.0])
    def test_a_large_disc(self, turn, forward):
        cells = open_map(200, 200, np.s_[60, 60], np.s_[150, 40:100], np.s_[90, 170])
        for heading in np.linspace(-3, 3, 7):
            assert_first_contact(cells, (105.0, 100.0, heading), forward, turn, 38.0)

    @pytest.mark.parametrize(
        ("heading", "expected"), [(0.0, 14.5), (math.pi / 2, 2.0), (0.6, 2.0)]
    )
    def test_head_on_into_a_wall(self, heading, expected):
        """Wall at x >= 49.5; the disc of 5 px stands at 30."""
        cells = open_map(100, 100, np.s_[:, 50:])
        touch = first_contact(padded(cells), 30.0, 50.0, heading, 15.0, 0.0, 5.0)
        wanted = expected / 15.0 if expected != 2.0 else 2.0
        assert touch == pytest.approx(wanted, abs=1e-8)

    def test_a_corner_is_met_by_the_round_of_the_disc(self):
        cells = open_map(60, 60, np.s_[30, 30])
        x = 29.5 - math.sqrt(5.0**2 - 3.0**2)
        touch = first_contact(padded(cells), 15.0, 26.5, 0.0, 30.0, 0.0, 5.0)
        assert touch == pytest.approx((x - 15.0) / 30.0, abs=1e-9)

    @pytest.mark.parametrize(
        ("heading", "forward", "turn", "free"),
        [
            (0.0, 3.0, 0.0, False),
            (math.pi, 3.0, 0.0, True),
            (0.0, -3.0, 0.0, True),
            (math.pi, -3.0, 0.0, False),
            (math.pi / 2, 3.0, 0.0, True),
            (-math.pi / 2, 30.0, 0.0, True),
            (math.pi / 2, 3.0, 0.2, True),
            (math.pi / 2, 3.0, -0.2, False),
            (math.pi / 2, 3.0, -1e-4, False),
            (math.pi / 2, 3.0, 1e-4, True),
            (math.pi / 2, -3.0, 0.2, False),
            (math.pi / 2, -3.0, -0.2, True),
            (math.pi / 2 - 0.01, 3.0, 0.0, False),
            (math.pi / 2 + 0.01, 3.0, 0.0, True),
            (math.pi / 2, 60.0, 6.0, True),
        ],
    )
    def test_a_disc_in_touch_may_go_away_or_along_but_not_in(
        self, heading, forward, turn, free
    ):
        """Wall at x >= 49.5; the disc of 5 px touches it at x = 44.5."""
        cells = open_map(100, 100, np.s_[:, 50:])
        pose = (44.5, 50.0, heading)
        touch = assert_first_contact(cells, pose, forward, turn, 5.0)
        assert (touch == 2.0) == free
        if not free:
            assert touch * abs(forward) < 0.03

    def test_a_disc_in_touch_that_leaves_may_come_back_to_a_contact(self):
        cells = open_map(100, 100, np.s_[:, 50:], np.s_[:, :20])
        pose = (44.5, 50.0, math.pi / 2)
        touch = assert_first_contact(cells, pose, 80.0, 2.0, 5.0)
        assert 0.2 < touch < 0.9

    @pytest.mark.parametrize("turn", [0.0, 1e-6, 0.3, -0.3])
    @pytest.mark.parametrize("forward", [100.0, -100.0, 1000.0])
    @pytest.mark.parametrize("radius", [0.01, 0.4, 6.0])
    def test_no_step_jumps_through_a_wall_of_one_pixel(self, turn, forward, radius):
        cells = open_map(400, 200, np.s_[:, 150], np.s_[:, 250])
        for heading in (-0.2, 0.0, 0.3):
            state = np.array([200.0, 100.0, heading])
            wheel = 0.5 * turn
            touched, _ = advance(
                padded(cells),
                state,
                forward + wheel,
                forward - wheel,
                1.0,
                1.0,
                radius,
            )
            assert touched
            gap = float(brute_force.distance(cells, state[0], state[1])) - radius
            assert gap == pytest.approx(0.0, abs=2e-6)
            assert gap >= 0.0
            assert 150 < state[0] < 250

    def test_turning_in_place_never_touches(self):
        cells = open_map(100, 100, np.s_[:, 50:])
        assert first_contact(padded(cells), 44.5, 50.0, 0.0, 0.0, 3.0, 5.0) == 2.0

    def test_the_corner_between_two_squares_counts(self):
        """A small disc meets the pinch of a diagonal of squares."""
        cells = np.eye(40, dtype=bool)
        pose = (25.0, 16.0, 3 * math.pi / 4)
        touch = assert_first_contact(cells, pose, 40.0, 0.0, 0.1)
        assert touch * 40.0 == pytest.approx(4.4 * math.sqrt(2))

    def test_driving_against_a_wall_for_ever_never_gets_into_it(self):
        """In all directions, with every start in touch where the last one ended."""
        cells = open_map(60, 60, np.s_[20:23, 10:50], np.s_[40, 30])
        world, random = padded(cells), np.random.default_rng(0)
        state = np.array([30.0, 30.0, 0.0])
        contacts = 0
        for _ in range(3000):
            left, right = random.uniform(-1, 1, 2) * 40
            contacts += advance(world, state, left, right, 8.0, 0.05, 4.0)[0]
            assert brute_force.distance(cells, state[0], state[1]) >= 4.0 - 1e-6
        assert contacts > 100

    @pytest.mark.parametrize("slope", [1e-1, 1e-3, 1e-6, 1e-9])
    def test_grazing_a_wall_again_and_again_never_gets_into_it(self, slope):
        cells = open_map(60, 30, np.s_[15:, :])
        world = padded(cells)
        state = np.array([6.0, 14.5 - 4.0, slope])
        for _ in range(1000):
            advance(world, state, 5.0, 5.0, 8.0, 0.05, 4.0)
            assert 14.5 - state[1] >= 4.0 - 2e-7


class TestPathDistance:
    def test_on_the_lattice_it_is_the_field(self):
        cells, _ = some_map(7)
        world = Terrain.of(OccupancyGrid(cells))
        free = body_free(world.clear, 0.3)
        goal = tuple(int(v) for v in np.argwhere(free)[0])[::-1]
        field = read_only(distance_field(free, goal), np.float32)
        for y, x in np.argwhere(np.isfinite(field)):
            there = path_distance(world.leaps, field, float(x), float(y), -1.0)
            assert there == pytest.approx(field[y, x], abs=1e-4)

    def test_between_pixels_it_changes_no_faster_than_the_robot_moves(self):
        world = Terrain.of(OccupancyGrid(open_map(40, 40, np.s_[20, 5:35])))
        free = body_free(world.clear, 2.0)
        field = read_only(distance_field(free, (20, 8)), np.float32)
        line = np.linspace(5.0, 34.0, 500)
        there = [path_distance(world.leaps, field, x, 30.0, -1.0) for x in line]
        # Both ends of a hop are rounded to the lattice: up to its octile error.
        assert np.abs(np.diff(there)).max() < 0.1

    def test_squeezed_into_a_corner_it_uses_a_pixel_in_sight(self):
        world = Terrain.of(OccupancyGrid(open_map(30, 30)))
        free = body_free(world.clear, 5.0)
        field = read_only(distance_field(free, (20, 20)), np.float32)
        there = path_distance(world.leaps, field, 4.5, 4.5, -1.0)
        assert field[5, 5] < there <= field[5, 5] + 1.0

    def test_no_pixel_in_sight_gives_the_previous_value(self):
        cells = open_map(30, 30, np.s_[:, 10])
        world = Terrain.of(OccupancyGrid(cells))
        free = body_free(world.clear, 0.2)
        free[:, :10] = False
        field = read_only(distance_field(free, (20, 20)), np.float32)
        assert path_distance(world.leaps, field, 8.9, 15.0, 77.0) == 77.0


def test_a_robot_that_contacts_stop_steps_alike_in_both_kernels():
    """Bit for bit, so that a batch may use the larger one for all robots."""
    one, other = (Map2DEnv(variation="random") for _ in range(2))
    random = np.random.default_rng(3)
    for episode in range(20):
        for env in (one, other):
            env.reset(seed=episode)
        wheels = random.uniform(-0.5, 1.0, 2)
        for _ in range(40):
            for env, call in ((one, kernels.drive), (other, kernels.drive_or_slide)):
                env.robot.state[[stepping.LEFT, stepping.RIGHT]] = wheels
                call(env.addresses.words[0])
            for ours, theirs in zip(one.robot, other.robot, strict=True):
                np.testing.assert_array_equal(ours, theirs)
    assert one.setup.on_collision == "terminate"
