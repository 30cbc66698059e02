"""Promises of TDAC-EPuck-v0 beyond those of every registered env."""

import hashlib
import json
import math
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from simple_policies import drive
from world_texts import text

from tdac_envs import TaskError, WorldError, bundled_worlds, read_world
from tdac_envs.epuck.env import EPuckEnv

FULL = np.ones(2, np.float32)
LEFT_TURN = np.array([-1.0, 1.0], np.float32)
SPEED, RATE = 6.28 * 0.02, 2 * 6.28 * 0.02 / 0.057
TEN_SECONDS = 313


def open_env(*nodes, start=(0.0, 0.0, 0.3), goal=(3.0, 3.0), **options):
    """A plain without walls, but for some nodes."""
    world = read_world(text("E-puck { }", *nodes))
    return EPuckEnv(world, start, goal, **options)


def walled_env(thickness=0.002, **options):
    """A thin wall across the way from (0, 0) to (0.6, 0), open at its ends."""
    wall = f"Wall {{ translation 0.3 0 0 size {thickness} 0.4 0.1 }}"
    options = {"start": (0.0, 0.0, 0.0), "goal": (0.6, 0.0), **options}
    return open_env(wall, **options)


def drive_square(env, axle, side):
    """Drives sides and left turns by wheel angles alone, with an axle as believed."""
    angles, step = env.reset(seed=0)[0]["wheel_positions"], 6.28 * env.task.dt
    for leg in range(8):
        turns = leg % 2
        goal = (math.pi / 4 * axle if turns else side) / 0.02  # of the right wheel
        begin = angles[1]
        while (left := goal - (angles[1] - begin)) > 1e-4:
            right = min(left / step, 1.0)
            action = np.array([-right if turns else right, right], np.float32)
            angles = env.step(action)[0]["wheel_positions"]


class TestMotion:
    """Closed forms over 10 s, within 1e-6 m and rad."""

    @pytest.mark.parametrize("speed", [1.0, 0.37, -0.5])
    def test_straight(self, speed):
        floor = "RectangleArena { floorSize 6 6 }"
        env = open_env(floor, start=(1.0, 1.0, 0.3), goal=(2.0, 2.0))
        env.reset(seed=0)
        for k in range(1, TEN_SECONDS + 1):
            env.step(np.full(2, speed, np.float32))
            way = float(np.float32(speed)) * SPEED * 0.032 * k
            x, y = 1.0 + way * math.cos(0.3), 1.0 + way * math.sin(0.3)
            assert env.pose() == pytest.approx([x, y, 0.3], abs=1e-6)

    @pytest.mark.parametrize(
        "wheels", [(0.5, 0.75), (0.75, 0.5), (-0.5, 0.25), (-1.0, -0.25), (0.0, 1.0)]
    )
    def test_arc(self, wheels):
        """A circle of radius axle / 2 (right + left) / (right - left)."""
        left, right = wheels
        rate = (right - left) * SPEED / 0.057
        radius = 0.0285 * (right + left) / (right - left)
        env = open_env(start=(1.0, 1.0, 0.3))
        env.reset(seed=0)
        for k in range(1, TEN_SECONDS + 1):
            env.step(np.array(wheels, np.float32))
            heading = 0.3 + rate * 0.032 * k
            x = 1.0 + radius * (math.sin(heading) - math.sin(0.3))
            y = 1.0 - radius * (math.cos(heading) - math.cos(0.3))
            at = env.pose()
            assert at[:2] == pytest.approx([x, y], abs=1e-6)
            assert math.remainder(at[2] - heading, 2 * math.pi) == pytest.approx(
                0.0, abs=1e-6
            )

    def test_turn_in_place(self):
        """The right wheel forward turns left: the heading grows."""
        env = open_env()
        env.reset(seed=0)
        for k in range(1, TEN_SECONDS + 1):
            env.step(LEFT_TURN)
            x, y, heading = env.pose()
            assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-12)
            off = math.remainder(heading - 0.3 - RATE * 0.032 * k, 2 * math.pi)
            assert off == pytest.approx(0.0, abs=1e-6)
        assert -math.pi < heading <= math.pi

    def test_wheel_positions_follow_the_wheels(self):
        env = open_env()
        env.reset(seed=0)
        for _ in range(100):
            observation, *_ = env.step(np.array([0.5, -0.25], np.float32))
        turned = 100 * 0.032 * 6.28 * np.array([0.5, -0.25])
        np.testing.assert_allclose(observation["wheel_positions"], turned, rtol=1e-6)

    @pytest.mark.parametrize(
        ("fields", "degrees"), [("", 250.5), ("kinematic TRUE", 274.6)]
    )
    def test_a_spin_of_one_second(self, fields, degrees):
        """Full opposite speeds turn it as in Webots: on the rims of its wheels.

        Without physics, Webots moves it by the distance of the joints.
        """
        env = EPuckEnv(read_world(text(f"E-puck {{ {fields} }}"), goal=(1.0, 1.0)))
        env.reset(seed=0)
        turned = 0.0
        for _ in range(31):  # 0.992 s: whole steps of 32 ms
            before = env.pose()[2]
            env.step(LEFT_TURN)
            turned += math.remainder(env.pose()[2] - before, 2 * math.pi)
        assert math.degrees(turned) == pytest.approx(degrees, abs=1.0)

    @pytest.mark.parametrize(("axle", "returns"), [(0.057, True), (0.052, False)])
    def test_a_square_by_dead_reckoning(self, axle, returns):
        """Who believes in the effective axle gets back, who believes in 52 mm does not.

        Back is within 20 mm and 6° of the start, after four sides of 0.3 m.
        """
        env = open_env(start=(0.0, 0.0, 0.0))
        drive_square(env, axle, side=0.3)
        x, y, heading = env.pose()
        back = math.hypot(x, y) < 0.02 and abs(math.degrees(heading)) < 6.0
        assert back == returns

    def test_an_epuck_of_version_2_is_faster(self):
        world = read_world(text('E-puck { version "2" }'), goal=(1.0, 1.0))
        assert EPuckEnv(world).task.max_wheel_speed == 7.536
        assert EPuckEnv(world, max_wheel_speed=3).task.max_wheel_speed == 3.0


