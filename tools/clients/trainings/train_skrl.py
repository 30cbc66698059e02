"""skrl: PPO on a batch, which its automatic wrapper recognises."""

import gymnasium as gym
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.trainers.torch import SequentialTrainer
from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

from tdac_envs import wrap_for_rl

COUNT, ROLLOUT, ROLLOUTS = 8, 64, 8
NETWORK = [
    {"name": "net", "input": "OBSERVATIONS", "layers": [64, 64], "activations": "tanh"}
]


def main():
    """Trains, and prints the numbers of steps."""
    plain = wrap_env(gym.make_vec("TDAC-Map2D-v0", 2, render_mode="rgb_array"))
    plain.reset()
    assert len(plain.render()) == 2
    made = gym.make_vec("TDAC-Map2D-v0", COUNT, variation="mixed")
    env = wrap_env(wrap_for_rl(made))
    spaces = {
        "observation_space": env.observation_space,
        "action_space": env.action_space,
        "device": env.device,
    }
    models = {
        "policy": gaussian_model(**spaces, network=NETWORK, output="ACTIONS"),
        "value": deterministic_model(**spaces, network=NETWORK, output="ONE"),
    }
    memory = RandomMemory(memory_size=ROLLOUT, num_envs=COUNT, device=env.device)
    cfg = PPO_CFG(rollouts=ROLLOUT)
    cfg.experiment.write_interval = cfg.experiment.checkpoint_interval = 0
    agent = PPO(models=models, memory=memory, cfg=cfg, **spaces)
    steps = ROLLOUT * ROLLOUTS
    trainer = SequentialTrainer(
        env=env, agents=agent, cfg={"timesteps": steps, "headless": True}
    )
    trainer.train()
    env.close()  # its last message comes before the line below
    print(f"PPO {steps * COUNT} steps")


if __name__ == "__main__":
    main()
