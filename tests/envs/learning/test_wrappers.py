"""Observation wrappers: what they say, in which frame, on every kind of environment."""

import math
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st

from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import clearance_at
from tdac_envs.learning.guidance import MARGINS, route_to_goal
from tdac_envs.learning.wrappers import (
    Frame,
    GoalRelativeObservation,
    Guidance,
    wrap,
)

MAP, PUCK = "TDAC-Map2D-v0", "TDAC-EPuck-v0"
ENVS = [
    (MAP, {"map": "office"}),
    (MAP, {"map": "cave", "variation": "random"}),
    (PUCK, {"world": "crates", "variation": "jitter"}),
]
both = pytest.mark.parametrize(("name", "options"), ENVS)


def make(name, options, *wrappers):
    return wrap(gym.make(name, **options), wrappers)


@pytest.mark.slow_after(3)
@both
@pytest.mark.parametrize(
    "wrappers",
    [("goal-relative",), ("guidance",), ("goal-relative", "guidance", "flatten")],
)
@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
def test_gymnasium_and_stable_baselines_accept_them(name, options, wrappers):
    """Spaces, types and equal seeds are as Gymnasium wants them, and SB3."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = make(name, options, *wrappers)
    check_env(env, skip_render_check=True)
    checker.check_env(env)
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        for _ in range(20):
            assert observation in env.observation_space
            observation, _, terminated, truncated, _ = env.step(
                np.array([0.9, 0.7], np.float32)
            )
            if terminated or truncated:
                break


@both
def test_the_goal_is_told_as_a_person_beside_the_robot_sees_it(name, options):
    """Ahead, left and how far; left is left on the picture, in both environments."""
    env = make(name, options)
    frame = Frame.of(env)
    plain, up = env.unwrapped, 1.0 if name == PUCK else -1.0
    env.reset(seed=1)
    for heading in (0.0, 1.3, -2.6):
        x, y, _ = plain.pose()
        goal = plain.task.goal
        observation = {
            "pose": np.array([x, y, heading], np.float32),
            "goal": np.array(goal, np.float32),
            "wheel_speeds": np.zeros(2, np.float32),
            plain.readings: plain.observation_space[plain.readings].high,
        }
        told = frame.goal_relative(observation)
        # On a picture y points up: turn it there.
        bearing = math.atan2(up * (goal[1] - y), goal[0] - x) - up * heading
        distance = math.dist((x, y), goal)
        wanted = [math.cos(bearing), math.sin(bearing)]
        wanted.append(distance / (distance + 10 * frame.radius))
        assert told["goal"] == pytest.approx(wanted, abs=1e-4)
        assert np.all(told[plain.readings] == 1.0)


def test_a_batch_is_told_what_each_is_told():
    """Of one observation or of many: the same figures."""
    env = make(MAP, {"variation": "jitter", "map": "rooms"})
    frame = Frame.of(env)
    observations = [env.reset(seed=seed)[0] for seed in range(6)]
    batch = {k: np.stack([o[k] for o in observations]) for k in observations[0]}
    together = frame.goal_relative(batch)
    route = route_to_goal(env.unwrapped.task)
    guided = frame.guidance(route, batch["pose"])
    for number, observation in enumerate(observations):
        alone = frame.goal_relative(observation)
        for key, value in alone.items():
            assert np.array_equal(together[key][number], value)
        assert np.array_equal(
            guided[number], frame.guidance(route, observation["pose"][None])[0]
        )


def walk(task, start):
    """The places that the waypoints lead to, one after the other."""
    route = route_to_goal(task)
    places = [np.array(start, float)]
    while tuple(places[-1]) != tuple(task.goal):
        places.append(route.ahead(places[-1][None])[0])
        assert len(places) < 5000
    return np.array(places), route


@pytest.mark.parametrize("name", ["maze", "warehouse", "thin_walls"])
def test_way_points_lead_to_the_goal_and_keep_room(name):
    """From a random start the walk ends at the goal, is short, and holds the body."""
    env = gym.make(MAP, map=name, variation="random").unwrapped
    for seed in range(3):
        env.reset(seed=seed)
        task = env.task
        places, route = walk(task, task.start[:2])
        steps = np.hypot(*np.diff(places, axis=0).T)
        assert steps[:-1].max() <= route.reach + 2.0
        assert steps.sum() <= 1.3 * task.shortest + 4.0
        cells, radius = task.terrain.grid.cells, task.body_radius
        room = [clearance_at(cells, x, y, 3 * radius) for x, y in places]
        assert min(room) >= radius
        if route.roomy is not route.shortest:
            roomy = sum(gap >= (1 + MARGINS[-1]) * radius for gap in room)
            assert roomy > 0.7 * len(places)


def test_way_points_in_a_world_hold_the_body():
    """The same in metres, on the world's grid."""
    env = gym.make(PUCK, world="maze", variation="random").unwrapped
    for seed in range(3):
        env.reset(seed=seed)
        task = env.task
        places, route = walk(task, task.start[:2])
        steps = np.hypot(*np.diff(places, axis=0).T)
        assert steps[:-1].max() <= route.reach + 2 * task.ground.spacing
        assert steps.sum() <= 1.3 * task.shortest + 0.02
        assert min(task.ground.gap(x, y) for x, y in places) >= task.body_radius


