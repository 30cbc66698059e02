"""Files of stable-baselines3 policies, checked before use.

No code in a file runs. Sizes are checked before unpacking, settings and weights before
a network is built.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from tdac_agent.episodes.after_wrappers import Stage
from tdac_agent.episodes.torch_file import Weights, read_weights
from tdac_agent.errors import ControllerFileError
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.errors import first_problem, one_line_reason
from tdac_envs.core.extras import install_command
from tdac_envs.core.intake import one_line, parse_json, read_file, read_zip
from tdac_envs.core.strict_model import StrictModel

METADATA = "tdac.json"
WEIGHTS = "policy.pth"
POLICY = "policy.zip"
"""Its name in the folder of a training."""
DATA = "data"
MOST_BYTES = 128_000_000
"""Largest size of the file, and of its unpacked parts together."""

METADATA_BYTES = 16_000_000
"""Largest size of the metadata: the statistics of large observations have room."""

# stable-baselines3 does not compress; another program may.
_MOST_GROWTH, _SLACK_BYTES = 8, 1_000_000
_FOR_TRAINING = {"optimizer_class", "optimizer_kwargs"}
ACTIVATION = r"<class 'torch\.nn\.modules\.activation\.(\w+)'>"

EXTRACTOR = r"<class 'stable_baselines3\.common\.torch_layers\.(\w+)'>"
_CODE = {"activation_fn": ACTIVATION, "features_extractor_class": EXTRACTOR}
"""Settings that name a class of torch or stable-baselines3."""

Size = Annotated[int, Field(ge=0, le=4096)]
Layers = Annotated[list[Annotated[int, Field(ge=1, le=4096)]], Field(max_length=16)]
Number = Annotated[float, Field(ge=-1e6, le=1e6)]


class SavedPolicy(StrictModel):
    """`tdac.json` in a policy's zip file, or beside it as `NAME.json`."""

    schema_version: Literal[1] = 1
    algo: str = Field(description="Training algorithm: ppo, sac, …")
    tasks: tuple[str, ...] = Field((), description="Tasks of the training.")
    set: str | None = Field(None, description="Name of its task set, instead of tasks.")
    set_sha256: str | None = Field(None, description="Hash of this set.")
    wrappers: tuple[str, ...] = Field(description="Innermost first; see `wrap`.")
    after: tuple[Stage, ...] = Field(
        (), max_length=8, description="Then, what SB3's own wrappers did."
    )
    actions: Literal["likely", "noisy"] = Field(
        "likely", description="The most likely action, or one with the policy's noise."
    )
    variation: str = Field("jitter", description="Variation of the training.")
    steps: int | None = Field(None, description="Steps of the training.")
    seed: int | None = None


class Settings(StrictModel):
    """`policy_kwargs` that define the network, except those only training needs."""

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
    lstm_hidden_size: int = Field(256, ge=1, le=4096)
    n_lstm_layers: int = Field(1, ge=1, le=8)
    shared_lstm: bool = False
    enable_critic_lstm: bool = True
    normalize_images: bool = True
    share_features_extractor: bool = True
    features_extractor_class: str | None = Field(None, pattern=f"^{EXTRACTOR}$")
    features_extractor_kwargs: (
        dict[Literal["features_dim", "cnn_output_dim", "normalized_image"], Size] | None
    ) = None


@dataclass(frozen=True, slots=True)
class SavedNetwork:
    """Contents of a policy file.

    Attributes:
        saved: Metadata, or None.
        complete: Whether the metadata is in the file itself.
        module: Module of the network's class.
        settings: Arguments of that class that the file states.
        weights: Its tensors by name.
    """

    saved: SavedPolicy | None
    complete: bool
    module: str
    settings: Settings
    weights: dict[str, Weights]


