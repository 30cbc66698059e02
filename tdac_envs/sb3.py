"""Adapter from batched environments to Stable-Baselines3; needs the extra `sb3`.

Re-exports the public names of `tdac_envs.learning.sb3`.
"""

from tdac_envs.learning.sb3 import Indices, SB3VecEnv

__all__ = [
    "Indices",
    "SB3VecEnv",
]
