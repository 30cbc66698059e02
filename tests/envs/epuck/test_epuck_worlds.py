"""Promises of the bundled worlds, of pushing, and of pictures of the e-puck."""

import math

import numpy as np
import pytest
from world_texts import text

from tdac_envs import bundled_worlds, load_world, read_world, write_world
from tdac_envs.drawing.canvas import AMBER, TRAIL
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import sees
from tdac_envs.epuck.picture import ray_colour
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.footprint import Disc, Rectangle

FULL = np.ones(2, np.float32)
every_world = pytest.mark.parametrize("name", bundled_worlds())


class TestBundled:
    def test_there_are_several_kinds(self):
        worlds = {name: load_world(world_file(name)) for name in bundled_worlds()}
        assert len(worlds) >= 6
        assert bundled_worlds()[0] == "arena"
        insides = {type(world.arena.inside) for world in worlds.values()}
        assert insides == {Disc, Rectangle}
        assert any('"NUE"' in world_file(name).read_text() for name in worlds)
        assert any(t.mass for world in worlds.values() for t in world.obstacles)

    @pytest.mark.slow_after(5)
    @every_world
    def test_everything_is_modelled(self, name):
        world = load_world(world_file(name))
        assert world.unmodelled == ()
        assert world.notes == ()
        assert read_world(write_world(world)) == world

    @every_world
    def test_the_straight_line_to_the_goal_is_blocked(self, name):
        task = EPuckEnv(name).task
        solid = task.ground.solid
        line = (*task.start[:2], *task.goal)
        assert not sees(*solid.arrays(), *line)
        assert task.shortest > 1.04 * math.dist(task.start[:2], task.goal)

    @every_world
    def test_turning_in_place_and_straight_on_leads_there(self, name):
        """Along the shortest path, without a contact, within the horizon."""
        env = EPuckEnv(name)
        env.reset(seed=0)
        task = env.task
        for point in corners(task.path_from(task.start)):
            info = go_to(env, point)
            if info["is_success"]:
                break
        assert info["is_success"]
        assert info["collisions"] == 0


def corners(path):
    """The points of a path at which it turns, and its end."""
    ways = np.diff(path, axis=0)
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-12)
    turns = np.linalg.norm(np.diff(ways, axis=0), axis=1) > 1e-6
    return [*path[1:-1][turns], path[-1]]


def go_to(env, point):
    """Turns in place, then drives straight to a point; the info at the end."""
    task = env.task
    info = {"is_success": False, "collisions": 0}
    full_turn = 2 * task.full_step / task.axle_length
    while not info["is_success"]:
        x, y, heading = env.pose()
        way = math.dist((x, y), point)
        off = math.remainder(math.atan2(point[1] - y, point[0] - x) - heading, math.tau)
        if way < 1e-6:
            break
        if abs(off) > 1e-5:
            turn = max(min(off / full_turn, 1.0), -1.0)
            action = (-turn, turn)
        else:
            speed = min(way / task.full_step, 1.0)
            action = (speed, speed)
        _, _, terminated, truncated, info = env.step(action)
        assert not truncated
        assert info["is_success"] or not terminated
    return info


def pushing_env(*nodes, mass=0.05, **options):
    """A box of 10 cm with a mass, 15 cm ahead of the robot."""
    box = f"""WoodenBox {{ translation 0.2 0 0.05 size 0.1 0.1 0.1 mass {mass} }}"""
    world = read_world(text("E-puck { }", box, *nodes), goal=(0.0, 1.0))
    return EPuckEnv(world, on_collision="block", **options)


def contact(material, friction):
    """The friction of a material with the default one."""
    fields = f'material1 "{material}" coulombFriction {friction}'
    return f"contactProperties ContactProperties {{ {fields} }}"


def box_env(robot, mass, *nodes, more="", info=""):
    """A box of 10 cm with a mass, just ahead of a robot, and further nodes."""
    fields = f"translation 0.1 0 0.05 size 0.1 0.1 0.1 {more}"
    box = f"SolidBox {{ {fields} physics Physics {{ density -1 mass {mass} }} }}"
    world = read_world(text(robot, box, *nodes, info=info), goal=(0.0, 1.0))
    return EPuckEnv(world, on_collision="block")


def pushed(robot, mass, *nodes, **more):
    """How far the box of `box_env` gets in 3 s at full speed, m."""
    env = box_env(robot, mass, *nodes, **more)
    env.reset(seed=0)
    for _ in range(94):
        env.step(FULL)
    return box_pose(env)[0] - 0.1


def box_pose(env):
    return env._movables.things[0, :3]


