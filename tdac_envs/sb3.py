"""A batched environment as Stable-Baselines3 takes it; needs the extra `sb3`.

The public face of `tdac_envs.learning.sb3`.
"""

from tdac_envs.learning.sb3 import Indices, SB3VecEnv

__all__ = [
    "Indices",
    "SB3VecEnv",
]
