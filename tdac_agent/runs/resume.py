"""Going on with a run: what a folder holds, and whether it is the run that is meant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.prompting.prompt import VARIANTS
from tdac_agent.runs.ownership import is_own, is_own_folder, wishes_of
from tdac_agent.runs.records import GIVEN_FILE, PROMPT_FILE, RUN_FILE, Run, load_run
from tdac_agent.storage.files import UNFINISHED
from tdac_agent.storage.locks import LOCK_FILE
from tdac_agent.tasks.task import Task, load_task
from tdac_agent.tasks.task_file import TASK_FILE
from tdac_agent.tasks.trust import permit
from tdac_envs.core.errors import why
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file

# What decides the questions of a run and what becomes of the answers, in plain words;
# two runs that differ in none of it are one run.
CONFIGURATION = {
    "version": "version of tdac",
    "task": "task",
    "task_sha256": "map, places or limits of the task",
    "suite_sha256": "suite",
    "learner": "learner",
    "optimizer": "optimizer",
    "served_at": "base URL",
    "iterations": "K",
    "patience": "J",
    "refine": "refinement of the prompt",
    "seed": "seed",
    "index": "index",
    "max_output": "max output",
    "given_sha256": "controller to begin with",
    "prompt_sha256": "first question",
}


def run_there(folder: Path) -> Run | None:
    """The run that a folder holds; None where the folder is empty or not there.

    Raises:
        RunError: It holds something else, or a run that cannot be read.
    """
    try:
        names = [path.name for path in folder.iterdir()] if folder.exists() else []
    except OSError as error:
        raise RunError(f"cannot write to {folder}: {error.strerror}") from error
    if RUN_FILE in names:
        return load_run(folder)
    # A process that was killed at once may have left these.
    if any(name != LOCK_FILE and not name.endswith(UNFINISHED) for name in names):
        raise RunError(f"the folder {folder} is not empty; give a new one with --out")
    return None


def check_same(before: Run, now: Run) -> None:
    """Refuses to go on with another run than the one that is there.

    Raises:
        RunError: It names all that differs.
    """
    differences = [
        _difference(words, getattr(before, name), getattr(now, name))
        for name, words in CONFIGURATION.items()
        if getattr(before, name) != getattr(now, name)
    ]
    if differences:
        raise RunError(
            f"{before.folder} holds another run ({'; '.join(differences)}): give a new "
            f"folder with --out, or go on with that one: tdac synth --resume "
            f"{before.folder}"
        )


def check_own(before: Run) -> None:
    """Refuses to take the verdict of a run that somebody else has made.

    Raises:
        RunError: It is one.
    """
    if not is_own_folder(before):
        raise RunError(
            f"{before.folder} holds a run that was not begun here, {before.status} by "
            f"its own account: test it with tdac verify {before.folder}, or give a new "
            "folder with --out"
        )


def _difference(words: str, there: object, here: object) -> str:
    """Short values are told; of hashes it is enough that they differ."""
    if words == "seed":
        there, here = ("none" if value is None else value for value in (there, here))
    if isinstance(there, int) or words in {"learner", "optimizer", "task", "seed"}:
        return f"{words} {there} there, {here} here"
    return f"another {words}"


def asked_for(
    folder: Path, given: Mapping[str, Any] | None = None, *, trust: bool = False
) -> dict[str, Any]:
    """The arguments of `synthesize` with which a run was begun.

    Args:
        folder: Of the run.
        given: Arguments in the place of those on record, `suite` among them; they
            allow what a run of somebody else's wants.
        trust: Whether such a run may do all that it wants.

    Raises:
        NotTrustedError: It is somebody else's, and something is not allowed.
        RunError: There is no run that can be read.
        TaskError: Its task cannot be read.
    """
    run = load_run(folder)
    if not (folder / TASK_FILE).is_file():
        raise RunError(
            f"the run in {folder} ended before it had begun: give its command again, "
            f"with --out {folder}"
        )
    flags = {name: value for name, value in (given or {}).items() if value is not None}
    task = _task(folder)
    if not is_own(run, task.suite):
        permit(folder, wishes_of(run, task, flags), trust=trust)
    suite = flags.pop("suite", None)
    if task.suite is not None:
        task = replace(task, suite=suite or task.suite, trusted=True)
    beginning, prompt = folder / GIVEN_FILE, folder / PROMPT_FILE
    on_record = {
        "task": task,
        "learner": run.learner,
        "optimizer": None if run.optimizer == run.learner else run.optimizer,
        "iterations": run.iterations,
        "patience": run.patience,
        "seed": run.seed,
        "index": run.index,
        "start_from": _text(beginning) if beginning.is_file() else None,
        "base_url": run.base_url,
        "refine": run.refine,
        "prompt": run.prompt if run.prompt in VARIANTS else str(prompt),
        "max_output": run.max_output,
        "out": folder,
    }
    return {**on_record, **flags}


def _text(file: Path) -> str:
    """A controller of a run.

    Raises:
        RunError: It cannot be read, or is not UTF-8.
    """
    try:
        return read_file(file, TEXT_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        raise RunError(f"cannot read {file}: {why(error)}") from error


def _task(folder: Path) -> Task:
    """A run's task with the parameters that it was begun with.

    The map or world of the folder is the same, but was read from another file, which
    the parameters tell.

    Raises:
        RunError: The parameters are damaged.
    """
    task = load_task(folder)
    setting: Any = task.setting
    try:
        raw = read_file(folder / "params.json", TEXT_BYTES)
        params = type(setting.params).model_validate(parse_json(raw))
    except (OSError, ValueError) as error:
        told = f"cannot go on with {folder}: params.json: {why(error)}"
        raise RunError(told) from error
    return replace(task, setting=replace(setting, params=params))
