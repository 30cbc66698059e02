"""The weights of a kept policy, with which another training begins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tdac_agent.episodes.sb3_file import MOST_BYTES, load_weights, read_policy
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.training.plan import TrainingPlan
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import read_file

_SHOWN = 3


def begun_from(plan: TrainingPlan, file: Path) -> TrainingPlan:
    """A plan that begins with the weights of a policy.

    Args:
        plan: The plan.
        file: A .zip of stable-baselines3, whose network and wrappers are the plan's.

    Raises:
        ControllerFileError: It is no such policy.
        TaskError: It was trained with other wrappers.
    """
    saved = read_policy(file).saved
    if saved is not None and saved.wrappers != plan.wrappers:
        theirs = ", ".join(saved.wrappers) or "none"
        raise TaskError(
            f"--from {file}: it was trained with the wrappers {theirs}, this training "
            f"has {', '.join(plan.wrappers) or 'none'}; choose them with --wrapper, or "
            "--uses"
        )
    own = {
        "from_policy": str(file.resolve()),
        "from_sha256": sha256_of(read_file(file, MOST_BYTES)),
    }
    return plan.model_copy(update=own)


def load_first(model: Any, plan: TrainingPlan) -> None:
    """Gives a new model the weights that its plan begins with, if it does.

    Raises:
        RunError: The file has changed, or has another network.
    """
    if plan.from_policy is None:
        return
    file = Path(plan.from_policy)
    try:
        if sha256_of(read_file(file, MOST_BYTES)) != plan.from_sha256:
            raise RunError(f"{file} has changed since this training was planned")
        weights = load_weights(read_policy(file).weights)
    except (OSError, ControllerFileError) as error:
        raise RunError(f"cannot begin from {file}: {error}") from error
    own = model.policy.state_dict()
    wrong = [
        name
        for name in sorted(own.keys() | weights.keys())
        if name not in own
        or name not in weights
        or own[name].shape != weights[name].shape
    ]
    if wrong:
        some = ", ".join(wrong[:_SHOWN])
        raise RunError(
            f"cannot begin from {file}: its network is another one than this "
            f"training's, as in {some}"
        )
    model.policy.load_state_dict(weights)
