"""Promises of the batch for Stable-Baselines3: it is its own vector of single ones."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv


@pytest.fixture(autouse=True)
def sb3():
    """Stable-Baselines3, which collecting these tests does not load."""
    return pytest.importorskip("stable_baselines3")


def batch(count, **options):
    from tdac_envs.learning.sb3 import SB3VecEnv

    return SB3VecEnv(
        gym.make_vec("TDAC-Map2D-v0", count, autoreset_mode="SameStep", **options)
    )


def test_it_does_what_a_dummy_vector_does():
    """Equal seeds give equal observations, rewards, ends and last infos."""
    from stable_baselines3.common.vec_env import DummyVecEnv

    options = {"variation": "jitter", "range_noise": 0.1, "horizon": 30}
    one = DummyVecEnv([lambda: Map2DEnv(**options)] * 4)
    two = batch(4, **options)
    assert one.observation_space == two.observation_space
    assert one.action_space == two.action_space
    for envs in (one, two):
        envs.seed(11)
    assert_equal(one.reset(), two.reset())
    assert one.reset_infos == two.reset_infos
    random, ends = np.random.default_rng(0), 0
    for _ in range(100):
        action = random.uniform(-1, 1, (4, 2)).astype(np.float32)
        first, second = one.step(action), two.step(action)
        assert_equal(first[0], second[0])
        np.testing.assert_array_equal(first[1], second[1])
        assert first[1].dtype == second[1].dtype
        np.testing.assert_array_equal(first[2], second[2])
        for over, a, b in zip(first[2], first[3], second[3], strict=True):
            ends += over
            if over:
                assert_equal(a.pop("terminal_observation"), b["terminal_observation"])
                assert a == {k: v for k, v in b.items() if k != "terminal_observation"}
    assert ends >= 12


def assert_equal(one, two):
    assert one.keys() == two.keys()
    for key in one:
        np.testing.assert_array_equal(one[key], two[key])


def test_each_robot_may_have_a_seed_of_its_own():
    """It then begins as it does alone; one seed for all goes on from the first."""
    envs = batch(3, variation="jitter")
    seeds = [7, 2**32 - 1, 0]
    assert envs.seed(seeds) == seeds
    poses = envs.reset()["pose"].copy()
    for seed, pose in zip(seeds, poses, strict=True):
        one = gym.make("TDAC-Map2D-v0", variation="jitter")
        np.testing.assert_array_equal(one.reset(seed=seed)[0]["pose"], pose)
    assert envs.seed(5) == [5, 6, 7]
    np.testing.assert_array_equal(envs.reset()["pose"][2], poses[0])
    with pytest.raises(TaskError, match="expected 3 seeds, got 2"):
        envs.seed([1, 2])
    envs.close()


def test_a_policy_is_trained_and_evaluated_on_it(sb3):
    """Episodes are counted by the monitor, with their success."""
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.vec_env import VecMonitor

    torch = pytest.importorskip("torch")
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        envs = VecMonitor(batch(8, horizon=20), info_keywords=("is_success",))
        model = sb3.PPO("MultiInputPolicy", envs, n_steps=32, n_epochs=1, seed=0)
        model.learn(256)
        assert len(model.ep_info_buffer) >= 8
        assert {info["l"] for info in model.ep_info_buffer} <= set(range(1, 21))
        rewards, lengths = evaluate_policy(
            model, envs, n_eval_episodes=8, return_episode_rewards=True
        )
        assert len(rewards) == len(lengths) == 8
    finally:
        torch.set_num_threads(threads)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: gym.make_vec("TDAC-Map2D-v0", 2), "autoreset_mode='SameStep'"),
        (lambda: gym.make_vec("CartPole-v1", 2), "expected a batch made by"),
    ],
)
def test_other_environments_are_refused(made, message):
    from tdac_envs.learning.sb3 import SB3VecEnv

    with pytest.raises(TaskError, match=message):
        SB3VecEnv(made())


def test_robots_are_no_objects_of_their_own():
    from stable_baselines3.common.vec_env import VecMonitor

    envs = batch(2)
    assert envs.get_attr("num_envs", [0]) == [2]
    assert envs.env_is_wrapped(VecMonitor) == [False, False]
    with pytest.raises(TaskError, match="cannot set 'horizon'"):
        envs.set_attr("horizon", 3)
    with pytest.raises(TaskError, match="cannot call 'close'"):
        envs.env_method("close")


@pytest.mark.slow
def test_importing_the_environments_imports_neither_sb3_nor_torch():
    script = (
        "import sys, tdac_envs, tdac_envs.map2d.vector\n"
        "print({'torch', 'stable_baselines3'} & set(sys.modules))"
    )
    run = [sys.executable, "-c", script]
    done = subprocess.run(run, check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.filterwarnings("default")
def test_its_videos_show_all_robots(tmp_path):
    """In real time, by Stable-Baselines3's own recorder."""
    from stable_baselines3.common.vec_env import VecVideoRecorder

    pytest.importorskip("moviepy")
    envs = batch(4, render_mode="rgb_array")
    envs = VecVideoRecorder(envs, str(tmp_path), lambda k: k == 0, video_length=5)
    assert envs.frames_per_sec == 20
    envs.reset()
    assert envs.render().shape[1] > 1000
    for _ in range(6):
        envs.step(np.ones((4, 2), np.float32))
    envs.close()
    assert len(list(tmp_path.glob("*.mp4"))) == 1


def test_what_a_reset_says_of_a_world_is_plain():
    """Nested infos become nested dicts of plain numbers."""
    from stable_baselines3.common.vec_env import DummyVecEnv

    from tdac_envs.learning.sb3 import SB3VecEnv

    options = {"level": "unknown", "split": "dev"}
    one = DummyVecEnv([lambda: gym.make("TDAC-Ladder-v0", **options).unwrapped] * 2)
    two = SB3VecEnv(
        gym.make_vec("TDAC-Ladder-v0", 2, autoreset_mode="SameStep", **options)
    )
    for envs in (one, two):
        envs.seed(1)
        envs.reset()
    assert one.reset_infos == two.reset_infos
    assert two.reset_infos[0]["difficulty"]["gap"] > 1
