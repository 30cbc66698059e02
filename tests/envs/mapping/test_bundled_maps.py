"""The bundled maps: each is a task, and none is solved without finding the way."""

import math
from itertools import chain, repeat

import cv2
import gymnasium as gym
import numpy as np
import pytest
from simple_policies import LEFT, RIGHT, drive_path, go_straight, wall_follower

from tdac_envs.core.errors import MapError
from tdac_envs.grid.plan import path_length
from tdac_envs.map2d.task import widest_connected_radius
from tdac_envs.mapping.bundled import bundled_map, bundled_maps
from tools.draw_maps.draw import draw_maps

EACH_MAP = pytest.mark.parametrize("name", bundled_maps())
EACH_HAND = pytest.mark.parametrize("hand", [LEFT, RIGHT], ids=["left", "right"])
JITTERS = range(5)


@pytest.fixture(scope="module")
def make():
    """Makes each map's environment once."""
    made = {}

    def of(name, variation="nominal"):
        if (name, variation) not in made:
            env = gym.make("TDAC-Map2D-v0", map=name, variation=variation)
            made[name, variation] = env.unwrapped
        return made[name, variation]

    return of


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A folder with the maps as the script draws them now."""
    folder = tmp_path_factory.mktemp("maps")
    draw_maps(folder)
    return folder


def run(env, policy, seed=0):
    """The last `info` of an episode."""
    obs, info = env.reset(seed=seed)
    done = False
    while not done:
        action = np.array(policy(obs), np.float32)
        obs, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    return info


def replay(actions):
    """A policy that plays a list of actions and then stands still."""
    left = chain(actions, repeat((0.0, 0.0)))
    return lambda obs: next(left)


def narrowest(env):
    """Width of the narrowest passage that cannot be avoided, in body radii."""
    task = env.nominal
    ends = task.start[:2], task.goal
    widest = widest_connected_radius(task.terrain.clear, *ends)
    return 2 * widest / task.robot.radius


def test_there_are_enough_maps_and_the_maze_comes_first():
    assert bundled_maps()[0] == "maze"
    assert {
        "maze", "office", "cave", "warehouse", "street", "rooms", "thin_walls",
        "light_on_dark",
    } <= set(bundled_maps())  # fmt: skip


def test_an_unknown_name_is_answered_with_the_closest():
    with pytest.raises(MapError, match="did you mean 'warehouse'"):
        bundled_map("werehouse")
    with pytest.raises(MapError, match="the maps are maze, cave"):
        bundled_map("42")


@pytest.mark.slow
@EACH_MAP
def test_the_script_reproduces_the_map(name, drawn):
    kept = bundled_map(name)
    task = (drawn / f"{name}.json").read_text()
    assert task == kept.image.with_suffix(".json").read_text()
    now, before = cv2.imread(str(drawn / f"{name}.png")), cv2.imread(str(kept.image))
    assert now.shape == before.shape
    # Labels are set in OpenCV's own font, which was another one before version 5.
    assert (cv2.absdiff(now, before) > 8).mean() < 0.01


@pytest.mark.slow
def test_the_script_draws_the_same_twice(drawn, tmp_path):
    draw_maps(tmp_path)
    for path in drawn.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()


@EACH_MAP
def test_image_is_of_moderate_size(name):
    image = bundled_map(name).image
    height, width = cv2.imread(str(image)).shape[:2]
    assert 400 <= width <= 1000
    assert 400 <= height <= 900
    assert image.stat().st_size < 120_000


@EACH_MAP
def test_the_way_is_long_and_wide_enough(name, make):
    task = make(name).nominal
    path = task.path_from(task.start)
    assert path_length(path) >= 1.5 * math.dist(task.start[:2], task.goal)
    assert narrowest(make(name)) >= 2.3


def test_some_ways_are_narrow(make):
    assert sum(narrowest(make(name)) < 3 for name in bundled_maps()) >= 3


def test_the_maze_compares_with_the_papers(make):
    task = make("maze").nominal
    assert (task.terrain.grid.width, task.terrain.grid.height) == (850, 650)
    assert task.robot.radius == 15
    assert 1900 <= task.shortest <= 2200
    assert 120 <= math.dist(task.start[:2], task.goal) <= 250


@EACH_MAP
def test_going_straight_fails(name, make):
    robot = make(name).nominal.robot
    assert not run(make(name), lambda obs: go_straight(obs, robot))["is_success"]
    for seed in JITTERS:
        env = make(name, "jitter")
        assert not run(env, lambda obs: go_straight(obs, robot), seed)["is_success"]


@pytest.mark.slow
@EACH_HAND
@EACH_MAP
def test_following_a_wall_fails(name, hand, make):
    env = make(name)
    info = run(env, wall_follower(hand, env.nominal.robot))
    assert not info["is_success"]
    assert not info["collision"], "it ought to get around, only not to the goal"


@pytest.mark.slow
@EACH_HAND
@EACH_MAP
def test_following_a_wall_fails_from_jittered_starts(name, hand, make):
    env = make(name, "jitter")
    for seed in JITTERS:
        follower = wall_follower(hand, env.nominal.robot)
        assert not run(env, follower, seed)["is_success"]


@EACH_MAP
def test_replaying_a_success_fails_from_jittered_starts(name, make):
    env = make(name)
    task = env.nominal
    path = task.path_from(task.start)
    actions = list(drive_path(path, task.start.heading, task.robot))
    assert run(env, replay(actions))["is_success"]
    jitter = make(name, "jitter")
    won = [run(jitter, replay(actions), seed)["is_success"] for seed in JITTERS]
    assert sum(won) <= 1


@EACH_HAND
def test_the_wall_follower_reaches_a_goal_at_its_wall(hand):
    """It fails on the maps because of how they are laid out."""
    cells = np.zeros((300, 400), bool)
    cells[:2] = cells[-2:] = cells[:, :2] = cells[:, -2:] = True
    cells[2:220, 130:138] = cells[80:298, 260:268] = True
    env = gym.make("TDAC-Map2D-v0", map=cells, start=(60, 60), goal=(375, 272))
    robot = env.unwrapped.nominal.robot
    assert run(env.unwrapped, wall_follower(hand, robot))["is_success"]
