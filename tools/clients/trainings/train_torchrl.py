"""TorchRL: its checks of an environment, and PPO's loss on collected steps."""

import gymnasium as gym
import torch
from tensordict.nn import NormalParamExtractor, TensorDictModule
from torch import nn
from torchrl.envs import GymWrapper
from torchrl.envs.utils import check_env_specs
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from tdac_envs import wrap_for_rl

STEPS, UPDATES = 512, 4


def network(inputs, outputs):
    """A small network."""
    return nn.Sequential(nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, outputs))


def main():
    """Trains, and prints the numbers of steps."""
    torch.manual_seed(0)
    env = GymWrapper(wrap_for_rl(gym.make("TDAC-Map2D-v0", variation="mixed")))
    check_env_specs(env)
    size = env.observation_spec["observation"].shape[-1]
    mean = nn.Sequential(network(size, 4), NormalParamExtractor())
    actor = ProbabilisticActor(
        TensorDictModule(mean, in_keys=["observation"], out_keys=["loc", "scale"]),
        spec=env.action_spec,
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        return_log_prob=True,
    )
    critic = ValueOperator(network(size, 1), in_keys=["observation"])
    advantage = GAE(gamma=0.995, lmbda=0.95, value_network=critic)
    loss = ClipPPOLoss(actor, critic)
    optimizer = torch.optim.Adam(loss.parameters(), 1e-3)
    for _ in range(UPDATES):
        data = env.rollout(STEPS, actor, break_when_any_done=False)
        with torch.no_grad():
            advantage(data)
        terms = loss(data.reshape(-1).detach())
        total = sum(terms[k] for k in ("loss_objective", "loss_critic", "loss_entropy"))
        optimizer.zero_grad()
        total.backward()
        optimizer.step()
    print(f"PPO {UPDATES * STEPS} steps, loss {total.item():.2f}")


if __name__ == "__main__":
    main()
