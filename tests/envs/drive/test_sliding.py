"""Promises of contacts with `on_collision="block"`: the robot turns and slides."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from brute_force import distance
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from tdac_envs.drive.sliding import slide_velocity
from tdac_envs.drive.stepping import AXLE, DT, MAX_SPEED
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.gaps import nearest_gap
from tdac_envs.epuck.kernels import WHEEL_RADIUS
from tdac_envs.epuck.pushing import CommandedArc, push
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.materials import Contact
from tdac_envs.worlds.wbt.reader import read_world

RADIUS = 9.0
ANGLES = st.floats(-math.pi, math.pi)
WALL = np.array([[-1.0, 0.0]])


def map_env(cells, start, **options):
    """A robot of 9 px on a map where contacts do not end the episode."""
    options = {"robot_radius": RADIUS, "goal": (20, 20), **options}
    env = Map2DEnv(map=cells, start=start, on_collision="block", **options)
    env.reset(seed=0)
    return env


def walled_map(width=300, height=200, wall=200):
    """An empty map whose columns from `wall` on are occupied."""
    cells = np.zeros((height, width), np.bool_)
    cells[:, wall:] = True
    return cells


def rough_map(seed):
    """A map with boxes, slants and single pixels, free around (20, 20)."""
    random = np.random.default_rng(seed)
    cells = np.zeros((120, 160), np.bool_)
    for _ in range(12):
        x, y, w, h = random.integers((0, 0, 2, 2), (150, 110, 25, 25))
        cells[y : y + h, x : x + w] = True
    rows, columns = np.indices(cells.shape)
    cells |= (rows + 2 * columns) % 330 < 3
    cells[tuple(random.integers((0, 0), cells.shape, (30, 2)).T)] = True
    cells[np.hypot(rows - 20, columns - 20) < 2 * RADIUS] = False
    return cells


class TestVelocity:
    """`slide_velocity`, the rule of a contact."""

    @pytest.mark.parametrize(
        ("heading", "friction", "expected"),
        [
            (0.0, 0.4, 0.0),
            (math.pi / 4, 0.0, math.sqrt(0.5)),
            (math.pi / 4, 0.4, 0.6 * math.sqrt(0.5)),
            (math.pi / 4, 1.0, 0.0),
            (math.radians(60), 0.4, math.sin(math.radians(60)) - 0.4 * 0.5),
        ],
    )
    def test_along_a_wall_friction_takes_its_share(self, heading, friction, expected):
        """Along: what is left of the tangential speed; across: nothing."""
        found = slide_velocity(1.0, heading, 0.0, friction, WALL)
        assert_allclose(found, (0.0, expected), atol=1e-12)

    def test_a_turning_body_rolls_along_a_wall(self):
        """Turning from +x to +y at a wall at +x, towards -y."""
        assert_allclose(slide_velocity(1.0, 0.0, 0.3, 0.4, WALL), (0, -0.3), atol=1e-12)
        assert_allclose(slide_velocity(1.0, 0.0, -5.0, 0.4, WALL), (0, 0.4), atol=1e-12)

    def test_in_a_corner_it_stays(self):
        """Both walls are entered by any motion but away from them."""
        corner = np.array([[-1.0, 0.0], [0.0, -1.0]])
        assert slide_velocity(1.0, 0.7, 0.0, 0.1, corner) == (0.0, 0.0)
        assert_allclose(slide_velocity(1.0, -0.8, 0.0, 0.0, corner)[0], 0.0)
        assert slide_velocity(1.0, -2.0, 0.0, 0.0, corner) == (
            math.cos(-2.0),
            math.sin(-2.0),
        )

    @given(
        speed=st.floats(-2, 2).filter(lambda v: abs(v) > 1e-6),
        heading=ANGLES,
        rim=st.floats(-3, 3),
        friction=st.floats(0, 3),
        walls=st.lists(ANGLES, min_size=1, max_size=3),
    )
    @settings(max_examples=300, deadline=None)
    def test_it_enters_nothing_gains_nothing_and_is_symmetric(
        self, speed, heading, rim, friction, walls
    ):
        """Not into a wall, not faster than commanded, and mirrored if all is."""
        normals = np.array([(math.cos(a), math.sin(a)) for a in walls])
        found = slide_velocity(speed, heading, rim, friction, normals)
        assert (normals @ found >= -1e-8 * abs(speed)).all()
        assert math.hypot(*found) <= abs(speed) * (1 + 1e-12)
        mirrored = slide_velocity(speed, -heading, -rim, friction, normals * (1, -1))
        assert_allclose(mirrored, (found[0], -found[1]), atol=1e-9)


def assert_no_gain(env, before, action, full):
    """No step is longer than the arc of its wheel speeds."""
    length = full * abs(np.clip(action, -1, 1).astype(float).mean())
    assert math.dist(env.pose()[:2], before[:2]) <= length * (1 + 1e-9)


class TestOnMaps:
    def test_a_blocked_robot_turns(self):
        """Its heading changes as commanded although it is pressed against a wall."""
        env = map_env(walled_map(), (180, 100, 0.0))
        for _ in range(20):
            env.step(np.ones(2, np.float32))
        before = env.pose()
        constants = env.robot.constants
        action = np.array([0.125, 1.0], np.float32)
        turn = (0.125 - 1.0) * constants[MAX_SPEED] * constants[DT] / constants[AXLE]
        assert env.step(action)[4]["collision"]
        assert env.pose()[2] - before[2] == pytest.approx(turn, abs=1e-6)
        for _ in range(40):
            info = env.step(action)[4]
        assert not info["collision"]
        assert env.pose()[0] < before[0] - 0.5

    def test_it_slides_along_a_wall(self):
        """At 60 degrees to the normal: sin 60 - 0.4 cos 60 of its speed is left."""
        heading = math.radians(60)
        env = map_env(walled_map(height=900), (185, 100, heading))
        for _ in range(10):
            env.step(np.ones(2, np.float32))
        y, step = env.pose()[1], env.task.full_step
        for _ in range(50):
            assert env.step(np.ones(2, np.float32))[4]["collision"]
        expected = 50 * step * (math.sin(heading) - 0.4 * math.cos(heading))
        assert env.pose()[1] - y == pytest.approx(expected, rel=1e-5)
        assert 0.0 <= 199.5 - RADIUS - env.pose()[0] < 2e-6

    def test_it_gets_out_of_a_corner(self):
        """Driven into a corner it stays; while it turns it finds the way out."""
        cells = walled_map()
        cells[150:] = True
        env = map_env(cells, (180, 130, math.pi / 4))
        for _ in range(20):
            env.step(np.ones(2, np.float32))
        assert_allclose(env.pose()[:2], (199.5 - RADIUS, 149.5 - RADIUS), atol=1e-5)
        for _ in range(60):
            info = env.step(np.array([0.3, 1.0], np.float32))[4]
        assert not info["collision"]
        assert env.pose()[1] < 149.5 - RADIUS - 1

    @pytest.mark.parametrize(
        "seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 8))]
    )
    def test_it_never_enters_an_obstacle(self, seed):
        """Random commands among boxes, slants and single pixels."""
        cells, random = rough_map(seed), np.random.default_rng(seed)
        env = map_env(cells, (20, 20, 0.5), goal=(21, 21), goal_tolerance=1e-6)
        touched = 0
        for _ in range(60):
            action = random.uniform(-1, 1, 2).astype(np.float32)
            for _ in range(12):
                before = env.pose()
                touched += env.step(action)[4]["collision"]
                assert distance(cells, *env.pose()[:2]) >= RADIUS - 1e-6
                assert_no_gain(env, before, action, env.task.full_step)
        assert touched > 50

    def test_without_contact_it_drives_as_always(self):
        """To the bit, up to the first contact."""
        cells, random = rough_map(3), np.random.default_rng(3)
        block = map_env(cells, (20, 20, 0.5), goal=(23, 20), goal_tolerance=0.1)
        stop = Map2DEnv(
            cells, (20, 20, 0.5), (23, 20), goal_tolerance=0.1, robot_radius=9
        )
        stop.reset(seed=0)
        for _ in range(400):
            action = random.uniform(-1, 1, 2).astype(np.float32)
            if stop.step(action)[4]["collision"]:
                break
            block.step(action)
            assert stop.pose().tolist() == block.pose().tolist()

    @pytest.mark.parametrize(
        "seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 6))]
    )
    def test_left_and_right_are_alike(self, seed):
        """On the mirrored map with exchanged wheels it drives the mirrored way."""
        cells, random = rough_map(seed), np.random.default_rng(seed)
        height = cells.shape[0] - 1
        one = map_env(cells, (20, 20, 0.5), goal=(23, 20), goal_tolerance=0.1)
        start, goal = (20, height - 20, -0.5), (23, height - 20)
        two = map_env(cells[::-1], start, goal=goal, goal_tolerance=0.1)
        for _ in range(150):
            action = random.uniform(-0.3, 1, 2).astype(np.float32)
            one.step(action)
            two.step(action[::-1])
            x, y, heading = one.pose()
            mirrored = two.pose() * (1, -1, -1) + (0, height, 0)
            assert_allclose(mirrored[:2], (x, y), atol=1e-4)
            assert math.cos(mirrored[2] - heading) > 1 - 1e-6


def box_world(friction):
    """An e-puck in a square arena of 1 m, with boxes and a pillar."""
    return read_world(
        f"""#VRML_SIM R2023b utf8
