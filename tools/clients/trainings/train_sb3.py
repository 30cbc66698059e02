"""Stable-Baselines3: PPO on a batch, HER on the goal view, and a video of a batch."""

import tempfile
from pathlib import Path

import gymnasium as gym
from stable_baselines3 import PPO, SAC, HerReplayBuffer
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import VecMonitor, VecVideoRecorder

from tdac_envs import wrap_for_rl
from tdac_envs.sb3 import SB3VecEnv
from tdac_envs.wrappers import GoalView

MAZE = "TDAC-Map2D-v0"


def batch(count, **options):
    """A batch with the observations for learning."""
    made = gym.make_vec(MAZE, count, autoreset_mode="SameStep", **options)
    return SB3VecEnv(wrap_for_rl(made))


def main():
    """Trains, and prints the numbers of steps."""
    check_env(gym.make(MAZE))
    check_env(GoalView(gym.make(MAZE)))
    envs = VecMonitor(batch(16, variation="mixed"))
    ppo = PPO("MlpPolicy", envs, n_steps=64, batch_size=256, seed=0).learn(4096)
    sac = SAC(
        "MultiInputPolicy",
        GoalView(gym.make(MAZE, horizon=100)),
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"copy_info_dict": True},
        learning_starts=300,
        seed=0,
    ).learn(500)
    with tempfile.TemporaryDirectory() as folder:
        shown = batch(4, render_mode="rgb_array")
        shown = VecVideoRecorder(shown, folder, lambda k: k == 0, video_length=5)
        observations = shown.reset()
        for _ in range(6):
            actions, _ = ppo.predict(observations)
            observations, *_ = shown.step(actions)
        shown.close()
        films = len(list(Path(folder).glob("*.mp4")))
    steps, more = ppo.num_timesteps, sac.num_timesteps
    print(f"PPO {steps} steps, HER {more} steps, {films} video")


if __name__ == "__main__":
    main()
