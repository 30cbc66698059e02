"""Promises of `physics="mujoco-rays"`: MuJoCo also measures the distance sensors."""

import math
import pickle
import sys

import gymnasium as gym
import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.worlds.footprint import Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, World

POSES = 1000
WITH_RAYS = "mujoco-rays", {"engine": "mujoco", "rays": "mujoco"}


def moved_to(env, pose):
    """The env's robot at a pose, with new readings."""
    env.robot.state[:3] = pose
    env._call_begin()


@pytest.mark.parametrize(
    "options",
    [
        {"map": "maze"},
        {"map": "office", "n_rays": 7, "field_of_view": 360.0},
        {"scanner_offset": (6.0, 3.0), "range_max": 90.0},
        {"ray_angles": (-0.3, 0.0, 0.1, 2.0, -2.9)},
    ],
)
def test_ranges_on_maps_are_those_of_the_exact_rays(options):
    """On 250 poses of each of four robots, 1,000 in all: to 1 µm of the robot."""
    pytest.importorskip("mujoco")
    here = Map2DEnv(**options)
    there = Map2DEnv(**options, physics="mujoco-rays")
    metres = there._carried._metres
    random, poses, hits = np.random.default_rng(2), 0, 0
    rows, columns = here.task.terrain.grid.cells.shape
    while poses < POSES // 4:
        x, y = random.uniform((0, 0), (columns, rows))
        if here.task.terrain.clear[int(y), int(x)] <= here.task.body_radius + 2:
            continue
        poses += 1
        pose = x, y, random.uniform(-math.pi, math.pi)
        for env in (here, there):
            moved_to(env, pose)
        off = np.abs(here.robot.ranges.astype(float) - there.robot.ranges)
        assert off.max() * metres < 1e-6
        hits += int((here.robot.ranges < here.task.robot.range_max).sum())
    assert hits > POSES // 4


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("world", ["maze", "crates", "corridor", "arena"])
@pytest.mark.parametrize("reflectance", ["ideal", "webots"])
def test_readings_of_an_e_puck_are_those_of_the_exact_rays(world, reflectance):
    """On 125 poses in each world with both reflectances, 1,000 in all."""
    pytest.importorskip("mujoco")
    options = {"reflectance": reflectance, "on_collision": "block"}
    here = EPuckEnv(world, **options)
    there = EPuckEnv(world, **options, physics="mujoco-rays")
    for env in (here, there):
        env.reset(seed=0)
    ground, poses, hits = here.task.ground, 0, 0
    random, (left, low, right, high) = np.random.default_rng(3), ground.bounds
    while poses < POSES // 8:
        x, y = random.uniform((left, low), (right, high))
        if not 0.037 <= ground.gap(x, y) <= 0.11:
            continue
        poses += 1
        for env in (here, there):
            moved_to(env, (x, y, (0.7 * poses) % 6.0 - 3.0))
        one, other = here.robot, there.robot
        np.testing.assert_allclose(one.hits[:, 0], other.hits[:, 0], rtol=0, atol=1e-6)
        np.testing.assert_array_equal(one.hits[:, 1], other.hits[:, 1])
        # The table falls by at most 0.4 in 1 µm, divided by the reflectance.
        np.testing.assert_allclose(one.readings, other.readings, rtol=0, atol=2.0)
        np.testing.assert_allclose(one.hits[:, 2], other.hits[:, 2], rtol=0, atol=2e-5)
        hits += int((one.hits[:, 0] < 0.07).sum())
    assert hits > POSES // 8


def along_the_path(env):
    """The info at the end of an episode along the shortest path, and its readings."""
    task, seen = env.task, []
    path = task.shortest_path(task.start) if isinstance(env, Map2DEnv) else None
    path = task.path_from(task.start) if path is None else path
    sign = -1.0 if isinstance(env, Map2DEnv) else 1.0
    for _ in range(task.horizon):
        x, y, heading = env.pose()
        nearest = int(np.argmin(np.hypot(path[:, 0] - x, path[:, 1] - y)))
        to_x, to_y = path[min(nearest + 8, len(path) - 1)]
        off = math.remainder(math.atan2(to_y - y, to_x - x) - heading, math.tau)
        turn, ahead = np.clip(2.0 * sign * off, -1, 1), max(0.0, 1 - 1.5 * abs(off))
        action = np.clip([ahead - turn, ahead + turn], -1, 1)
        observed, _, ended, late, info = env.step(0.6 * action.astype(np.float32))
        seen.append(observed[env.readings])
        if ended or late:
            break
    return info, np.array(seen)


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    "make",
    [
        lambda physics: EPuckEnv("room", physics=physics),
        lambda physics: Map2DEnv(posts(), physics=physics, **ENDS),
    ],
)
def test_an_episode_arrives_as_with_the_exact_rays(make):
    """The motion is the same to the bit; so is, nearly, what the sensors read."""
    pytest.importorskip("mujoco")
    found = []
    for physics in ("mujoco", "mujoco-rays"):
        env = make(physics)
        env.reset(seed=0)
        found.append(along_the_path(env))
    (here, seen_here), (there, seen_there) = found
    assert here["is_success"]
    assert here == there
    np.testing.assert_allclose(seen_here, seen_there, rtol=1e-3, atol=1e-3)
    assert np.ptp(seen_there, axis=0).max() > 10.0


