"""Promises of every env that `import tdac_envs` registers."""

import pickle
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import DependencyNotInstalled
from gymnasium.utils.env_checker import check_env

import tdac_envs  # noqa: F401 - registers the envs
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command

IDS = sorted(name for name in gym.registry if name.startswith("TDAC-"))
DISTURBED = {
    "wheel_slip": 0.1,
    "wheel_gains": 0.1,
    "axle_error": 0.05,
    "odometry": True,
    "odometry_scale": 0.05,
    "odometry_noise": 0.1,
    "motor_lag": 0.1,
    "delay": 2,
}
VARIANTS = [
    *((name, {}) for name in IDS),
    (
        "TDAC-Map2D-v0",
        {
            "map": "office",
            "variation": "random",
            "on_collision": "block",
            "range_noise": 0.1,
            "range_dropout": 0.05,
            **DISTURBED,
        },
    ),
    (
        "TDAC-Map2D-v0",
        {
            "map": "office",
            "variation": "jitter",
            "movers": [
                {"kind": "bounce", "count": 4, "radius": 6.0, "speed": 50.0},
                {"kind": "bounce", "speed": 0.0},
            ],
        },
    ),
    ("TDAC-Map2D-v0", {"map": "office", "movers": "crowd:6"}),
    (
        "TDAC-EPuck-v0",
        {
            "world": "crates",
            "variation": "jitter",
            "on_collision": "block",
            "sensor_noise": 1.0,
            "reflectance": "webots",
            **DISTURBED,
            "ground_sensors": True,
            "gps": True,
            "compass": True,
            "encoders": True,
        },
    ),
    ("TDAC-EPuck-v0", {"world": "maze", "variation": "random"}),
    ("TDAC-EPuck-v0", {"world": "maze", "variation": "mixed"}),
    (
        "TDAC-EPuck-v0",
        {"world": "crates", "variation": "jitter", "physics": "mujoco", "delay": 1},
    ),
    (
        "TDAC-Map2D-v0",
        {"map": "office", "variation": "jitter", "physics": "mujoco", "odometry": True},
    ),
    ("TDAC-Ladder-v0", {"level": "known", "split": "test"}),
    ("TDAC-Ladder-v0", {"level": "lost", "split": "dev"}),
    ("TDAC-Ladder-v0", {"level": "crowd", "split": "dev"}),
]
variants = pytest.mark.parametrize(("name", "options"), VARIANTS)
every_env = pytest.mark.parametrize("name", IDS)
# The horizon of a task set is that of each world.
with_horizon = pytest.mark.parametrize("name", [i for i in IDS if "Ladder" not in i])


def same(one, two):
    """Whether two observations, infos, … are equal to the last bit."""
    if isinstance(one, dict):
        return one.keys() == two.keys() and all(same(one[k], two[k]) for k in one)
    if isinstance(one, np.ndarray):
        return one.dtype == two.dtype and np.array_equal(one, two)
    return type(one) is type(two) and one == two


def rollout(env, seed, steps=150):
    """All that an env returned over some random steps with resets."""
    env.action_space.seed(seed)
    record = list(env.reset(seed=seed))
    for _ in range(steps):
        result = env.step(env.action_space.sample())
        record += result
        if result[2] or result[3]:
            record += env.reset()
    return record


def test_there_are_envs():
    assert {"TDAC-Map2D-v0", "TDAC-EPuck-v0"} <= set(IDS)


@pytest.mark.slow_after(2)
@variants
def test_gymnasium_has_nothing_to_say(name, options):
    env = gym.make(name, **options, disable_env_checker=True).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)


@every_env
def test_without_a_window_gymnasium_says_what_to_install(name, monkeypatch):
    """It renders for humans, too; what needs no window can be checked without one."""
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = gym.make(name, disable_env_checker=True).unwrapped
    with pytest.raises(DependencyNotInstalled) as missing:
        check_env(env)
    line = f'render_mode="human" needs pygame: {install_command("human")}'
    assert str(missing.value) == line
    check_env(env, skip_render_check=True)


@pytest.mark.slow_after(13)
@variants
def test_stable_baselines_has_nothing_to_say(name, options):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gym.make(name, **options).unwrapped)


@pytest.mark.slow_after(4)
@variants
def test_equal_seeds_give_equal_rollouts(name, options):
    one, two = gym.make(name, **options), gym.make(name, **options)
    first = rollout(one, 3)
    for again in (rollout(two, 3), rollout(one, 3)):
        assert len(again) == len(first)
        assert all(map(same, first, again))


@pytest.mark.slow_after(13)
@variants
def test_observations_are_in_their_space(name, options):
    env = gym.make(name, **options)
    for item in rollout(env, 4):
        if isinstance(item, dict) and "collisions" not in item:
            assert item in env.observation_space


@pytest.mark.slow_after(13)
@variants
def test_a_pickle_goes_on_where_the_env_was(name, options):
    env = gym.make(name, **options)
    rollout(env, 5, 20)
    twin = pickle.loads(pickle.dumps(env))
    action = np.array([0.6, 0.5], np.float32)
    assert all(map(same, env.step(action), twin.step(action)))
    assert all(map(same, rollout(env, 6), rollout(twin, 6)))


