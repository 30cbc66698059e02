"""Trains CleanRL's PPO on the maze with CleanRL's own, unmodified file.

    python examples/cleanrl_maze.py cleanrl/cleanrl/ppo_continuous_action.py --seed 1

Further arguments are passed to CleanRL's file. This program needs torch, tyro and
tensorboard.
"""

from __future__ import annotations

import runpy
import sys
from typing import Any

import gymnasium as gym
from gymnasium.vector import AutoresetMode
from maze import STEPS, make_maze, result_line

ARGUMENTS = [
    *("--env-id", "Maze-v0", "--total-timesteps", str(STEPS)),
    *("--num-envs", "8", "--num-steps", "128", "--num-minibatches", "4"),
    *("--learning-rate", "1e-3", "--gamma", "0.98", "--target-kl", "0.03"),
]


class TransformObservation(gym.wrappers.TransformObservation):
    """The wrapper with the signature of Gymnasium 0.29, which CleanRL's file uses."""

    def __init__(self, env: Any, func: Any, observation_space: Any = None) -> None:
        super().__init__(env, func, observation_space or env.observation_space)


class SyncVectorEnv(gym.vector.SyncVectorEnv):
    """The batch as of Gymnasium 0.29: the step that ends an episode also resets it.

    With Gymnasium's present default, the step after the end only resets, and CleanRL's
    file would learn from it.
    """

    def __init__(self, env_fns: Any) -> None:
        super().__init__(env_fns, autoreset_mode=AutoresetMode.SAME_STEP)

    def step(self, actions: Any) -> Any:
        """Runs one step; CleanRL's file expects another form of `final_info`."""
        result = super().step(actions)
        result[4].pop("final_info", None)
        return result


def main() -> None:
    """Runs CleanRL's file and prints whether its policy has learnt the maze."""
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    file = sys.argv[1]
    gym.register("Maze-v0", entry_point=make_maze)
    gym.wrappers.TransformObservation = TransformObservation
    gym.vector.SyncVectorEnv = SyncVectorEnv
    sys.argv = [file, *ARGUMENTS, *sys.argv[2:]]
    runpy.run_path(file, run_name="__main__")
    print(result_line())


if __name__ == "__main__":
    main()
