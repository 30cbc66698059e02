"""Driving with saved stable-baselines3 policies.

A saved model is a zip file with pickled Python objects, which could run any code. Only
the weights, as plain numbers, and the settings in plain JSON are read from it; the
network is constructed anew.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Space, spaces
from numpy.typing import NDArray

from tdac_agent.episodes.after_wrappers import Stages
from tdac_agent.episodes.sb3_file import (
    ACTIVATION,
    EXTRACTOR,
    SavedNetwork,
    SavedPolicy,
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
from tdac_envs.learning.wrapping import wrap_for_rl

_SAC, _WITHOUT_SDE = "stable_baselines3.sac.policies", "stable_baselines3.td3.policies"
_NETWORKS = {
    "stable_baselines3.common.policies": "ActorCriticPolicy",
    _SAC: "SACPolicy",
    _WITHOUT_SDE: "TD3Policy",
    "sb3_contrib.common.recurrent.policies": "RecurrentActorCriticPolicy",
    "tdac_agent.episodes.memory_policy": "MemoryPolicy",
}
"""Policy class for observations in a Box, by the module of the saved class."""
_ACTIVATIONS = {"ReLU", "Tanh", "ELU", "LeakyReLU", "GELU", "SiLU", "Sigmoid", "SELU"}
_EXTRACTORS = {"FlattenExtractor", "CombinedExtractor", "NatureCNN"}

# Layers up to this size are built in memory: the policy class computes its noise there.
_SMALL = 10_000


class Learned:
    """A saved policy that drives one episode with its deterministic action.

    Args:
        file: Model file of stable-baselines3.
        wrappers: Names of the wrappers it was trained with, innermost first.
        env: Environment of the episode.
        seed: Seed of its noise, if it acts with noise.

    Raises:
        ControllerFault: The policy cannot be used in this environment.
    """

    def __init__(
        self, file: Path, wrappers: tuple[str, ...], env: JudgedEnv, seed: int = 0
    ) -> None:
        plain: Any = env
        stamp = _stamp(file)
        saved = _saved(file, stamp)
        try:
            self._env: Any = wrap_for_rl(plain, wrappers)
            own = self._env.observation_space
            self._after = Stages(saved.after if saved else (), own)
        except TaskError as error:
            raise ControllerFault(str(error), "import") from error
        self._noisy, self._seed = bool(saved and saved.actions == "noisy"), seed
        space, actions = self._after.space, env.action_space
        text = f"{space} {actions}"
        self._network = _load_network(file, stamp, _Spaces(space, actions, text))
        self._memory: Any = None

    def reset(self, observation: Observation) -> None:  # noqa: ARG002
        """Begins an episode, with an empty memory."""
        self._memory = None
        self._after.reset()
        if self._noisy:
            import torch

            torch.manual_seed(self._seed)

    def policy(self, observation: Observation) -> NDArray[np.float32]:
        """Returns the action, shape (2,), float32."""
        wrapped = self._after.apply(self._wrapped(self._env, observation))
        try:
            action, self._memory = self._network.predict(
                wrapped, self._memory, deterministic=not self._noisy
            )
        # Manipulated weights can cause various errors of torch.
        except (ValueError, RuntimeError) as error:
            message = f"the policy's network: {one_line(error)}"
            raise ControllerFault(message, "policy") from error
        return np.asarray(action, np.float32)

    def waited(self) -> float:
        """Returns 0."""
        return 0.0

    def _wrapped(self, env: Any, observation: Any) -> Any:
        """Applies the wrappers to an observation, the innermost first."""
        if env is env.unwrapped:
            return observation
        return env.observation(self._wrapped(env.env, observation))


@dataclass(frozen=True, slots=True)
class _Spaces:
    """Observation and action space; compared by text, as keys of a cache."""

    observation: Space[Any] = field(compare=False)
    action: Space[Any] = field(compare=False)
    text: str


_Stamp = tuple[tuple[int, int, int] | None, ...]


def _stamp(file: Path) -> _Stamp:
    """What tells a file that was written anew from the old one, as a key of a cache."""
    found: list[tuple[int, int, int] | None] = []
    for path in (file, file.with_suffix(".json")):
        try:
            status = path.stat()
            found.append((status.st_mtime_ns, status.st_ino, status.st_size))
        except OSError:
            found.append(None)
    return tuple(found)


@lru_cache(maxsize=4)
def _saved(file: Path, stamp: _Stamp) -> SavedPolicy | None:  # noqa: ARG001
    """Returns what a policy's file records about it.

    Raises:
        ControllerFault: It is not a policy.
    """
    try:
        return read_policy(file).saved
    except ControllerFileError as error:
        raise ControllerFault(str(error), "import") from error


@lru_cache(maxsize=4)
def _load_network(file: Path, stamp: _Stamp, fit: _Spaces) -> Any:  # noqa: ARG001
    """Returns the network of a saved policy, with its weights."""
    try:
        saved = read_policy(file)
        weights = load_weights(saved.weights)
    except ControllerFileError as error:
        raise ControllerFault(str(error), "import") from error
    import torch

    torch.set_num_threads(1)
    network = _build(saved, fit.observation, fit.action)
    try:
        network.load_state_dict(weights, assign=True)
    except RuntimeError as error:
        raise ControllerFault(
            "the policy was trained on other observations than its wrappers produce on "
            f"this task: {one_line(error)[:160]}",
            "import",
        ) from error
    network.set_training_mode(False)
    return network


def check_kind(saved: SavedNetwork) -> None:
    """Checks that a network can be built from a saved policy, and has its weights.

    Raises:
        ControllerFileError: The policy is of an unknown kind, its settings do not fit
            its class or its weights, or an extra is not installed.
    """
    own = saved.settings
    if own.features_extractor_class or own.features_extractor_kwargs:
        return  # Its layers follow from the observations, which are not known yet.
    try:
        first, second = _shapes(saved, 4), _shapes(saved, 5)
    except ControllerFault as fault:
        raise ControllerFileError(str(fault)) from fault
    shapes = {name: weights.shape for name, weights in saved.weights.items()}
    odd = sorted(first.keys() ^ shapes.keys())
    odd = odd or [name for name in shapes if _differs(name, first, second, shapes)]
    if odd:
        raise ControllerFileError(
            f"the policy's weights do not fit its settings: {one_line(odd[0])[:80]}"
        )


_Shapes = dict[str, tuple[int, ...]]


def _shapes(saved: SavedNetwork, size: int) -> _Shapes:
    """Returns the shapes of a network's weights for observations of some size."""
    observation = spaces.Box(-1.0, 1.0, (size,))
    network = _build(saved, observation, spaces.Box(-1.0, 1.0, (2,)))
    return {name: tuple(held.shape) for name, held in network.state_dict().items()}