@every_env
def test_a_spec_survives_json(name):
    env = gym.make(name, reward_weights={"goal": 5.0}, render_mode="rgb_array")
    spec = EnvSpec.from_json(env.spec.to_json())
    again = gym.make(spec)
    assert again.spec.kwargs == env.spec.kwargs
    assert all(map(same, rollout(env, 1, 60), rollout(again, 1, 60)))


@every_env
def test_frames_are_pictures_of_one_size(name):
    env = gym.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    frames = [env.render()]
    for _ in range(3):
        env.step(env.action_space.sample())
        frames.append(env.render())
    height, width, channels = frames[0].shape
    assert {frame.shape for frame in frames} == {(height, width, channels)}
    assert {frame.dtype for frame in frames} == {np.dtype(np.uint8)}
    assert channels == 3
    assert min(height, width) >= 100
    assert (frames[0] != frames[-1]).any()
    env.close()


@every_env
def test_the_frame_rate_is_real_time(name):
    env = gym.make(name, render_mode="rgb_array").unwrapped
    assert env.metadata["render_fps"] == round(1 / env.task.dt)


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("mode", ["sync", "async"])
@every_env
def test_a_vector_of_envs_by_the_prefixed_id(name, mode):
    envs = gym.make_vec(f"tdac_envs:{name}", num_envs=2, vectorization_mode=mode)
    try:
        observation, _ = envs.reset(seed=[1, 2])
        assert observation["pose"].shape == (2, 3)
        single = gym.make(name)
        single.reset(seed=1)
        action = np.full((2, 2), 0.5, np.float32)
        for _ in range(5):
            observation, reward, *_ = envs.step(action)
            expected, expected_reward, *_ = single.step(action[0])
            for key in expected:
                np.testing.assert_array_equal(observation[key][0], expected[key])
            assert reward[0] == expected_reward
    finally:
        envs.close()


@with_horizon
def test_an_episode_ends_at_its_horizon_without_a_time_limit(name):
    env = gym.make(name, horizon=5)
    assert env.spec.max_episode_steps is None
    env.reset(seed=0)
    still = np.zeros(2, np.float32)
    assert [env.step(still)[3] for _ in range(5)] == [False] * 4 + [True]


@with_horizon
def test_with_a_time_limit_observations_may_have_the_time(name):
    """Wrappers that ask the spec for it find the horizon that `make` was given."""
    env = gym.make(name, horizon=5, max_episode_steps=5)
    env = gym.wrappers.TimeAwareObservation(env, flatten=False, normalize_time=True)
    times = [env.reset(seed=0)[0]["time"].item()]
    ends = []
    for _ in range(5):
        observation, _, terminated, truncated, _ = env.step(np.zeros(2, np.float32))
        times.append(observation["time"].item())
        ends.append((terminated, truncated))
    np.testing.assert_allclose(times, np.arange(6) / 5)
    assert ends == [(False, False)] * 4 + [(False, True)]


@every_env
def test_frames_can_be_collected(name):
    """`rgb_array_list` gives the frames since the last call, as in Gymnasium."""
    env = gym.make(name, render_mode="rgb_array_list")
    env.reset(seed=0)
    for _ in range(2):
        env.step(np.zeros(2, np.float32))
    assert [frame.shape[2] for frame in env.render()] == [3, 3, 3]
    assert env.render() == []


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@every_env
def test_a_batch_has_a_time_limit(name, mode):
    """`max_episode_steps` truncates each robot as `TimeLimit` truncates one env."""
    modes = gym.vector.AutoresetMode(mode)
    options = {"num_envs": 3, "max_episode_steps": 15}
    batch = gym.make_vec(name, autoreset_mode=modes, **options)
    alone = gym.make_vec(
        name,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": modes},
        **options,
    )
    assert same(batch.reset(seed=3)[0], alone.reset(seed=3)[0])
    random, ends = np.random.default_rng(0), 0
    for _ in range(40):
        actions = random.uniform(-0.3, 0.3, (3, 2)).astype(np.float32)
        one, other = batch.step(actions), alone.step(actions)
        assert all(map(same, one[:4], other[:4]))
        ends += int(one[3].sum())
    assert ends >= 6


@every_env
def test_a_time_limit_is_a_number_of_steps(name):
    with pytest.raises(TaskError, match="max_episode_steps to be a whole number"):
        gym.make_vec(name, num_envs=1, max_episode_steps=0)


@every_env
def test_a_step_after_the_end_warns_once(name):
    """Also after a truncation; a reset begins anew."""
    env = gym.make(name, disable_env_checker=True).unwrapped
    action = np.array([1.0, 0.9], np.float32)
    for _ in range(2):
        env.reset(seed=0)
        while not any(env.step(action)[2:4]):
            pass
        with pytest.warns(
            UserWarning, match=r"step\(\) although the episode has ended"
        ):
            env.step(action)
        env.step(action)


@pytest.mark.slow
@every_env
def test_ppo_learns_for_2000_steps(name):
    torch = pytest.importorskip("torch")
    ppo = pytest.importorskip("stable_baselines3").PPO
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        model = ppo("MultiInputPolicy", gym.make(name), n_steps=512, seed=0)
        model.learn(2000)
        observation, _ = model.get_env().envs[0].reset(seed=0)
        action, _ = model.predict(observation, deterministic=True)
    finally:
        torch.set_num_threads(threads)
    assert model.num_timesteps >= 2000
    assert action.shape == (2,)