class TestPushing:
    def test_a_light_box_is_pushed_along(self):
        """It stays ahead of the robot, in touch, and goes as far."""
        env = pushing_env()
        env.reset(seed=0)
        for _ in range(100):
            observation, *_, info = env.step(FULL)
        x, y, _ = env.pose()
        assert info["collisions"] > 50
        assert x > 0.25
        assert abs(y) < 0.01
        assert box_pose(env)[0] - 0.05 - 0.037 == pytest.approx(x, abs=2e-3)
        assert observation["ps"][[0, 7]].min() > 1000

    def test_it_stops_where_it_is_left(self):
        """Friction ends its motion within two steps; the sensors see it go far."""
        env = pushing_env()
        env.reset(seed=0)
        for _ in range(60):
            env.step(FULL)
        for _ in range(3):
            env.step(-FULL)
        left = box_pose(env).copy()
        for _ in range(20):
            observation, *_ = env.step(-FULL)
        np.testing.assert_array_equal(box_pose(env), left)
        assert observation["ps"][0] < 68
        assert np.abs(env._movables.things[:, 3:]).max() == 0.0

    def test_a_heavy_box_stays(self):
        """More friction than the tyres have grip: it moves by less than 1 mm."""
        env = pushing_env(mass=5.0)
        env.reset(seed=0)
        for _ in range(150):
            env.step(FULL)
        assert np.abs(box_pose(env) - (0.2, 0, 0)).max() < 1e-3
        assert env.pose()[0] == pytest.approx(0.15 - 0.037, abs=1e-3)

    @pytest.mark.parametrize(
        ("version", "mass", "moves"),
        [
            ("1", 0.155, True),
            ("1", 0.165, False),
            ("2", 0.135, True),
            ("2", 0.145, False),
        ],
    )
    def test_it_pushes_what_is_lighter_than_itself(self, version, mass, moves):
        """With Webots' default friction of 1 for tyres and objects alike."""
        assert (pushed(f'E-puck {{ version "{version}" }}', mass) > 0.05) == moves

    @pytest.mark.parametrize(("friction", "moves"), [(0.25, True), (0.4, False)])
    def test_the_ground_friction_is_that_of_the_materials(self, friction, moves):
        """0.5 kg on ice slide if the friction is below 0.16 / 0.5."""
        info = contact("ice", friction)
        found = pushed("E-puck { }", 0.5, info=info, more='contactMaterial "ice"')
        assert (found > 0.05) == moves

    def test_a_slippery_floor_stalls_the_tyres(self):
        """On ice the robot pushes less than on the floor, if the box does not slip."""
        ice = 'RectangleArena { floorSize 4 4 contactMaterial "ice" }'
        info = contact("ice", 0.25)
        rubber = 'contactMaterial "rubber"'
        assert pushed("E-puck { }", 0.1, ice, info=info) > 0.05
        assert pushed("E-puck { }", 0.1, ice, info=info, more=rubber) < 0.01

    @pytest.mark.parametrize(("friction", "slides"), [(0.0, True), (1.0, False)])
    def test_the_friction_of_the_body_is_that_of_the_materials(self, friction, slides):
        """A robot that drives askew at a heavy box slides along it if it is slick."""
        robot, info = "E-puck { rotation 0 0 1 0.3 }", contact("slick", friction)
        env = box_env(robot, 9.0, info=info, more='contactMaterial "slick"')
        env.reset(seed=0)
        for _ in range(40):
            env.step(FULL)
        assert (env.pose()[1] > 0.02) == slides

    @pytest.mark.slow
    def test_a_box_against_a_wall_stays(self):
        """Neither the box nor the robot gets more than 1 mm into anything."""
        env = pushing_env("Wall { translation 0.32 0 0 size 0.002 1 0.1 }")
        env.reset(seed=0)
        for _ in range(200):
            info = env.step(FULL)[4]
            assert info["clearance"] > 0.036
        assert box_pose(env)[0] == pytest.approx(0.319 - 0.05, abs=1e-3)
        assert env.pose()[0] == pytest.approx(0.319 - 0.1 - 0.037, abs=2e-3)

    def test_off_its_middle_a_box_turns(self):
        """Pushed at its right end, it turns to the left."""
        env = pushing_env(start=(0.0, -0.04, 0.0))
        env.reset(seed=0)
        for _ in range(60):
            env.step(FULL)
        assert box_pose(env)[2] > 0.2

    def test_a_reset_puts_everything_back(self):
        env = pushing_env()
        first, _ = env.reset(seed=0)
        start = [env.step(FULL)[0] for _ in range(80)]
        again, _ = env.reset(seed=0)
        assert box_pose(env).tolist() == [0.2, 0.0, 0.0]
        np.testing.assert_array_equal(first["ps"], again["ps"])
        for expected in start:
            found, *_ = env.step(FULL)
            for key in expected:
                np.testing.assert_array_equal(found[key], expected[key])

    def test_by_default_a_contact_ends_the_episode(self):
        """And nothing is pushed."""
        env = EPuckEnv(pushing_env().nominal.ground.world)
        env.reset(seed=0)
        while True:
            _, _, terminated, _, info = env.step(FULL)
            if terminated:
                break
        assert info["collision"]
        assert env.pose()[0] == pytest.approx(0.15 - 0.037, abs=1e-6)

    def test_envs_of_one_world_do_not_push_each_others_things(self):
        one, two = pushing_env(), pushing_env()
        one.reset(seed=0)
        for _ in range(80):
            one.step(FULL)
        assert one.nominal.ground is two.nominal.ground
        assert two.reset(seed=0)[1]["clearance"] == pytest.approx(0.15)