ENDS = {"start": (20.0, 30.0, 0.0), "goal": (140.0, 60.0)}


def posts():
    """A map of 1 cm per pixel with posts beside the way."""
    cells = np.zeros((90, 160), bool)
    cells[60:70, 50:60] = cells[10:20, 80:90] = True
    return cells


def test_a_thing_is_measured_where_it_is_now():
    """The sensors in front read the box that the robot pushes, at its own place."""
    pytest.importorskip("mujoco")
    box = Rectangle(0.1, 0.0, 0.0, 0.06, 0.2)
    part = (Part(box, 0.0, 0.06),)
    thing = Obstacle("box", "Solid", 0.1, 0.0, part, part, mass=0.02)
    floor = Arena(Rectangle(0.0, 0.0, 0.0, 2.0, 2.0))
    world = World(
        (EPuck("e-puck", 0.0, 0.0, 0.0),), (0.6, 0.0), arenas=(floor,),
        obstacles=(thing,),
    )  # fmt: skip
    env = EPuckEnv(world, physics="mujoco-rays", on_collision="block")
    env.reset(seed=0)
    for _ in range(30):
        env.step(np.ones(2, np.float32))
    assert env.things()[0, 0] > 0.105
    # What the compiled sensors read, whose prisms follow the physics.
    measured = env.robot.hits[:, 0].copy()
    physics = env._movables
    plain = env._call_begin.args[1]
    plain()
    near = env.robot.hits[:, 0] < 0.07
    assert near.any()
    np.testing.assert_allclose(measured, env.robot.hits[:, 0], atol=1e-4)
    assert physics.body.data.time > 0.0


def test_what_a_ray_begins_in_is_at_no_distance():
    """As with the exact rays: a part that is seen, but not felt."""
    pytest.importorskip("mujoco")
    cloud = (Part(Rectangle(0.0, 0.0, 0.3, 0.3, 0.3), 0.0, 0.1),)
    floor = Arena(Rectangle(0.0, 0.0, 0.0, 2.0, 2.0))
    world = World(
        (EPuck("e-puck", 0.0, 0.0, 0.0),), (0.6, 0.0), arenas=(floor,),
        obstacles=(Obstacle("cloud", "Solid", 0.0, 0.0, (), cloud),),
    )  # fmt: skip
    for physics in ("exact", "mujoco-rays"):
        env = EPuckEnv(world, physics=physics)
        seen, _ = env.reset(seed=0)
        assert seen["ps"].tolist() == [4095.0] * 8


@pytest.mark.parametrize("physics", WITH_RAYS)
@pytest.mark.parametrize("name", ["TDAC-EPuck-v0", "TDAC-Map2D-v0"])
def test_both_spellings_mean_the_same(name, physics):
    pytest.importorskip("mujoco")
    env = gym.make(name, physics=physics)
    assert env.unwrapped.setup.physics.measures
    first, _ = env.reset(seed=1)
    again, _ = gym.make(name).reset(seed=1)
    for key in first:
        np.testing.assert_allclose(first[key], again[key], rtol=1e-4)


def test_a_copy_measures_on():
    pytest.importorskip("mujoco")
    env = EPuckEnv("maze", physics="mujoco-rays")
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.ones(2, np.float32))
    twin = pickle.loads(pickle.dumps(env))
    for _ in range(5):
        here, there = (each.step(np.ones(2, np.float32))[0] for each in (env, twin))
        np.testing.assert_array_equal(here["ps"], there["ps"])


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (
            lambda: EPuckEnv(physics={"engine": "mujoco", "rays": "mojoco"}),
            "physics: unknown rays 'mojoco'; expected exact or mujoco .*'mujoco'",
        ),
        (
            lambda: Map2DEnv(physics={"engine": "exact", "rays": "mujoco"}),
            "rays 'mujoco' need the engine 'mujoco'",
        ),
        (
            lambda: Map2DEnv(physics={"engine": "mujoco-rays", "rays": "exact"}),
            "'mujoco-rays' has rays 'mujoco'; take 'mujoco'",
        ),
        (lambda: EPuckEnv(physics="mujoco-ray"), "unknown physics .*'mujoco-rays'"),
        (
            lambda: Map2DEnv(physics="mujoco-rays", sensor="sonar"),
            "sensor 'sonar': MuJoCo measures rays alone; take 'rays'",
        ),
        (
            lambda: Map2DEnv(physics="mujoco-rays", scanner_offset=(16.0, 0.0)),
            "rays that begin within the body alone",
        ),
        (
            lambda: EPuckEnv(physics="mujoco-rays", goal_visible=True),
            "goal_visible: MuJoCo's rays do not see the goal's marker",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(make, told):
    pytest.importorskip("mujoco")
    with pytest.raises(TaskError, match=told) as refused:
        make()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("make", [EPuckEnv, Map2DEnv])
def test_without_mujoco_one_line_names_the_extra(make, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(TaskError, match=r"needs MuJoCo: .*install .*\[physics\]"):
        make(physics="mujoco-rays")
