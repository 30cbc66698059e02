"""`train`: a baseline of stable-baselines3 on some tasks, in a folder of its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tdac_agent.errors import RunError
from tdac_agent.storage.locks import LOCK_FILE, hold
from tdac_agent.training.curve import PLAN_FILE, Point
from tdac_agent.training.plan import TrainingPlan, read_plan, write_plan
from tdac_agent.training.vouched import check
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
) -> list[Point]:
    """Trains, and leaves the best policy and its learning curve in a folder.

    Where the folder has the same training already, interrupted or killed, it goes on
    from its last checkpoint; where it is finished, nothing is done.

    Args:
        plan: See `make_plan`.
        folder: Is made if it is missing.
        watch: Told the steps so far, new evaluations, and the best one.
        trust: Whether a checkpoint may be loaded that was not written here.

    Returns:
        The learning curve.

    Raises:
        NotTrustedError: The checkpoint was not written here.
        RunError: The folder holds another training or something else, or cannot be
            used, or another process trains in it.
        TaskError: The extra is missing, or a task has changed.
    """
    check_extra()
    from tdac_agent.training.learning import learn

    _prepare(folder, plan)
    with hold(folder / LOCK_FILE) as held:
        if not held:
            raise RunError(f"another process trains in {folder}")
        check(folder, trust=trust)
        return learn(plan, folder, watch or (lambda *_: None))


def check_extra() -> None:
    """Whether what trains is installed.

    Raises:
        TaskError: It is not, with the command that does it.
    """
    try:
        import tdac_agent.training.learning  # noqa: F401
    except ImportError as error:
        needed = f"training needs an extra: {install_command('sb3')}"
        raise TaskError(needed) from error


def _prepare(folder: Path, plan: TrainingPlan) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
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
                f"{folder} holds another training: give another --out, or go on with "
                f"it as it was begun by --resume {folder}"
            )
    elif used:
        raise RunError(f"{folder} is not empty, and holds no training")
    write_plan(folder, plan)
