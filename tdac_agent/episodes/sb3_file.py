"""A policy saved by stable-baselines3: what is in its file, checked before it is used.

Nothing in it is run. Sizes are known before anything is unpacked, settings and weights
before anything is made of them.
"""

from __future__ import annotations

import io
import json
import pickletools
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tdac_agent.errors import ControllerFileError
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.errors import first_problem, why
from tdac_envs.core.extras import install_command
from tdac_envs.core.intake import TEXT_BYTES, one_line, parse_json, read_file, read_zip

METADATA = "tdac.json"
WEIGHTS = "policy.pth"
DATA = "data"
MOST_BYTES = 128_000_000
"""Of the file, and of its parts when they are unpacked."""

# All that a saved network is made of; others could fill the memory from a few bytes.
_NAMES = {
    "collections OrderedDict",
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
    *(f"torch {kind}Storage" for kind in ("Float", "Double", "Half", "BFloat16")),
}
_NAMING = {"GLOBAL", "STACK_GLOBAL", "INST", "EXT1", "EXT2", "EXT4"}
_FOR_TRAINING = {"optimizer_class", "optimizer_kwargs"}
ACTIVATION = r"<class 'torch\.nn\.modules\.activation\.(\w+)'>"

Layers = Annotated[list[Annotated[int, Field(ge=1, le=4096)]], Field(max_length=16)]
Number = Annotated[float, Field(ge=-1e6, le=1e6)]


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


class Settings(BaseModel):
    """`policy_kwargs`: how a network is built, without what only training needs."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    net_arch: Layers | dict[Literal["pi", "vf", "qf"], Layers] | None = None
    activation_fn: str | None = Field(None, pattern=f"^{ACTIVATION}$")
    use_sde: bool = False
    log_std_init: Number = 0.0
    full_std: bool = True
    use_expln: bool = False
    squash_output: bool = False
    ortho_init: bool = True
    clip_mean: Number = 2.0
    n_critics: int = Field(2, ge=1, le=8)
    normalize_images: bool = True
    share_features_extractor: bool = True
    features_extractor_kwargs: dict[str, None] | None = Field(None, max_length=0)


@dataclass(frozen=True, slots=True)
class SavedNetwork:
    """What a policy's file says of its network.

    Attributes:
        saved: What it says about itself, where it does.
        module: Of the class of the network.
        settings: Arguments of that class, those that the file has.
        weights: Bytes of a file of torch.
    """

    saved: SavedPolicy | None
    module: str
    settings: Settings
    weights: bytes


def read_policy(file: Path) -> SavedNetwork:
    """The parts of a policy's file.

    Raises:
        ControllerFileError: It is no policy of stable-baselines3, or says nonsense.
    """
    try:
        parts = read_zip(
            read_file(file, MOST_BYTES), MOST_BYTES, {DATA, WEIGHTS, METADATA}
        )
        if not {DATA, WEIGHTS} <= parts.keys():
            raise ValueError(f"it holds no `{DATA}` and no `{WEIGHTS}`")
    except (OSError, ValueError) as error:
        raise ControllerFileError(
            f"{str(file)!r} is no policy of stable-baselines3: {why(error)}"
        ) from error
    saved = _metadata(file, parts.get(METADATA))
    try:
        module, settings = _network(parts[DATA])
        _check_weights(parts[WEIGHTS])
    except ValueError as error:
        told = f"the policy {str(file)!r} cannot be used: {why(error)}"
        raise ControllerFileError(told) from error
    return SavedNetwork(saved, module, settings, parts[WEIGHTS])


def read_metadata(file: Path) -> SavedPolicy | None:
    """What a policy's file says about itself; None where it says nothing.

    Raises:
        ControllerFileError: It is no policy of stable-baselines3, or says nonsense.
    """
    return read_policy(file).saved


def write_metadata(file: Path, saved: SavedPolicy) -> None:
    """Puts what is to be known about a policy into its file, in the place of older."""
    content = io.BytesIO()
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(content, "w") as new:
        for item in old.infolist():
            if item.filename != METADATA:
                new.writestr(item, old.read(item))
        new.writestr(METADATA, saved.model_dump_json(indent=2))
    write_atomic(file, content.getvalue())


def load_weights(weights: bytes) -> Any:
    """The tensors of a saved network by their names.

    Raises:
        ControllerFileError: They cannot be read, or torch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        needed = f"SB3 policies need an extra: {install_command('sb3')}"
        raise ControllerFileError(needed) from error
    try:
        found = torch.load(io.BytesIO(weights), map_location="cpu", weights_only=True)
        usable = isinstance(found, dict) and all(
            isinstance(name, str)
            and isinstance(tensor, torch.Tensor)
            and tensor.is_floating_point()
            and bool(torch.isfinite(tensor).all())
            for name, tensor in found.items()
        )
    # torch has no one error for what is not its own.
    except Exception as error:
        told = f"the policy's weights cannot be read: {one_line(error)}"
        raise ControllerFileError(told) from error
    if not usable:
        raise ControllerFileError("the policy's weights are not all finite numbers")
    return found


def _metadata(file: Path, inside: bytes | None) -> SavedPolicy | None:
    """What is written about a policy in its file, or in one beside it."""
    beside = file.with_suffix(".json")
    try:
        text = inside
        if text is None and beside.is_file():
            text = read_file(beside, TEXT_BYTES)
        return None if text is None else SavedPolicy.model_validate(parse_json(text))
    except (OSError, ValueError) as error:
        told = f"{METADATA} of {file}: {why(error)}"
        raise ControllerFileError(told) from error


def _network(data: bytes) -> tuple[str, Settings]:
    """Module of the network's class, and its settings.

    Raises:
        ValueError: They are not as stable-baselines3 writes them.
    """
    try:
        found = json.loads(data.decode("utf-8"))
        module = str((found.get("policy_class") or {}).get("__module__"))
        given = dict(found.get("policy_kwargs") or {})
        given.setdefault("use_sde", found.get("use_sde") or False)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"its `{DATA}` is damaged: {one_line(error)}") from None
    kept = {
        key: value
        for key, value in given.items()
        if not key.startswith(":") and key not in _FOR_TRAINING
    }
    for key, value in kept.items():
        if isinstance(value, str) and key != "activation_fn":
            raise ValueError(f"its {key} is code, {value[:80]}, which is not run")
    try:
        return module, Settings.model_validate(kept)
    except ValidationError as error:
        raise ValueError(f"its policy_kwargs: {first_problem(error)}") from None


def _check_weights(weights: bytes) -> None:
    """Looks at the pickle of a file of torch, which is itself a zip file.

    Raises:
        ValueError: It is another file, or names what no saved network needs.
    """
    try:
        parts = read_zip(weights, MOST_BYTES)
        pickled = next(part for name, part in parts.items() if name.endswith(".pkl"))
        named = {
            str(argument) if operation.name == "GLOBAL" else operation.name
            for operation, argument, _ in pickletools.genops(pickled)
            if operation.name in _NAMING
        }
    # The reader of pickles has errors of all kinds for what is none.
    except Exception as error:
        raise ValueError(f"its `{WEIGHTS}` is damaged: {one_line(error)}") from None
    more = sorted(named - _NAMES)
    if more:
        raise ValueError(f"its `{WEIGHTS}` holds more than weights: {more[0]}")