def _differs(name: str, first: _Shapes, second: _Shapes, shapes: _Shapes) -> bool:
    """Whether a size is wrong, apart from those that depend on the observation."""
    if len(shapes[name]) != len(first[name]):
        return True
    rows = zip(first[name], second[name], shapes[name], strict=True)
    return any(one == other != size for one, other, size in rows)


def _build(saved: SavedNetwork, observation: Space[Any], action: Space[Any]) -> Any:
    """Builds a network without its weights, which takes no memory for them."""
    kind = _policy_class(saved.module, isinstance(observation, spaces.Dict))
    try:
        kwargs = {**_policy_kwargs(saved), "optimizer_class": _NoOptimizer}
        with _without_memory():
            return kind(observation, action, lambda _: 0.0, **kwargs)
    # Unsuitable settings can cause various errors.
    except (
        *(TypeError, ValueError, LookupError, AttributeError, ArithmeticError),
        *(AssertionError, RuntimeError, MemoryError),
    ) as error:
        reason = one_line(error) or type(error).__name__
        message = f"the policy's settings do not fit its class: {reason}"
        raise ControllerFault(message, "import") from error


@contextmanager
def _without_memory() -> Iterator[None]:
    """Makes layers whose weights have shapes and no numbers."""
    import torch
    from torch.overrides import TorchFunctionMode

    class Shapes(TorchFunctionMode):
        """Makes large tensors on torch's device `meta`; moves none."""

        def __torch_function__(
            self, function: Any, types: Any, args: Any = (), kwargs: Any = None
        ) -> Any:
            del types
            keywords = kwargs or {}
            if function is torch.empty:
                shape = torch.empty(*args, **keywords | {"device": "meta"})
                if shape.numel() > _SMALL:
                    return shape
            # stable-baselines3 moves all tensors to where the first one is.
            elif function is torch.Tensor.to:
                return args[0]
            return function(*args, **keywords)

    with Shapes():
        yield


class _NoOptimizer:
    """Replaces torch's optimizers, which import its compiler and leave files behind."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass


def _policy_class(module: str, dict_observation: bool) -> Any:
    try:
        from importlib import import_module

        name = _NETWORKS[module]
        if dict_observation:
            name = {
                "ActorCriticPolicy": "MultiInputActorCriticPolicy",
                "RecurrentActorCriticPolicy": "RecurrentMultiInputActorCriticPolicy",
            }.get(name, "MultiInputPolicy")
        return getattr(import_module(module), name)
    except ImportError as error:
        needed = f"SB3 policies need an extra: {install_command('sb3')}"
        raise ControllerFault(needed, "import") from error
    except (KeyError, AttributeError) as error:
        raise ControllerFault(
            f"a policy from {module[:80]} cannot be evaluated; expected one of PPO, "
            "RecurrentPPO, A2C, SAC or TD3",
            "import",
        ) from error


def _policy_kwargs(saved: SavedNetwork) -> dict[str, Any]:
    from torch import nn

    kwargs = saved.settings.model_dump(exclude_unset=True)
    match = re.fullmatch(ACTIVATION, kwargs.pop("activation_fn", None) or "")
    if match is not None:
        kwargs["activation_fn"] = getattr(nn, match[1], None)
        if match[1] not in _ACTIVATIONS:
            raise ControllerFault(f"unknown activation {match[1][:80]}", "import")
    match = re.fullmatch(EXTRACTOR, kwargs.pop("features_extractor_class", None) or "")
    if match is not None:
        from stable_baselines3.common import torch_layers

        if match[1] not in _EXTRACTORS:
            raise ControllerFault(f"unknown extractor {match[1][:80]}", "import")
        kwargs["features_extractor_class"] = getattr(torch_layers, match[1])
    if saved.module == _WITHOUT_SDE:
        kwargs.pop("use_sde")
    elif saved.module != _SAC:
        # `ortho_init` needs numbers, and these layers have none.
        kwargs["ortho_init"] = False
    return kwargs
