"""Trains RLlib's PPO on the maze.

    python examples/rllib_maze.py --seed 1

This program needs `ray[rllib]` and torch.
"""

from __future__ import annotations

import argparse

import gymnasium as gym
from maze import STEPS, Successes, make_maze, result_line
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env

GAMMA = 0.98


def make_normalised(_: object) -> gym.Env:
    """The maze with observations and rewards scaled by their running statistics."""
    env = gym.wrappers.NormalizeObservation(make_maze())
    return gym.wrappers.NormalizeReward(env, gamma=GAMMA)


def main() -> None:
    """Trains in this process and prints whether the policy has learnt the maze."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=STEPS)
    given = parser.parse_args()
    register_env("maze", make_normalised)
    config = (
        PPOConfig()
        # Otherwise RLlib scales actions, and with them the exploration noise.
        .environment("maze", normalize_actions=False, clip_actions=True)
        .env_runners(num_env_runners=0, num_envs_per_env_runner=8)
        .training(
            train_batch_size_per_learner=1024,
            minibatch_size=256,
            num_epochs=10,
            lr=[[0, 1e-3], [given.steps, 0.0]],
            gamma=GAMMA,
            lambda_=0.95,
            clip_param=0.2,
            use_kl_loss=False,
            vf_clip_param=1000.0,  # a limit of the squared error; normally not reached
            vf_loss_coeff=0.25,
            grad_clip=0.5,
        )
        .rl_module(
            model_config=DefaultModelConfig(
                fcnet_hiddens=[64, 64], fcnet_activation="tanh", free_log_std=True
            )
        )
        .debugging(seed=given.seed)
    )
    algorithm = config.build_algo()
    while Successes.steps < given.steps:
        algorithm.train()
    algorithm.stop()
    print(result_line())


if __name__ == "__main__":
    main()
