"""`train`: trains a baseline of stable-baselines3 in a folder of its own."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from tdac_agent.errors import RunError
from tdac_agent.storage.links import refuse_links
from tdac_agent.storage.locks import LOCK_FILE, hold
from tdac_agent.training.checkpoint_marks import check
from tdac_agent.training.curve import PLAN_FILE, Point
from tdac_agent.training.plan import TrainingPlan, read_plan, write_plan
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command

if TYPE_CHECKING:
    from tdac_agent.training.learning import Watch


def train(
    plan: TrainingPlan,
    folder: Path,
    watch: Watch | None = None,
    *,
    trust: bool = False,
    threads: int | None = None,
) -> list[Point]:
    """Trains, and writes the best policy and its learning curve to a folder.

    If the folder has the same training already, it is resumed from its last checkpoint;
    a finished training is left as it is.

    Args:
        plan: Plan from `make_plan`.
        folder: Folder of the training; made if missing.
        watch: Called with the steps so far, a new evaluation or None, and the best one.
        trust: Whether another installation's checkpoint may be loaded.
        threads: Number of threads that step robots, which does not affect the results;
            by default the number of cores.

    Returns:
        The learning curve.

    Raises:
        NotTrustedError: The checkpoint was not written by this installation.
        RunError: The folder contains another training or something else, cannot be
            used, another process trains in it, or a link leads out of it.
        TaskError: The extra is missing, or a task has changed.
    """
    check_extra()
    from tdac_agent.training.learning import learn

    prepare(folder, plan)
    with hold(folder / LOCK_FILE) as held:
        if not held:
            raise RunError(f"another process trains in {folder}")
        check(folder, trust=trust)
        return learn(plan, folder, watch or (lambda *_: None), threads)


def check_extra() -> None:
    """Checks that the extra for training is installed.

    Raises:
        TaskError: It is missing; the message has the install command.
    """
    try:
        import tdac_agent.training.learning  # noqa: F401
    except ImportError as error:
        needed = f"training needs an extra: {install_command('sb3')}"
        raise TaskError(needed) from error


def prepare(folder: Path, plan: TrainingPlan) -> None:
    """Makes the folder of a training, with its plan.

    Raises:
        RunError: As for `train`.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        refuse_links(folder, "*")
        used = any(folder.iterdir())
    except OSError as error:
        raise RunError(f"cannot use {folder}: {error.strerror}") from error
    if (folder / PLAN_FILE).is_file():
        before = read_plan(folder)
        longer = before.model_copy(
            update={"steps": plan.steps, "evaluate_every": plan.evaluate_every}
        )
        if longer != plan:
            raise RunError(
                f"{folder} contains another training: give another folder with --out, "
                f"or resume it unchanged with {shlex.join(['--resume', str(folder)])}"
            )
    elif used:
        raise RunError(f"{folder} is not empty and contains no training")
    write_plan(folder, plan)