@pytest.fixture(scope="module")
def clutter():
    """A robot on a map, and its way to the goal."""
    env = gym.make(MAP, map="clutter").unwrapped
    return env.nominal, Frame.of(env), route_to_goal(env.nominal)


@given(st.floats(-3.1, 3.1), st.integers(0, 2**20))
def test_guidance_turns_with_the_robot(clutter, turn, number):
    """The same waypoint, whatever the heading; turned by it in the robot's frame."""
    task, frame, route = clutter
    rows, columns = np.nonzero(np.isfinite(task.field))
    at = number % rows.size
    ahead = np.array([[columns[at], rows[at], 0.0]])
    turned = np.array([[columns[at], rows[at], turn]])
    (x, left), (u, v) = (
        frame.guidance(route, ahead)[0],
        frame.guidance(route, turned)[0],
    )
    # Headings go clockwise on the screen, and left is counter-clockwise.
    cos, sin = math.cos(turn), math.sin(turn)
    wanted = np.clip([x * cos - left * sin, left * cos + x * sin], -1.0, 1.0)
    if max(abs(x), abs(left)) < 1.0:
        assert (u, v) == pytest.approx(tuple(wanted), abs=1e-5)
    assert math.hypot(x, left) <= 1.5


def test_guidance_follows_a_new_goal():
    """After a reset with another goal the waypoints lead there."""
    env = Guidance(gym.make(MAP, map="rooms"))
    env.reset(seed=0)
    goal = env.unwrapped.nominal.start[:2]
    start = (*env.unwrapped.nominal.goal, 0.0)
    observation, _ = env.reset(options={"start": start, "goal": goal})
    route = route_to_goal(env.unwrapped.task)
    assert route.goal == goal
    told = env.frame.guidance(route, env.unwrapped.pose()[None])[0]
    assert np.array_equal(observation["guidance"], told)


def test_a_pickle_is_guided_alike():
    """A copy in another process says the same."""
    env = make(PUCK, {"variation": "jitter"}, "goal-relative", "guidance")
    env.reset(seed=3)
    twin = pickle.loads(pickle.dumps(env))
    action = np.array([0.4, 0.5], np.float32)
    one, two = env.step(action)[0], twin.step(action)[0]
    assert one.keys() == two.keys()
    assert all(np.array_equal(one[key], two[key]) for key in one)


def test_what_cannot_be_wrapped_is_refused():
    """By one line that says what was expected."""
    env = gym.make(MAP, map="rooms")
    with pytest.raises(TaskError, match="unknown wrapper 'relative'; expected some of"):
        wrap(env, ["relative"])
    with pytest.raises(TaskError, match="expected observations in a Dict"):
        wrap(env, ["flatten", "guidance"])
    with pytest.raises(TaskError, match="observations with a goal, and a pose"):
        wrap(env, ["goal-relative", "goal-relative"])
    with pytest.raises(TaskError, match="expected an environment of tdac_envs"):
        GoalRelativeObservation(gym.make("CartPole-v1"))
