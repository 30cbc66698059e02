"""Tianshou: PPO on its own vector of single environments."""

import gymnasium as gym
import torch
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic

from tdac_envs import wrap_for_rl

COUNT, STEPS = 8, 2048


def make():
    """One environment with the observations for learning."""
    return wrap_for_rl(gym.make("TDAC-Map2D-v0", variation="mixed"))


def main():
    """Trains, and prints the numbers of steps."""
    torch.manual_seed(0)
    envs, env = DummyVectorEnv([make] * COUNT), make()
    shape, actions = env.observation_space.shape, env.action_space.shape
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=shape, hidden_sizes=[64, 64]),
        action_shape=actions,
    )
    critic = ContinuousCritic(
        preprocess_net=Net(state_shape=shape, hidden_sizes=[64, 64])
    )
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda found: torch.distributions.Independent(
            torch.distributions.Normal(*found), 1
        ),
        action_space=env.action_space,
    )
    algorithm = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3))
    buffer = VectorReplayBuffer(STEPS, COUNT)
    collector = Collector(algorithm, envs, buffer)
    found = algorithm.run_training(
        OnPolicyTrainerParams(
            training_collector=collector,
            max_epochs=1,
            epoch_num_steps=STEPS,
            collection_step_num_env_steps=512,
            update_step_num_repetitions=2,
            batch_size=256,
        )
    )
    print(f"PPO {found.train_step} steps")


if __name__ == "__main__":
    main()
