"""Hyperparameters of the baselines, from files in the format of rl-zoo3."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tdac_agent.storage.shipped import shipped
from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file
from tdac_envs.learning.wrappers import WRAPPERS

Algo = Literal["ppo", "recurrent-ppo", "sac", "td3"]
_LINEAR = "lin_"
_CHOSEN = "tdac_envs.wrappers.wrap_for_rl"
"""The function that chooses wrappers by what an environment tells."""


@dataclass(frozen=True, slots=True)
class Hyperparameters:
    """The hyperparameters of one algorithm for one environment.

    Attributes:
        wrappers: Names of `WRAPPERS`, innermost first; None for those that
            `wrap_for_rl` chooses.
        n_envs: Number of robots in parallel.
        steps: Training steps, all robots together.
        policy: Name of the policy class in stable-baselines3.
        initial_action: What both wheels do on average before the training, in [-1, 1].
        env: Arguments of the training environments.
        model: Further arguments of the algorithm's class, as written in the file.
    """

    wrappers: tuple[str, ...] | None
    n_envs: int
    steps: int
    policy: str
    initial_action: float
    env: dict[str, Any]
    model: dict[str, Any]


def config_file(algo: Algo) -> Path:
    """The shipped file of an algorithm."""
    return shipped(f"sb3/{algo}.yml")


def read_hyperparameters(file: Path, env: str) -> Hyperparameters:
    """Reads the hyperparameters for an environment.

    Args:
        file: File in the format of rl-zoo3.
        env: Id of the environment, a key of the file.

    Raises:
        TaskError: The file cannot be read, or a key is missing or invalid.
    """
    try:
        data = parse_yaml(read_file(file, TEXT_BYTES))
    except (OSError, ValueError) as error:
        message = f"cannot read hyperparameters {file}: {one_line_reason(error)}"
        raise TaskError(message) from error
    if not isinstance(data, dict) or not isinstance(data.get(env), dict):
        raise TaskError(f"{file} has no hyperparameters for {env}")
    model = dict(data[env])
    try:
        return Hyperparameters(
            _wrapper_names(model.pop("env_wrapper", [])),
            int(model.pop("n_envs", 1)),
            int(model.pop("n_timesteps")),
            str(model.pop("policy", "MlpPolicy")),
            _share("initial_action", model.pop("initial_action", 0.0)),
            dict(model.pop("env_kwargs", {})),
            model,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise TaskError(f"{file}, {env}: {error}") from error


def _share(name: str, value: Any) -> float:
    """A number in [-1, 1].

    Raises:
        ValueError: It is none.
    """
    if not isinstance(value, int | float) or not -1.0 <= value <= 1.0:
        raise ValueError(f"{name}: expected a number from -1 to 1, got {value!r}")
    return float(value)


def model_arguments(model: dict[str, Any]) -> dict[str, Any]:
    """Converts arguments of a file to those of stable-baselines3.

    Args:
        model: Arguments as in the file: `lin_1e-3` for a rate that falls to zero,
            `noise_type: normal` and `noise_std` for action noise, and the name of a
            class of `torch.nn` as `activation_fn` of the policy.

    Raises:
        TaskError: A schedule or type of noise is not supported.
    """
    arguments = {key: _scheduled(key, value) for key, value in model.items()}
    kind, spread = arguments.pop("noise_type", None), arguments.pop("noise_std", 0.0)
    if kind is not None and kind != "normal":
        raise TaskError(f"expected noise_type: normal, got {kind!r}")
    if kind is not None:
        from stable_baselines3.common.noise import NormalActionNoise

        zeros = np.zeros(2)  # one per wheel
        arguments["action_noise"] = NormalActionNoise(zeros, zeros + float(spread))
    network = arguments.get("policy_kwargs")
    if isinstance(network, dict) and isinstance(network.get("activation_fn"), str):
        own = {"activation_fn": _activation(network["activation_fn"])}
        arguments["policy_kwargs"] = network | own
    return arguments


def _activation(name: str) -> Any:
    """The class of an activation function.

    Raises:
        TaskError: There is no such class.
    """
    from torch import nn

    found = getattr(nn, name, None)
    if not (isinstance(found, type) and issubclass(found, nn.Module)):
        raise TaskError(f"activation_fn: torch.nn has no {name!r}")
    return found


def _wrapper_names(paths: list[str] | str) -> tuple[str, ...] | None:
    if paths == _CHOSEN:
        return None
    # The public module `wrappers` of a package re-exports its wrappers.
    public = {
        f"{w.__module__.partition('.')[0]}.wrappers.{w.__qualname__}": name
        for name, w in WRAPPERS.items()
    }
    full = {f"{w.__module__}.{w.__qualname__}": name for name, w in WRAPPERS.items()}
    known = full | public
    wanted = [paths] if isinstance(paths, str) else paths
    wrong = [path for path in wanted if path not in known]
    if wrong:
        raise ValueError(
            f"env_wrapper: expected {_CHOSEN}, or some of {', '.join(public)}; got "
            f"{wrong[0]}"
        )
    return tuple(known[path] for path in wanted)


def _scheduled(key: str, value: Any) -> Any:
    if not isinstance(value, str) or not value.startswith(_LINEAR):
        return value
    try:
        return linear(float(value.removeprefix(_LINEAR)))
    except ValueError:
        raise TaskError(f"expected {key} as in lin_1e-3, got {value!r}") from None


def linear(first: float) -> Callable[[float], float]:
    """A schedule that falls linearly from `first` to zero during the training."""
    return lambda left: left * first
