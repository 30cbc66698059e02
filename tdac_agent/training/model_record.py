"""What is recorded about a model of stable-baselines3.

Needs the extra `tdac[sb3]`, so import this module only where it is used.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecCheckNan,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvWrapper

from tdac_agent.episodes.after_wrappers import LARGEST, FrameStack, Normalize, Stage
from tdac_agent.episodes.sb3_file import SavedPolicy
from tdac_agent.errors import RunError
from tdac_envs.learning.sb3 import SB3VecEnv
from tdac_envs.learning.wrapped_vector import WrappedVectorEnv
from tdac_envs.learning.wrappers import WRAPPERS

_SILENT_VEC = (VecMonitor, VecCheckNan)
"""Wrappers of batches that change no observation."""
_SILENT = ("OrderEnforcing", "PassiveEnvChecker", "TimeLimit", "Monitor")
"""Wrappers of environments that change no observation."""
_ALGOS = {"PPO": "ppo", "RecurrentPPO": "recurrent-ppo", "SAC": "sac", "TD3": "td3"}
_ADVICE = (
    "train with wrappers of tdac_envs.wrappers, or write a policy.py with its weights "
    "beside it (docs/bench.md)"
)


def record_of(model: Any, envs: VecEnv, noisy: bool) -> SavedPolicy:
    """What is recorded about a model.

    Args:
        model: Model of stable-baselines3 or sb3-contrib.
        envs: Its environments.
        noisy: Whether it acts with its noise.

    Raises:
        RunError: An environment or a wrapper is not known.
        ValidationError: The record is not valid.
    """
    after, inner = _after(envs)
    names, plain = _wrappers(inner)
    return SavedPolicy(
        algo=_ALGOS.get(type(model).__name__, type(model).__name__.lower()),
        wrappers=names,
        after=after,
        actions="noisy" if noisy else "likely",
        steps=int(model.num_timesteps),
        seed=model.seed,
        **_where(plain),
    )


def _after(envs: VecEnv) -> tuple[tuple[Stage, ...], VecEnv]:
    """The stages of SB3's wrappers, innermost first, and what they wrap."""
    stages: list[Stage] = []
    while isinstance(envs, VecEnvWrapper):
        if isinstance(envs, VecNormalize):
            if envs.norm_obs:
                stages.append(_normalize(envs))
        elif isinstance(envs, VecFrameStack):
            stages.append(FrameStack(count=int(envs.stacked_obs.n_stack)))
        elif not isinstance(envs, _SILENT_VEC):
            raise RunError(f"{type(envs).__name__} cannot be recorded: {_ADVICE}")
        envs = envs.venv
    return tuple(reversed(stages)), envs


def _normalize(envs: VecNormalize) -> Normalize:
    found: Any = envs.obs_rms
    if isinstance(found, dict):
        mean: Any = {key: _list(own.mean) for key, own in found.items()}
        var: Any = {key: _list(own.var) for key, own in found.items()}
    else:
        mean, var = _list(found.mean), _list(found.var)
    clip = min(float(envs.clip_obs), LARGEST)
    return Normalize(mean=mean, var=var, clip=clip, epsilon=envs.epsilon)


def _list(numbers: Any) -> list[float]:
    return [float(number) for number in np.ravel(numbers)]


def _wrappers(envs: VecEnv) -> tuple[tuple[str, ...], Any]:
    """The names of the wrappers, innermost first, and the plain environment."""
    if isinstance(envs, SB3VecEnv):
        batch = envs.batch
        if isinstance(batch, WrappedVectorEnv):
            return batch.names, batch.batch
        return (), batch
    if isinstance(envs, SubprocVecEnv) or not isinstance(envs, DummyVecEnv):
        raise RunError(
            f"the environments in a {type(envs).__name__} cannot be looked at: train "
            "with SB3VecEnv or DummyVecEnv"
        )
    env: Any = envs.envs[0]
    known = {
        kind if isinstance(kind, type) else type(kind): name
        for name, kind in WRAPPERS.items()
    }
    names = []
    while isinstance(env, gym.Wrapper):
        if type(env) in known:
            names.append(known[type(env)])
        elif type(env).__name__ not in _SILENT:
            raise RunError(f"{type(env).__name__} cannot be recorded: {_ADVICE}")
        env = env.env
    return tuple(reversed(names)), env


def _where(plain: Any) -> dict[str, Any]:
    """Name and hash of the task set that an environment has, if it has one."""
    if not hasattr(plain, "nominal") and not hasattr(plain, "setups"):
        raise RunError(f"expected environments of tdac_envs, got {plain}")
    tasks = getattr(getattr(plain, "_first", plain), "set", None)
    return {} if tasks is None else {"set": tasks.name, "set_sha256": tasks.sha256}
