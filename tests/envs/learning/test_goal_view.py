"""Promises of the goal view: any place that was reached may have been the goal."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from tdac_envs.core.errors import TaskError
from tdac_envs.learning.goal_view import GoalView
from tdac_envs.learning.wrappers import wrap

ENVS = [
    ("TDAC-Map2D-v0", {"map": "office", "variation": "random"}),
    ("TDAC-Map2D-v0", {"on_collision": "block", "goal_tolerance": 60}),
    ("TDAC-EPuck-v0", {"world": "maze", "variation": "random"}),
]
every = pytest.mark.parametrize(("name", "options"), ENVS)


def make(name, **options):
    return GoalView(gym.make(name, **options))


def rollout(env, steps=300):
    """Observations, rewards, ends and infos of a robot that mostly drives ahead."""
    random, results = np.random.default_rng(0), []
    env.reset(seed=0)
    for _ in range(steps):
        action = np.clip(random.normal(0.7, 0.4, 2), -1, 1).astype(np.float32)
        results.append(env.step(action))
        if results[-1][2] or results[-1][3]:
            env.reset()
    return results


@every
@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
def test_gymnasium_and_stable_baselines_accept_it(name, options):
    """Also as a goal environment, which the environment itself is not."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = make(name, **options)
    check_env(env, skip_render_check=True)
    checker.check_env(env)
    assert not hasattr(env.unwrapped, "compute_reward")


@every
def test_it_keeps_the_rules_of_a_goal_environment(name, options):
    """A step returns what the methods compute for its goal, and for all at once."""
    env = make(name, horizon=120, **options)
    results = rollout(env)
    seen, rewards, terminated, truncated, infos = zip(*results, strict=True)
    assert any(terminated) or options.get("on_collision") == "block"
    assert any(truncated) or options.get("on_collision") != "block"
    for observation, reward, end, cut, info in results:
        goals = observation["achieved_goal"], observation["desired_goal"]
        assert observation in env.observation_space
        assert env.compute_reward(*goals, info) == reward
        assert env.compute_terminated(*goals, info) is end
        assert env.compute_truncated(*goals, info) is cut
    goals = [np.array([o[k] for o in seen]) for k in ("achieved_goal", "desired_goal")]
    np.testing.assert_array_equal(env.compute_reward(*goals, infos), rewards)
    np.testing.assert_array_equal(env.compute_terminated(*goals, infos), terminated)
    np.testing.assert_array_equal(env.compute_truncated(*goals, infos), truncated)


def test_the_place_that_was_reached_is_worth_more_as_a_goal():
    """Hindsight: -1 for the real goal, 0 for the place itself, and not far from it."""
    env = make("TDAC-Map2D-v0")
    observation, _ = env.reset(seed=0)
    here, goal = observation["achieved_goal"], observation["desired_goal"]
    assert env.compute_reward(here, goal, {}) == -1.0
    assert env.compute_reward(here, here, {}) == 0.0
    task = env.unwrapped.task
    tolerance = np.array([task.goal_tolerance, 0.0]) / env._scale
    beside, beyond = here + 0.9 * tolerance, here + 1.1 * tolerance
    found = env.compute_reward(
        np.stack([here, here]), np.stack([beside, beyond]), [{}] * 2
    )
    assert found.tolist() == [0.0, -1.0]


def test_the_goal_ends_the_episode_with_reward_0():
    """As `is_success` says; every other step costs 1."""
    env = make("TDAC-Map2D-v0", map=np.zeros((80, 200), bool), start=(30, 40, 0.0),
               goal=(160, 40))  # fmt: skip
    env.reset(seed=0)
    rewards, terminated = [], False
    while not terminated:
        _, reward, terminated, _, info = env.step(np.ones(2, np.float32))
        rewards.append(reward)
    assert info["is_success"]
    assert rewards == [-1.0] * (len(rewards) - 1) + [0.0]


def test_a_wall_between_the_robot_and_a_goal_counts():
    """Within the tolerance, but on the other side."""
    cells = np.zeros((80, 200), bool)
    cells[:60, 100] = True
    env = make("TDAC-Map2D-v0", map=cells, start=(30, 40, 0.0), goal=(80, 40),
               robot_radius=5.0, goal_tolerance=40.0)  # fmt: skip
    env.reset(seed=0)
    here, beyond = env._scaled((90, 30)), env._scaled((110, 30))
    assert env.compute_reward(here, beyond, {}) == -1.0
    assert env.compute_reward(here, env._scaled((70, 30)), {}) == 0.0


@pytest.mark.parametrize(("rule", "reward"), [("terminate", -51.0), ("block", -1.0)])
def test_a_contact_that_ends_the_episode_is_not_cheaper_than_to_go_on(rule, reward):
    """Without its cost, a crash would save the rest of the steps."""
    env = GoalView(gym.make("TDAC-Map2D-v0", on_collision=rule), contact_cost=50.0)
    env.reset(seed=0)
    for _ in range(200):
        _, found, terminated, _, info = env.step(np.ones(2, np.float32))
        if info["collision"]:
            break
    assert info["collision"]
    assert terminated == (rule == "terminate")
    assert found == reward


def test_what_it_cannot_show_is_refused():
    """In one line that says what was expected."""
    with pytest.raises(TaskError, match="expected an environment of tdac_envs"):
        GoalView(gym.make("CartPole-v1"))
    with pytest.raises(TaskError, match="observations with a goal, and a pose"):
        GoalView(wrap(gym.make("TDAC-Map2D-v0"), ["goal-relative"]))
    with pytest.raises(TaskError, match="contact_cost"):
        GoalView(gym.make("TDAC-Map2D-v0"), contact_cost=-1.0)


@pytest.mark.slow
def test_hindsight_replay_trains_on_it():
    """With Stable-Baselines3's buffer: relabelled steps reach their goals."""
    sb3 = pytest.importorskip("stable_baselines3")
    torch = pytest.importorskip("torch")
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        model = sb3.SAC(
            "MultiInputPolicy",
            make("TDAC-Map2D-v0", horizon=50),
            replay_buffer_class=sb3.HerReplayBuffer,
            replay_buffer_kwargs={"copy_info_dict": True},
            learning_starts=150,
            batch_size=64,
            seed=0,
        )
        model.learn(200)
        rewards = model.replay_buffer.sample(500).rewards.numpy()
    finally:
        torch.set_num_threads(threads)
    assert {-1.0, 0.0} <= set(np.unique(rewards).tolist())