class TestContact:
    @pytest.mark.parametrize("dt", [0.008, 0.032, 0.5])
    @pytest.mark.parametrize("slant", [-0.4, -0.1, 0.0, 0.25])
    def test_no_tunnel_through_a_wall_of_2_mm(self, slant, dt):
        """At full speed and any step it stops within 1 mm of touching."""
        env = walled_env(start=(0.0, 0.0, slant), dt=dt)
        env.reset(seed=0)
        _, _, terminated, _, info = drive(env, FULL)
        assert terminated
        assert info["collision"]
        x, y, _ = env.pose()
        assert 0.0 <= 0.299 - 0.037 - x < 1e-3
        assert abs(y - x * math.tan(slant)) < 1e-9
        assert 0.037 <= info["clearance"] < 0.038

    def test_a_corner_is_met_where_it_is(self):
        """The end of the wall, at (0.299, 0.2)."""
        env = walled_env(start=(0.0, 0.22, 0.0))
        env.reset(seed=0)
        drive(env, FULL)
        assert math.dist(env.pose()[:2], (0.299, 0.2)) == pytest.approx(0.037, abs=1e-6)

    def test_the_fence_around_a_plain_stops_the_robot(self):
        """Half a metre beyond everything; all poses are in their space."""
        env = open_env(start=(0.0, 0.0, math.pi), on_collision="block")
        env.reset(seed=0)
        for _ in range(200):
            observation, *_ = env.step(FULL)
            assert observation in env.observation_space
        assert env.pose()[0] == pytest.approx(-0.5 + 0.037, abs=1e-6)

    def test_other_epucks_stand_in_the_way(self):
        other = 'E-puck { name "other" translation 0.3 0 0 }'
        env = open_env(other, start=(0, 0, 0), goal=(0.6, 0.0))
        env.reset(seed=0)
        drive(env, FULL)
        assert env.pose()[0] == pytest.approx(0.3 - 0.074, abs=1e-6)

    def test_low_and_high_things_are_driven_under_or_over(self):
        low = "Solid { translation .2 0 0 boundingObject Box { size .05 1 .002 } }"
        high = "Solid { translation .3 0 .1 boundingObject Box { size .05 1 .05 } }"
        env = open_env(low, high, start=(0, 0, 0), goal=(0.6, 0.0))
        env.reset(seed=0)
        assert drive(env, FULL)[4]["is_success"]


