"""Resuming a run: which run a folder has, and whether it is the requested one."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.problems.choice import kept_problem
from tdac_agent.prompting.given_rules import given_book
from tdac_agent.prompting.prompt import is_shipped
from tdac_agent.runs.ownership import (
    called,
    has_earlier_mark,
    is_own,
    is_own_folder,
    remark_on,
    wishes_of,
)
from tdac_agent.runs.run_record import (
    AGENT,
    GIVEN_FILE,
    PROMPT_FILE,
    RUN_FILE,
    Run,
    load_run,
)
from tdac_agent.storage.files import UNFINISHED, read_inside
from tdac_agent.storage.locks import LOCK_FILE
from tdac_agent.tasks.trust import permit
from tdac_envs.core.errors import one_line_reason
from tdac_envs.core.intake import TEXT_BYTES

# Fields that determine the questions of a run and the use of the answers, as named in
# messages. Runs that agree in all of them are the same run.
CONFIGURATION = {
    "version": "version of tdac",
    "task": "task",
    "task_sha256": "map, start, goal or limits of the task",
    "dynamics": "dynamics",
    "profile": "profile",
    "suite_sha256": "suite",
    "learner": "learner",
    "optimizer": "optimizer",
    "served_at": "base URL",
    "iterations": "K",
    "patience": "J",
    "candidates": "number of candidates",
    "search": "search",
    "ask": "kinds of questions",
    "refine": "refinement of the prompt",
    "vision": "pictures",
    "seed": "seed",
    "index": "index",
    "max_output": "max output",
    "given_sha256": "initial controller",
    "given_rules": "given rules",
    "omit": "omitted facts",
    "prompt_sha256": "first question",
    "episodes": "number of episodes",
    "feedback_episodes": "feedback episodes",
    "improve": "number of improving episodes",
    "envelope": "number of episodes of a search for the smallest failure",
}

NOT_TO_BE_RESUMED = {"version", "dynamics", "vision"}
"""Fields that no option of a command restores, if the task is the same."""


def existing_run(folder: Path) -> Run | None:
    """The run in a folder; None if the folder is empty or missing.

    Raises:
        RunError: The folder has other contents, or a run that cannot be read.
    """
    try:
        names = [path.name for path in folder.iterdir()] if folder.exists() else []
    except OSError as error:
        raise RunError(f"cannot write to {folder}: {error.strerror}") from error
    if RUN_FILE in names:
        return load_run(folder)
    # A process that was killed at its start may have left these.
    if any(name != LOCK_FILE and not name.endswith(UNFINISHED) for name in names):
        raise RunError(f"the folder {folder} is not empty; give a new one with --out")
    return None


def check_same(before: Run, now: Run, further: Mapping[str, Any] | None = None) -> None:
    """Checks that the run in the folder is the requested one.

    Args:
        before: The run in the folder.
        now: The requested run.
        further: Names of `Run.options` in which equal runs agree, with their defaults.

    Raises:
        RunError: They differ; names all differences.
    """
    before, now = _completed(before, now), _completed(now, now)
    others = [
        name for name in CONFIGURATION if getattr(before, name) != getattr(now, name)
    ]
    if before.task_sha256 != now.task_sha256:  # it says what differs, dynamics or not
        others = [name for name in others if name != "dynamics"]
    differences = [
        _difference(CONFIGURATION[name], getattr(before, name), getattr(now, name))
        for name in others
    ]
    for name, default in (further or {}).items():
        values = [run.options.get(name, default) for run in (before, now)]
        if values[0] != values[1]:
            differences.append(f"{name} {values[0]} instead of {values[1]}")
    if differences:
        way_out = "give a new folder with --out"
        if not NOT_TO_BE_RESUMED.intersection(others):
            command = resume_line(before, before.folder)
            way_out += f", or resume that run: {command}"
        raise RunError(
            f"{before.folder} contains another run ({'; '.join(differences)}): "
            f"{way_out}"
        )


def _completed(before: Run, now: Run) -> Run:
    """A run with what records of earlier versions, and of agents, do not say."""
    known = {"search": before.search or "paper", "ask": before.ask or now.ask}
    return before.model_copy(update=known)


def resume_words(run: Run, folder: Path | str) -> tuple[str, ...]:
    """The words of the command that continues a run in a folder."""
    command = ("mcp", "--out") if run.learner == AGENT else ("synth", "--resume")
    return "tdac", *command, str(folder)


def resume_line(run: Run, folder: Path | str) -> str:
    """The command line that continues a run in a folder."""
    return shlex.join(resume_words(run, folder))


def check_own(before: Run) -> None:
    """Refuses the verdict of a run that another installation began.

    Raises:
        RunError: Another installation began the run.
    """
    if is_own_folder(before):
        return
    if has_earlier_mark(before):
        raise RunError(remark_on(before))
    raise RunError(
        f"{remark_on(before)}, and it claims to be {before.status}: test it with "
        f"{shlex.join(['tdac', 'verify', str(before.folder)])}, or give a new "
        "folder with --out"
    )


def _difference(words: str, before: object, now: object) -> str:
    """A difference in words, with the values unless they are hashes."""
    if words == "seed":
        before, now = ("none" if value is None else value for value in (before, now))
    if isinstance(before, int) or words in {
        "learner",
        "optimizer",
        "task",
        "profile",
        "seed",
    }:
        return f"{words} {before} instead of {now}"
    return f"different {words}"


def resume_arguments(
    folder: Path, given: Mapping[str, Any] | None = None, *, trust: bool = False
) -> dict[str, Any]:
    """The arguments of `synthesize` that resume a run.

    Args:
        folder: Folder of the run.
        given: Arguments that replace recorded ones, also `suite`; they need no
            permission.
        trust: Whether another installation's run has all permissions that it needs.

    Raises:
        NotTrustedError: Another installation's run needs a permission.
        RunError: There is no readable run, or it had not begun.
        TaskError: The task or the task set cannot be read.
    """
    run, problem = load_run(folder), kept_problem(folder)
    if problem is None:
        raise RunError(
            f"the run in {folder} ended before its files were written: repeat its "
            f"command with --out {folder}"
        )
    flags = {name: value for name, value in (given or {}).items() if value is not None}
    if not is_own(run, problem.suite):
        permit(called(run), wishes_of(run, problem.suite, flags), trust=trust)
    problem = problem.permitted(flags.pop("suite", None))
    return {**settings_of(run), "problem": problem, **flags}


def settings_of(run: Run) -> dict[str, Any]:
    """The settings of a run: arguments of `synthesize`, but for what it is about.

    Raises:
        RunError: Its initial controller cannot be read, or a rule is not allowed.
    """
    folder = run.folder
    try:
        book = given_book(run.given_rules)
    except ValueError as error:
        raise RunError(f"the given rules of {folder}: {error}") from error
    initial, prompt = folder / GIVEN_FILE, folder / PROMPT_FILE
    return {
        **recorded_settings(run),
        "index": run.index,
        "start_from": _text(folder) if initial.is_file() else None,
        "rules": book,
        "prompt": run.prompt if is_shipped(run.prompt) else str(prompt),
        "out": folder,
    }


def recorded_settings(run: Run) -> dict[str, Any]:
    """Those settings of a run that its record has as they were given."""
    return {
        "learner": run.learner,
        "optimizer": None if run.optimizer == run.learner else run.optimizer,
        "iterations": run.iterations,
        "patience": run.patience,
        "candidates": run.candidates,
        "search": run.search or "paper",
        **({"ask": run.ask} if run.ask else {}),
        "confirm": run.confirm,
        "improve": run.improve,
        "envelope": run.envelope,
        **_of_episodes(run),
        "seed": run.seed,
        "base_url": run.base_url,
        "refine": run.refine,
        **({"omit": run.omit} if run.omit else {}),
        "max_output": run.max_output,
    }


def _of_episodes(run: Run) -> dict[str, Any]:
    """The settings that only a run on a task set records."""
    settings = {name: getattr(run, name) for name in ("episodes", "feedback_episodes")}
    return {name: value for name, value in settings.items() if value is not None}


def _text(folder: Path) -> str:
    """Reads the initial controller of a run.

    Raises:
        RunError: It cannot be read, or is not UTF-8.
    """
    try:
        return read_inside(folder, GIVEN_FILE, TEXT_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        file = folder / GIVEN_FILE
        raise RunError(f"cannot read {file}: {one_line_reason(error)}") from error
