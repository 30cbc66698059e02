"""Policies of stable-baselines3: what a saved one is, and how it drives an episode.

A saved model is a zip file that holds pickled Python, which would run whatever its
author wanted. Of it only the weights are read, as plain numbers, and the settings that
are plain JSON; the network around them is made anew.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Space, spaces
from numpy.typing import NDArray

from tdac_agent.episodes.sb3_file import (
    ACTIVATION,
    SavedNetwork,
    load_weights,
    read_policy,
)
from tdac_agent.errors import ControllerFileError
from tdac_agent.sandbox import ControllerFault
from tdac_agent.tasks.setting import JudgedEnv
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command
from tdac_envs.core.intake import one_line
from tdac_envs.drive.env import Observation
from tdac_envs.learning.wrappers import wrap

_NETWORKS = {
    "stable_baselines3.common.policies": "ActorCriticPolicy",
    "stable_baselines3.sac.policies": "SACPolicy",
    "stable_baselines3.td3.policies": "TD3Policy",
}
"""By the module of the saved policy's class, the class for observations in a Box."""
_WITHOUT_SDE = "stable_baselines3.td3.policies"
_ACTIVATIONS = {"ReLU", "Tanh", "ELU", "LeakyReLU", "GELU", "SiLU", "Sigmoid", "SELU"}


class Learned:
    """A saved policy that drives one episode, always by its most likely action.

    Args:
        file: Saved by stable-baselines3.
        wrappers: Names of those that it was trained with.
        env: Of the episode.

    Raises:
        ControllerFault: It cannot be used in this environment.
    """

    def __init__(self, file: Path, wrappers: tuple[str, ...], env: JudgedEnv) -> None:
        plain: Any = env
        try:
            self._env: Any = wrap(plain, wrappers)
        except TaskError as error:
            raise ControllerFault(str(error), "import") from error
        space, actions = self._env.observation_space, env.action_space
        self._network = _network(file, _Spaces(space, actions, f"{space} {actions}"))

    def reset(self, observation: Observation) -> None:
        """A policy without a memory has nothing to do."""

    def policy(self, observation: Observation) -> NDArray[np.float32]:
        """The action, shape (2,), float32."""
        seen = self._seen(self._env, observation)
        try:
            action, _ = self._network.predict(seen, deterministic=True)
        # Of weights that no training makes, whatever torch makes of them.
        except (ValueError, RuntimeError) as error:
            told = f"the policy's network: {one_line(error)}"
            raise ControllerFault(told, "policy") from error
        return np.asarray(action, np.float32)

    def waited(self) -> float:
        """It waits for nothing."""
        return 0.0

    def _seen(self, env: Any, observation: Any) -> Any:
        """What the wrappers make of an observation, the innermost first."""
        if env is env.unwrapped:
            return observation
        return env.observation(self._seen(env.env, observation))


@dataclass(frozen=True, slots=True)
class _Spaces:
    """Of observations and actions; compared by what they are in words."""

    observation: Space[Any]
    action: Space[Any]
    text: str

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Spaces) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)


@lru_cache(maxsize=4)
def _network(file: Path, fit: _Spaces) -> Any:
    """The network of a saved policy for some spaces, with its weights.

    Raises:
        ControllerFault: It does not fit them, or is of a kind that is not known.
    """
    try:
        saved = read_policy(file)
        weights = load_weights(saved.weights)
    except ControllerFileError as error:
        raise ControllerFault(str(error), "import") from error
    import torch

    torch.set_num_threads(1)
    network = _made(saved, fit.observation, fit.action)
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise ControllerFault(
            "the policy was trained on other observations than its wrappers give on "
            f"this task: {one_line(error)[:160]}",
            "import",
        ) from error
    network.set_training_mode(False)
    return network


def check_kind(saved: SavedNetwork) -> None:
    """Refuses a policy of which no network can be made.

    Raises:
        ControllerFileError: It is of a kind that is not known, its settings do not
            fit its class, or an extra is not installed.
    """
    try:
        _made(saved, spaces.Box(-1.0, 1.0, (4,)), spaces.Box(-1.0, 1.0, (2,)))
    except ControllerFault as fault:
        raise ControllerFileError(str(fault)) from fault


def _made(saved: SavedNetwork, observation: Space[Any], action: Space[Any]) -> Any:
    """A network without its weights.

    Raises:
        ControllerFault: It is of a kind that is not known, or its settings do not fit
            its class.
    """
    kind = _class(saved.module, isinstance(observation, spaces.Dict))
    try:
        given = {**_kwargs(saved), "optimizer_class": _NoOptimizer}
        return kind(observation, action, lambda _: 0.0, **given)
    # What does not fit a class has errors of all kinds.
    except (TypeError, ValueError, KeyError, AssertionError, RuntimeError) as error:
        told = f"the policy's settings do not fit its class: {one_line(error)}"
        raise ControllerFault(told, "import") from error


class _NoOptimizer:
    """Stands where training has one; torch's own load its compiler, and leave files."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass


def _class(module: str, several: bool) -> Any:
    """The class of the network; `several` for observations in a Dict."""
    try:
        from importlib import import_module

        name = _NETWORKS[module]
        if several:
            actor_critic = name == "ActorCriticPolicy"
            name = "MultiInputActorCriticPolicy" if actor_critic else "MultiInputPolicy"
        return getattr(import_module(module), name)
    except ImportError as error:
        needed = f"SB3 policies need an extra: {install_command('sb3')}"
        raise ControllerFault(needed, "import") from error
    except KeyError as error:
        raise ControllerFault(
            f"a policy of {module[:80]} cannot be evaluated, but of PPO, A2C, SAC and "
            "TD3",
            "import",
        ) from error


def _kwargs(saved: SavedNetwork) -> dict[str, Any]:
    """Arguments of the network's class."""
    from torch import nn

    kwargs = saved.settings.model_dump(exclude_unset=True)
    found = re.fullmatch(ACTIVATION, kwargs.pop("activation_fn", None) or "")
    if found is not None:
        kwargs["activation_fn"] = getattr(nn, found[1], None)
        if found[1] not in _ACTIVATIONS:
            raise ControllerFault(f"no activation {found[1][:80]} is known", "import")
    if saved.module == _WITHOUT_SDE:
        kwargs.pop("use_sde")
    return kwargs