class TestPath:
    def test_its_length_is_that_of_the_true_shortest_or_a_little_more(self):
        """Around the end of a wall: tangent, arc, tangent; at most 8.3 % + 10 mm."""
        env = walled_env()
        reach = math.hypot(0.299, 0.2)
        turn = math.atan2(0.2, 0.299) + math.asin(0.037 / reach)
        true = 2 * (math.sqrt(reach**2 - 0.037**2) + 0.037 * turn) + 0.002
        assert true - 1e-3 < env.task.shortest < 1.083 * true + 0.01

    def test_on_the_grid_it_is_straight(self):
        env = open_env(start=(0.0, 0.0, 0.0), goal=(1.0, 0.0))
        assert env.task.shortest == pytest.approx(1.0, abs=0.006)
        env = open_env(start=(0.0, 0.0, 0.0), goal=(1.0, 1.0))
        assert env.task.shortest == pytest.approx(2**0.5, abs=0.006)

    def test_no_point_of_a_path_is_too_near(self):
        for name in bundled_worlds():
            task = EPuckEnv(name).task
            path = task.path_from(task.start)
            assert min(task.ground.gap(x, y) for x, y in path) >= 0.037


class TestArguments:
    @pytest.mark.parametrize(
        ("given", "error", "message"),
        [
            ({"world": "areno"}, WorldError, "did you mean 'arena'"),
            ({"world": "missing.wbt"}, WorldError, "no such file"),
            (
                {"start": (5, 5)},
                TaskError,
                "no free path .* the start is outside the arena's wall",
            ),
            (
                {"start": (0.3, -0.14, 0)},
                TaskError,
                r"^move the start to \(.*: start .* lies in an obstacle$",
            ),
            (
                {"start": (0.145, 0.3)},
                TaskError,
                "mm from an obstacle, too near for a b",
            ),
            ({"start": (1,)}, TaskError, "expected start to be 3 finite numbers"),
            ({"goal": (-0.5, -0.12)}, TaskError, "goal .* lies in an obstacle"),
            ({"goal": (-0.62, 0.41)}, TaskError, "the start is already at the goal"),
            ({"goal": "ab"}, TaskError, "expected goal to be 2 finite numbers"),
            ({"goal_tolerance": 0}, TaskError, "expected goal_tolerance above 0"),
            ({"dt": 0}, TaskError, "expected dt above 0"),
            ({"horizon": 0}, TaskError, "expected horizon to be a whole number from 1"),
            ({"max_wheel_speed": -1}, TaskError, "expected max_wheel_speed above 0"),
            ({"on_collision": "stop"}, TaskError, "on_collision to be one of 'termin"),
            ({"variation": "wild"}, TaskError, "variation to be one of 'nominal', 'j"),
            ({"reflectance": 0.5}, TaskError, "reflectance to be one of 'ideal', 'we"),
            ({"sensor_noise": -1}, TaskError, "expected sensor_noise of at least 0"),
            ({"wheel_slip": math.nan}, TaskError, "expected wheel_slip to be"),
            ({"motor_lag": -1}, TaskError, "expected motor_lag of at least 0"),
            ({"delay": 0.5}, TaskError, "expected delay to be a whole number from 0"),
            ({"ignore": "Wall"}, TaskError, "expected ignore to be a list of names"),
            ({"ignore": ["Wal"]}, WorldError, "no node called 'Wal' to ignore"),
            ({"render_mode": "ansi"}, TaskError, "render_mode to be one of None, 'rg"),
        ],
    )
    def test_what_cannot_be_used_is_named(self, given, error, message):
        with pytest.raises(error, match=message):
            EPuckEnv(**given)

    def test_a_world_without_goal_or_robot_asks_for_them(self):
        empty = read_world(text("RectangleArena { floorSize 2 2 }"))
        with pytest.raises(TaskError, match="has no goal; give goal="):
            EPuckEnv(empty)
        with pytest.raises(TaskError, match="no e-puck; give start="):
            EPuckEnv(empty, goal=(0.5, 0.5))
        assert EPuckEnv(empty, (-0.5, 0, 0), (0.5, 0.5)).task.shortest > 1.0

    def test_separate_rooms_and_narrow_ways_are_refused(self):
        walls = [
            f'Wall {{ name "{k}" translation 0 {y} 0 size 0.02 0.97 0.1 }}'
            for k, y in enumerate((0.515, -0.515))
        ]
        arena = "RectangleArena { floorSize 2 2 }"
        world = read_world(text(arena, "E-puck { translation -.5 0 0 }", *walls))
        message = "the widest body that gets through has a radius of 30.. mm"
        with pytest.raises(TaskError, match=message):
            EPuckEnv(world, goal=(0.5, 0.0))
        whole = "Wall { size 0.02 2 0.1 }"
        world = read_world(text(arena, "E-puck { translation -.5 0 0 }", whole))
        with pytest.raises(TaskError, match="they are in separate rooms"):
            EPuckEnv(world, goal=(0.5, 0.0))

    def test_what_is_not_modelled_is_refused_unless_ignored(self):
        world = read_world(text("E-puck { }", "Castle { }"), goal=(1.0, 0.0))
        with pytest.raises(WorldError, match="1 node may be solid but is not modelled"):
            EPuckEnv(world)
        assert EPuckEnv(world, ignore=["Castle"]).task.goal == (1.0, 0.0)

    def test_the_step_is_that_of_the_file(self):
        world = read_world(text("E-puck { }", info="basicTimeStep 16"), goal=(1, 0))
        assert EPuckEnv(world).task.dt == 0.016
        assert EPuckEnv(world).metadata["render_fps"] == 62

    def test_a_file_by_its_path(self, tmp_path):
        file = tmp_path / "mine.wbt"
        goal = "DEF GOAL Pose { translation 0.5 0 0 }"
        file.write_text(text("E-puck { }", goal))
        env = gym.make("TDAC-EPuck-v0", world=str(file), start=[0, 0.1])
        assert env.unwrapped.task.goal == (0.5, 0.0)
        assert env.unwrapped.task.start == (0.0, 0.1, 0.0)
        json.loads(env.spec.to_json())


