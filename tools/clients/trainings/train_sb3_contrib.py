"""sb3-contrib: TRPO and RecurrentPPO on a batch, TQC on a single environment."""

import gymnasium as gym
from sb3_contrib import TQC, TRPO, RecurrentPPO

from tdac_envs import wrap_for_rl
from tdac_envs.sb3 import SB3VecEnv

MAZE = "TDAC-Map2D-v0"


def batch(count):
    """A batch with the observations for learning."""
    made = gym.make_vec(MAZE, count, autoreset_mode="SameStep", variation="mixed")
    return SB3VecEnv(wrap_for_rl(made))


def main():
    """Trains, and prints the numbers of steps."""
    models = [
        TRPO("MlpPolicy", batch(16), n_steps=64, batch_size=256, seed=0),
        RecurrentPPO("MlpLstmPolicy", batch(8), n_steps=32, batch_size=64, seed=0),
        TQC("MlpPolicy", wrap_for_rl(gym.make(MAZE)), learning_starts=200, seed=0),
    ]
    trained = []
    for model, steps in zip(models, (4096, 1024, 300), strict=True):
        model.learn(steps)
        trained.append(f"{type(model).__name__} {model.num_timesteps} steps")
    print(", ".join(trained))


if __name__ == "__main__":
    main()
