"""Saves a policy that was trained with stable-baselines3, so that it can be compared.

Needs the extra `tdac[sb3]`.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tdac_agent.episodes.sb3_file import SavedPolicy, write_metadata
from tdac_agent.errors import RunError
from tdac_envs.core.errors import first_problem
from tdac_envs.core.extras import install_command


def save_policy(model: Any, file: Path | str, *, noisy: bool = False) -> SavedPolicy:
    """Saves a policy with what it observes, for `tdac evaluate` and `tdac bench`.

        model = PPO("MlpPolicy", VecNormalize(SB3VecEnv(wrap_for_rl(batch))))
        model.learn(1_000_000)
        save_policy(model, "mine.zip")

    The environments of the model tell which wrappers of `tdac_envs.wrappers` it was
    trained with, on which tasks, and what `VecNormalize` and `VecFrameStack` do.

    Args:
        model: Model of stable-baselines3 or sb3-contrib with its environments.
        file: File to write or replace, `NAME.zip`.
        noisy: Whether it acts with its noise, which is seeded, instead of its most
            likely action.

    Returns:
        What is recorded about it.

    Raises:
        RunError: An environment or a wrapper is not known, or the file cannot be
            written, or the extra is missing.
    """
    path = Path(file)
    if path.suffix != ".zip":
        raise RunError(f"expected a file NAME.zip, got {str(file)!r}")
    try:
        from tdac_agent.training.model_record import record_of
    except ImportError as error:
        needed = f"saving a policy needs an extra: {install_command('sb3')}"
        raise RunError(needed) from error
    envs = model.get_env()
    if envs is None:
        raise RunError("the model has no environments: give it some with set_env")
    try:
        saved = record_of(model, envs, noisy)
    except ValidationError as error:
        raise RunError(f"cannot record the policy: {first_problem(error)}") from None
    draft = path.with_name(f".{path.name}")
    try:
        model.save(draft)
        write_metadata(draft, saved)
        os.replace(draft, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise RunError(f"cannot write {path}: {error.strerror}") from error
    return saved