TRAJECTORY = """
import hashlib, numpy as np
from tdac_envs.epuck.env import EPuckEnv
env = EPuckEnv({world!r}, on_collision="block", variation="jitter", sensor_noise=1.0,
               wheel_slip=0.1, motor_lag=0.05, delay=1)
digest, rng = hashlib.sha256(), np.random.default_rng(4)
observation, _ = env.reset(seed=11)
for _ in range(40):
    action = rng.uniform(-0.2, 1.0, 2)
    for _ in range(10):
        observation, reward, *_ = env.step(action)
        for value in observation.values():
            digest.update(value.tobytes())
        digest.update(np.float64(reward).tobytes())
        digest.update(env.pose().tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
@pytest.mark.parametrize("world", ["crates", "arena"])
def test_equal_seeds_give_equal_bits_in_separate_processes(world):
    """Observations, rewards and poses, with all noise, pushing things."""
    command = [sys.executable, "-c", TRAJECTORY.format(world=world)]
    runs = [
        subprocess.run(command, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert len(runs[0].strip()) == len(hashlib.sha256().hexdigest())
    assert runs[0] == runs[1]


@pytest.mark.slow
def test_importing_the_package_imports_no_physics():
    """Nor anything else that is heavy; making an env that pushes nothing neither."""
    source = """
import sys, tdac_envs
heavy = {"pymunk", "numba", "cv2", "scipy", "torch"} & set(sys.modules)
import gymnasium
gymnasium.make("TDAC-EPuck-v0", on_collision="block").reset()
print(sorted(heavy), "pymunk" in sys.modules)
"""
    command = [sys.executable, "-c", source]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "False"]


def wander(env, steps, seed=0):
    """Random actions, each held for a while; every observation is in its space."""
    rng = np.random.default_rng(seed)
    observation, _ = env.reset(seed=seed)
    space = env.observation_space
    for k in range(steps):
        if k % 25 == 0:
            action = rng.uniform(-1, 1, 2).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        values = np.concatenate(list(observation.values()))
        assert np.isfinite(values).all()
        assert math.isfinite(reward + info["clearance"] + info["path_distance"])
        assert info["clearance"] > 0.036
        if k % 100 == 0:
            assert observation in space
        if terminated or truncated:
            env.reset()


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", bundled_worlds())
def test_random_steps_are_finite_and_stay_out_of_things(name):
    """In the space, and no deeper than 1 mm in anything."""
    wander(EPuckEnv(name, on_collision="block", sensor_noise=1.0), 3000)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "steps"), [("arena", 900_000), ("crates", 100_000)])
def test_a_million_random_steps(name, steps):
    wander(EPuckEnv(name, on_collision="block", sensor_noise=1.0), steps, seed=1)
