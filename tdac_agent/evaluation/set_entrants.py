"""The policies of an evaluation on a task set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tdac_agent.builtin.level import controller_of
from tdac_agent.episodes.sb3_file import SavedPolicy
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.entrants import Entrant, entrants_of
from tdac_agent.storage.hashes import sha256_of
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet


def set_entrants(
    policies: Sequence[str | Path],
    tasks: TaskSet,
    wrappers: Sequence[str] | None = None,
) -> tuple[Entrant, ...]:
    """The entrants for names and paths of policies, each with its file.

    Args:
        policies: `builtin`, controller files, run folders, policies saved by
            stable-baselines3.
        tasks: The task set.
        wrappers: Wrappers of saved policies that do not record their own.

    Raises:
        TaskError: There is no such policy on a task set, or it was trained elsewhere.
        ControllerFileError: A file is missing or is not a policy.
    """
    return tuple(_fitting(each, tasks) for each in entrants_of(policies, wrappers))


def _fitting(entrant: Entrant, tasks: TaskSet) -> Entrant:
    kind = entrant.policy.kind
    if entrant.is_builtin:
        return _builtin(entrant, tasks)
    if kind not in ("controller", "sb3"):
        raise TaskError(
            f"{kind} does not drive on a task set: give controller files, run folders, "
            ".zip files of stable-baselines3, or builtin"
        )
    if entrant.saved is not None:
        _check_training(entrant.name, entrant.saved, tasks)
    return entrant


def _builtin(entrant: Entrant, tasks: TaskSet) -> Entrant:
    """The controller of the level.

    Raises:
        TaskError: There is none.
    """
    file = controller_of(tasks, "leave out builtin")
    policy = replace(entrant.policy, file=file)
    # raw read: shipped
    return replace(entrant, policy=policy, sha256=sha256_of(file.read_bytes()))


def _check_training(name: str, saved: SavedPolicy, tasks: TaskSet) -> None:
    """Refuses a policy that was not trained on this set.

    Raises:
        ControllerFileError: It was not.
    """
    if saved.set is None and not saved.tasks:
        return
    if saved.set is None:
        where = f"on {', '.join(saved.tasks)}, not on a task set"
    elif saved.set != tasks.name:
        where = f"on the task set {saved.set!r}, not on {tasks.name!r}"
    elif saved.set_sha256 != tasks.sha256:
        where = (
            f"on another version of the task set {tasks.name!r}, "
            f"{(saved.set_sha256 or '?')[:8]}, not on {tasks.sha256[:8]}"
        )
    else:
        return
    raise ControllerFileError(f"{name} was trained {where}")
