"""The controller that a command names, and the task that comes with it."""

from __future__ import annotations

import difflib
from dataclasses import replace
from pathlib import Path

from tdac_agent.cli.task_changes import changed_task
from tdac_agent.cli.task_choice import NAMING, chosen_task, with_named_file
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.errors import ControllerFileError
from tdac_agent.option_fields import words_of
from tdac_agent.runs.ownership import load_task
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE
from tdac_agent.verification.verify import weights_file


def with_own_set(controller: str, flags: TaskFlags) -> TaskFlags:
    """The flags; those of a run on a task set name its set, if no task is named."""
    flags = with_named_file(flags)
    if _names_a_task(flags) or not (Path(controller) / SET_FILE).is_file():
        return flags
    return replace(flags, set_name=controller)


def controller_and_task(controller: str, flags: TaskFlags) -> tuple[Path, Task]:
    """The controller file and its task, which a run folder brings.

    The flags change that task, or name another one.
    """
    file, folder = controller_file(controller), own_folder(controller, flags)
    if folder is None:
        return file, chosen_task(flags)
    return file, changed_task(load_task(folder), flags)


def own_folder(controller: str, flags: TaskFlags) -> Path | None:
    """The folder with a controller's own task; None if the flags name another one."""
    path = Path(controller)
    if _names_a_task(flags):
        return None
    if path.is_dir():
        return path
    return path.parent if (path.parent / TASK_FILE).is_file() else None


def change_note(controller: str, flags: TaskFlags) -> str:
    """How the flags change a controller's own task; empty if they do not."""
    words, folder = words_of(flags.changes), own_folder(controller, flags)
    if not words or folder is None:
        return ""
    text = " ".join(words).removeprefix("--").replace(" --", ", ")
    return f"judged as another task: {text}; this is not the verdict of {folder}"


def controller_file(controller: str) -> Path:
    """The controller file of a path, which may be that of a run folder."""
    path = Path(controller)
    if path.is_dir():
        file = path / "controller.py"
        if not file.is_file():
            raise ControllerFileError(_without_controller(path))
        return file
    if not path.exists() and path.suffix != ".py":
        raise ControllerFileError(_no_run(path))
    if not path.is_file():
        raise ControllerFileError(f"no controller {controller!r}: no such file")
    if path.suffix != ".py":
        raise ControllerFileError(f"{controller!r} is not a controller: expected a .py")
    if (weights := weights_file(path)) is not None:
        raise ControllerFileError(
            f"{controller!r} has weights beside it, {weights.name}, which it gets from "
            "tdac evaluate, tdac bench and tdac play --set only: move them away, or "
            "use one of these"
        )
    return path


def _names_a_task(flags: TaskFlags) -> bool:
    return any(getattr(flags, name) is not None for name in NAMING)


def _no_run(path: Path) -> str:
    """That there is no such run or controller, and which run has the nearest name."""
    folders = path.parent.iterdir() if path.parent.is_dir() else ()
    runs = {each.name: each for each in folders if each.is_dir()}
    nearest = difflib.get_close_matches(path.name, runs, 1, 0.0)
    text = f"there is no run or controller {str(path)!r}"
    return text + (f"; the nearest is {runs[nearest[0]]}" if nearest else "")


def _without_controller(folder: Path) -> str:
    """Why a folder has no controller, and what to do."""
    from tdac_agent.runs.run_record import RUN_FILE, load_run  # slow to import

    if (folder / RUN_FILE).is_file():
        from tdac_agent.runs.resume import resume_line

        command = resume_line(load_run(folder), folder)
        return f"the run {folder} has no controller yet; to continue it: {command}"
    return f"there is no controller.py in {folder}"


def check_folder(out: Path) -> None:
    """Checks before the work begins that the folder can be written to."""
    folder = out / "trajectories"
    missing = [each for each in (folder, out) if not each.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for each in missing:
            each.rmdir()
    except OSError as error:
        raise ControllerFileError(f"cannot write to {out}: {error.strerror}") from error