class TestPicture:
    def frame(self, *nodes, start=(0.0, 0.0, 0.0), steps=0, **options):
        world = read_world(
            text("RectangleArena { floorSize 1 1 }", "E-puck { }", *nodes),
            goal=(0.35, 0.35),
        )
        env = EPuckEnv(world, start, render_mode="rgb_array", **options)
        env.reset(seed=0)
        for _ in range(steps):
            if any(env.step(FULL)[2:4]):
                break
        return env.render().astype(int)

    def places(self, image, colour, near=6):
        """Rows and columns of pixels of a colour, above the strip."""
        found = np.abs(image[:-64] - colour).max(axis=2) <= near
        return np.nonzero(found)

    def test_x_is_right_and_y_is_up(self):
        """A robot at (0.3, 0.2) is right of the middle, and above it."""
        image = self.frame(start=(0.3, 0.2, 0.0))
        rows, columns = self.places(image, TRAIL)
        assert columns.mean() > image.shape[1] / 2 + 100
        assert rows.mean() < (image.shape[0] - 64) / 2 - 50

    @pytest.mark.parametrize("heading", [0.0, 2.0])
    def test_what_is_on_the_left_is_seen_on_the_left_of_the_picture(self, heading):
        """A wall on the robot's left: ps5 reads most, and its ray on the picture is
        coloured on the left of one who looks along the heading.
        """
        side = np.array([-math.sin(heading), math.cos(heading)])
        x, y = 0.075 * side
        wall = (
            f"Wall {{ translation {x} {y} 0 rotation 0 0 1 {heading} "
            "size 0.3 0.02 0.1 }"
        )
        image = self.frame(wall, start=(0.0, 0.0, heading))
        env = EPuckEnv(
            read_world(text("E-puck { }", wall), goal=(1.0, 1.0)), (0.0, 0.0, heading)
        )
        readings = env.reset(seed=0)[0]["ps"]
        assert readings.argmax() == 5
        rows, columns = self.places(image, ray_colour(float(readings[5])), near=40)
        centre = np.array([image.shape[1] / 2, (image.shape[0] - 64) / 2])
        off = np.column_stack([columns - centre[0], centre[1] - rows])
        off = off[np.hypot(*off.T) < 90]
        assert len(off) > 20
        assert (off @ side).mean() > 15

    def test_colours_tell_how_near_a_thing_is(self):
        quiet, near, touch = ray_colour(67.19), ray_colour(374.0), ray_colour(4095.0)
        assert quiet[2] > quiet[0]
        assert np.abs(np.subtract(near, AMBER)).max() < 12
        assert touch[0] > 180
        assert touch[1] < 60

    def test_the_trail_and_the_robot_move(self):
        before, after = self.frame(), self.frame(steps=60)
        assert (before != after).any()
        _, columns = self.places(after, TRAIL, near=45)
        assert np.ptp(columns) > 120

    def test_a_pushed_box_is_drawn_where_it_is(self):
        box = "WoodenBox { translation 0.12 0 0.05 size 0.1 0.1 0.1 mass 0.05 }"
        wood = (190, 146, 94)
        means = [
            self.places(self.frame(box, steps=n, on_collision="block"), wood)[1].mean()
            for n in (0, 60)
        ]
        assert means[1] > means[0] + 60

    def test_a_collision_is_marked(self):
        wall = "Wall { translation 0.1 0 0 size 0.02 0.5 0.1 }"
        quiet, hit = self.frame(wall), self.frame(wall, steps=30)
        red = (208, 38, 52)
        assert len(self.places(hit, red)[0]) > len(self.places(quiet, red)[0]) + 50


def test_equal_worlds_share_what_is_computed():
    one, two = EPuckEnv("room"), EPuckEnv("room", on_collision="block")
    assert one.task.ground is two.task.ground
    assert one.task.field is two.task.field
    assert Ground.of(one.task.ground.world) is one.task.ground