def read_policy(file: Path) -> SavedNetwork:
    """Reads a policy file.

    Raises:
        ControllerFileError: It is not a stable-baselines3 policy, or is invalid.
    """
    try:
        content = read_file(file, MOST_BYTES)
        most = min(MOST_BYTES, _MOST_GROWTH * len(content) + _SLACK_BYTES)
        parts = read_zip(content, most, {DATA, WEIGHTS, METADATA})
        if not {DATA, WEIGHTS} <= parts.keys():
            raise ValueError(f"it has no `{DATA}` or no `{WEIGHTS}`")
    except (OSError, ValueError) as error:
        raise ControllerFileError(
            f"{str(file)!r} is not a stable-baselines3 policy: {one_line_reason(error)}"
        ) from error
    saved = _metadata(file, parts.get(METADATA))
    try:
        module, settings = _network(parts[DATA])
        weights = _weights(parts.pop(WEIGHTS))
    except ValueError as error:
        message = f"the policy {str(file)!r} cannot be used: {one_line_reason(error)}"
        raise ControllerFileError(message) from error
    return SavedNetwork(saved, METADATA in parts, module, settings, weights)


def write_metadata(file: Path, saved: SavedPolicy) -> None:
    """Writes metadata into a policy file, replacing any older metadata."""
    content = io.BytesIO()
    # raw read: bytes in memory
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(content, "w") as new:
        for item in old.infolist():
            if item.filename != METADATA:
                new.writestr(item, old.read(item))
        new.writestr(METADATA, saved.model_dump_json(indent=2))
    write_atomic(file, content.getvalue())


def load_weights(weights: dict[str, Weights]) -> Any:
    """Returns the tensors of a saved network by name, as torch's.

    Raises:
        ControllerFileError: They are not finite, or torch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        needed = f"SB3 policies need an extra: {install_command('sb3')}"
        raise ControllerFileError(needed) from error
    kinds = {
        "Float": torch.float32,
        "Double": torch.float64,
        "Half": torch.float16,
        "BFloat16": torch.bfloat16,
    }
    tensors = {}
    for name, saved in weights.items():
        # A copy, since torch writes to what it is given.
        flat = torch.frombuffer(bytearray(saved.data), dtype=kinds[saved.kind])
        tensors[name] = flat.to(torch.float32).reshape(saved.shape)
        if not bool(torch.isfinite(tensors[name]).all()):
            raise ControllerFileError("the policy's weights are not all finite numbers")
    return tensors


def _metadata(file: Path, inside: bytes | None) -> SavedPolicy | None:
    """Returns a policy's metadata from its file, or from the JSON file beside it."""
    beside = file.with_suffix(".json")
    try:
        text = inside
        if text is not None and len(text) > METADATA_BYTES:
            raise ValueError(f"it is larger than {METADATA_BYTES:,} B")
        if text is None and beside.is_file():
            text = read_file(beside, METADATA_BYTES)
        return None if text is None else SavedPolicy.model_validate(parse_json(text))
    except (OSError, ValueError) as error:
        raise ControllerFileError(
            f"{METADATA} of {file}: {one_line_reason(error)}"
        ) from error


def _network(data: bytes) -> tuple[str, Settings]:
    """Returns the module of the network's class, and its settings."""
    try:
        parsed = json.loads(data.decode("utf-8"))
        module = str((parsed.get("policy_class") or {}).get("__module__"))
        arguments = dict(parsed.get("policy_kwargs") or {})
        arguments.setdefault("use_sde", parsed.get("use_sde") or False)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"its `{DATA}` is damaged: {one_line(error)}") from None
    kept = {
        key: value
        for key, value in arguments.items()
        if not key.startswith(":") and key not in _FOR_TRAINING
    }
    for key, value in kept.items():
        known = _CODE.get(key)
        if isinstance(value, str) and not (known and re.fullmatch(known, value)):
            raise ValueError(f"its {key} is code, which is not run: {value[:80]}")
    try:
        return module, Settings.model_validate(kept)
    except ValidationError as error:
        raise ValueError(f"its policy_kwargs: {first_problem(error)}") from None


def _weights(content: bytes) -> dict[str, Weights]:
    """Returns the tensors in a torch file."""
    try:
        return read_weights(content)
    # `pickletools` raises various errors for invalid pickles.
    except Exception as error:
        raise ValueError(f"its `{WEIGHTS}` is damaged: {one_line(error)}") from None