WorldInfo {{ contactProperties [
  ContactProperties {{ coulombFriction [ {friction} ] }} ] }}
RectangleArena {{ floorSize 1 1 }}
E-puck {{ }}
WoodenBox {{ translation 0.2 0.1 0.05 rotation 0 0 1 0.4 size 0.1 0.1 0.1 }}
WoodenBox {{ translation -0.2 0.1 0.05 size 0.1 0.1 0.1 }}
Solid {{ translation 0 -0.2 0.05
  boundingObject Cylinder {{ radius 0.05 height 0.1 }} }}
""",
        goal=(0.4, 0.4),
    )


class TestAmongSolids:
    def test_the_coefficient_is_that_of_the_world(self):
        """Between default materials; 1, as in Webots, if the file has none."""
        assert box_world(0.25).friction == 0.25
        assert box_world(-1).friction == 1000.0
        other = box_world(0.5).__class__()
        assert other.friction == 1.0

    # It may reach the goal and drive on.
    @pytest.mark.filterwarnings("ignore:.*the episode has ended")
    @pytest.mark.parametrize("friction", [0.0, 0.4, 1.0])
    def test_it_never_enters_a_solid(self, friction):
        """Random commands among boxes, a pillar and walls."""
        env = EPuckEnv(box_world(friction), on_collision="block", dt=0.064)
        env.reset(seed=0)
        solid, random = env.nominal.ground.solid, np.random.default_rng(1)
        touched = 0
        for _ in range(150):
            action = random.uniform(-0.4, 1, 2).astype(np.float32)
            for _ in range(10):
                before = env.pose()
                touched += env.step(action)[4]["collision"]
                x, y, _ = env.pose()
                assert nearest_gap(*solid.arrays(), x, y) >= BODY_RADIUS - 1e-6
                assert_no_gain(env, before, action, env.task.full_step)
        assert touched > 50

    def test_a_blocked_robot_turns(self):
        """It turns as commanded and drives away."""
        env = EPuckEnv(box_world(1.0), (0.44, 0.0, 0.0), on_collision="block")
        env.reset(seed=0)
        for _ in range(30):
            env.step(np.ones(2, np.float32))
        before, action = env.pose(), np.array([-0.125, 1.0], np.float32)
        assert env.step(action)[4]["collision"]
        speed = env.nominal.max_wheel_speed * WHEEL_RADIUS * env.nominal.dt
        turn = 1.125 * speed / env.task.axle_length
        assert env.pose()[2] - before[2] == pytest.approx(turn, abs=1e-6)
        for _ in range(60):
            info = env.step(action)[4]
        assert not info["collision"]

    @pytest.mark.parametrize("friction", [0.1, 0.4])
    @pytest.mark.parametrize("heading", [0.6, -0.9, 1.2])
    def test_the_rule_is_the_limit_of_rigid_body_dynamics(self, friction, heading):
        """The physics engine slides as fast along a wall, within 2 %."""
        pytest.importorskip("pymunk")
        world = read_world(
            "#VRML_SIM R2023b utf8\nE-puck { }\n"
            "Wall { translation 0.3 0 0 size 0.2 9 .1 }\n"
            'Floor { contactMaterial "rubber" }',  # on which the tyres have a grip of 1
            goal=(-0.1, 0.0),
        )
        world = replace(world, contacts=(Contact(friction=friction),))
        ground = EPuckEnv(world).nominal.ground
        state, speed = np.array([0.16, 0.0, heading]), np.zeros(3)
        forward = 0.1 * 0.032
        ys = []
        for _ in range(60):
            push(
                ground.solid, ground, state, speed, np.zeros((0, 6)),
                CommandedArc(forward, 0.0, 0.032),
            )  # fmt: skip
            ys.append(state[1])
        _, expected = slide_velocity(forward, heading, 0.0, friction, WALL)
        assert ys[-1] - ys[-2] == pytest.approx(expected, rel=0.02, abs=1e-6)
