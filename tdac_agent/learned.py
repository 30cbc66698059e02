"""Policies of stable-baselines3: what a saved one is, and how it drives an episode.

A saved model is a zip file that holds pickled Python, which would run whatever its
author wanted. Of it only the weights are read, as plain numbers, and the settings that
are plain JSON; the network around them is made anew.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from gymnasium import Space, spaces
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tdac_agent.errors import ControllerFileError
from tdac_agent.files import write_atomic
from tdac_agent.sandbox import ControllerFault
from tdac_agent.setting import JudgedEnv
from tdac_envs.driven import Observation
from tdac_envs.errors import TaskError, first_problem
from tdac_envs.extras import install_command
from tdac_envs.wrappers import wrap

METADATA = "tdac.json"
MOST_BYTES = 256 << 20
_NETWORKS = {
    "stable_baselines3.common.policies": "ActorCriticPolicy",
    "stable_baselines3.sac.policies": "SACPolicy",
    "stable_baselines3.td3.policies": "TD3Policy",
}
"""By the module of the saved policy's class, the class for observations in a Box."""
_FOR_TRAINING = {"optimizer_class", "optimizer_kwargs"}
_ACTIVATION = re.compile(r"<class 'torch\.nn\.modules\.activation\.(\w+)'>")


class SavedPolicy(BaseModel):
    """`tdac.json` in a policy's zip file, or beside it as `NAME.json`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1] = 1
    algo: str = Field(description="ppo, sac, …")
    tasks: tuple[str, ...] = Field((), description="That it was trained on.")
    wrappers: tuple[str, ...] = Field(description="Innermost first; see `wrap`.")
    variation: str = Field("jitter", description="Of the starts in training.")
    steps: int | None = Field(None, description="Of training.")
    seed: int | None = None


def read_metadata(file: Path) -> SavedPolicy | None:
    """What a policy's file says about itself; None where it says nothing.

    Raises:
        ControllerFileError: It is no policy of stable-baselines3, or says nonsense.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            names = archive.namelist()
            if not {"data", "policy.pth"} <= set(names):
                raise zipfile.BadZipFile("it holds no `data` and no `policy.pth`")
            text = archive.read(METADATA) if METADATA in names else None
    except (OSError, zipfile.BadZipFile) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ControllerFileError(
            f"{str(file)!r} is no policy of stable-baselines3: {reason}"
        ) from error
    beside = file.with_suffix(".json")
    if text is None and beside.is_file():
        text = beside.read_bytes()
    if text is None:
        return None
    try:
        return SavedPolicy.model_validate_json(text)
    except ValidationError as error:
        told = f"{METADATA} of {file}: {first_problem(error)}"
        raise ControllerFileError(told) from error


def write_metadata(file: Path, saved: SavedPolicy) -> None:
    """Puts what is to be known about a policy into its file, in the place of older."""
    content = io.BytesIO()
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(content, "w") as new:
        for item in old.infolist():
            if item.filename != METADATA:
                new.writestr(item, old.read(item))
        new.writestr(METADATA, saved.model_dump_json(indent=2))
    write_atomic(file, content.getvalue())


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
        action, _ = self._network.predict(seen, deterministic=True)
        return np.asarray(action, np.float32)

    def waited(self) -> float:
        """It waits for nothing."""
        return 0.0

    def _seen(self, env: Any, observation: Any) -> Any:
        """What the wrappers make of an observation, the innermost first."""
        if env is env.unwrapped:
            return observation
        return env.observation(self._seen(env.env, observation))


def _without_extra() -> ControllerFault:
    needed = f"SB3 policies need an extra: {install_command('sb3')}"
    return ControllerFault(needed, "import")


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
        import torch
    except ImportError as error:
        raise _without_extra() from error
    torch.set_num_threads(1)
    with zipfile.ZipFile(file) as archive:
        data = json.loads(archive.read("data"))
        weights = _weights(archive)
    kind = _class(data, isinstance(fit.observation, spaces.Dict))
    kwargs = _kwargs(data.get("policy_kwargs") or {})
    kwargs.setdefault("use_sde", bool(data.get("use_sde", False)))
    if kind.__name__.startswith("TD3") or "td3" in kind.__module__:
        kwargs.pop("use_sde")
    network = kind(fit.observation, fit.action, lambda _: 0.0, **kwargs)
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        first = " ".join(str(error).split())[:160]
        raise ControllerFault(
            "the policy was trained on other observations than its wrappers give on "
            f"this task: {first}",
            "import",
        ) from error
    network.set_training_mode(False)
    return network


def _weights(archive: zipfile.ZipFile) -> Any:
    import torch

    if archive.getinfo("policy.pth").file_size > MOST_BYTES:
        raise ControllerFault("the policy's weights are too large", "import")
    try:
        content = io.BytesIO(archive.read("policy.pth"))
        return torch.load(content, map_location="cpu", weights_only=True)
    # torch has no one error for what is not its own.
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise ControllerFault(
            f"the policy's weights cannot be read: {reason}", "import"
        ) from error


def _class(data: dict[str, Any], several: bool) -> Any:
    """The class of the network; `several` for observations in a Dict."""
    try:
        from importlib import import_module

        module = str((data.get("policy_class") or {}).get("__module__"))
        name = _NETWORKS[module]
        if several:
            actor_critic = name == "ActorCriticPolicy"
            name = "MultiInputActorCriticPolicy" if actor_critic else "MultiInputPolicy"
        return getattr(import_module(module), name)
    except ImportError as error:
        raise _without_extra() from error
    except KeyError as error:
        raise ControllerFault(
            f"a policy of {module} cannot be evaluated, but of PPO, A2C, SAC and TD3",
            "import",
        ) from error


def _kwargs(saved: dict[str, Any]) -> dict[str, Any]:
    """Settings of the network, as they were saved: JSON, or Python's words for it."""
    from torch import nn

    kwargs = {}
    for key, value in saved.items():
        if key.startswith(":") or key in _FOR_TRAINING:
            continue
        found = _ACTIVATION.fullmatch(value) if isinstance(value, str) else None
        if found:
            kwargs[key] = getattr(nn, found.group(1))
        elif isinstance(value, str):
            raise ControllerFault(
                f"the policy's {key} is code, {value[:80]}, which is not run", "import"
            )
        else:
            kwargs[key] = value
    return kwargs
