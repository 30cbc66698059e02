"""The policies of an evaluation, from the names and paths that the user gives."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.episodes.learned import check_kind
from tdac_agent.episodes.sb3_file import (
    MOST_BYTES,
    POLICY,
    SavedPolicy,
    load_weights,
    read_policy,
)
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.controller_file import check_controller
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.tasks.provenance import sha256_of
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE, read_task_file
from tdac_agent.verification.judge.drivers import Kind, PolicySpec
from tdac_agent.verification.verify import read_source
from tdac_envs.core.errors import TaskError, hint
from tdac_envs.core.intake import read_file
from tdac_envs.learning.wrappers import WRAPPERS, check_wrappers

OURS: tuple[Kind, ...] = ("reference", "random", "go-to-goal", "follow-guidance")
BUILTIN = "builtin"


@dataclass(frozen=True, slots=True)
class Entrant:
    """A policy as the user named it.

    Attributes:
        name: Name in tables and files.
        policy: The policy for the judge; for `builtin`, whose file is written for
            each task, a controller without a file.
        sha256: Hash of its file.
        env: Environment of its run folder, if it has one.
        set_file: Task set of its run folder, if it was written for one.
        saved: What a learned policy records about its training, if anything.
    """

    name: str
    policy: PolicySpec
    sha256: str | None = None
    env: str | None = None
    set_file: Path | None = None
    saved: SavedPolicy | None = None

    @property
    def is_builtin(self) -> bool:
        """Whether a controller is written for each task."""
        return self.policy.kind == "controller" and self.policy.file is None


def entrants_of(
    policies: Sequence[str | Path], wrappers: Sequence[str] | None = None
) -> tuple[Entrant, ...]:
    """The entrants for names and paths of policies.

    Args:
        policies: `reference`, `builtin`, `random`, `go-to-goal`, `follow-guidance`,
            controller files, folders of runs and trainings, policies saved by
            stable-baselines3.
        wrappers: Wrappers of saved policies that do not record their own.

    Raises:
        TaskError: No policy is given, one is given twice, or a wrapper is unknown.
        ControllerFileError: A file is missing or is not a policy.
    """
    for name in wrappers or ():
        if name not in WRAPPERS:
            known = ", ".join(WRAPPERS)
            raise TaskError(f"unknown wrapper {name!r}; expected some of {known}")
    found = tuple(_entrant(str(policy), wrappers) for policy in policies)
    if not found:
        raise TaskError("expected at least one policy to evaluate")
    names = [entrant.name for entrant in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise TaskError(f"the policy {twice[0]!r} is given twice")
    return found


def _entrant(given: str, wrappers: Sequence[str] | None) -> Entrant:
    if given in OURS:
        return Entrant(given, PolicySpec(given))
    if given == BUILTIN:
        return Entrant(given, PolicySpec("controller"))
    path = Path(given)
    if is_training(path):
        return _learned(given, path / POLICY, wrappers)
    if path.is_dir():
        found = _controller(given, path / "controller.py")
        return replace(found, env=_env_of(path), set_file=_set_of(path))
    if not path.is_file():
        raise ControllerFileError(not_found("policy", given, sorted((*OURS, BUILTIN))))
    if path.suffix == ".zip":
        return _learned(given, path, wrappers)
    if path.suffix != ".py":
        raise ControllerFileError(
            f"{given!r} is not a controller: expected a .py (or a run folder, or a "
            ".zip of stable-baselines3)"
        )
    return _controller(given, path)


def is_training(path: Path) -> bool:
    """Whether a folder has a trained policy, and no controller."""
    return (path / POLICY).is_file() and not (path / "controller.py").exists()


def not_found(what: str, given: str, names: Sequence[str]) -> str:
    """The message that there is no such file or program of ours.

    Args:
        what: What it should be.
        given: The word of the user.
        names: Our programs.
    """
    if any(mark in given for mark in "/."):
        return f"no {what} {given!r}: there is no such file or folder"
    return (
        f"no {what} {given!r}: expected a controller.py, the folder of a run or "
        f"training, a .zip of stable-baselines3, or one of {', '.join(names)}"
        f"{hint(given, names)}"
    )


def _controller(name: str, file: Path) -> Entrant:
    if not file.is_file():
        raise ControllerFileError(f"no controller.py in {name!r}")
    source = read_source(file)
    check_controller(name, source)
    return Entrant(name, PolicySpec("controller", file.resolve()), sha256_of(source))


def _env_of(run_folder: Path) -> str | None:
    file = run_folder / TASK_FILE
    try:
        return read_task_file(file, file).env
    except TaskError:
        return None


def _set_of(run_folder: Path) -> Path | None:
    file = run_folder / SET_FILE
    return file if file.is_file() else None


def _learned(name: str, file: Path, wrappers: Sequence[str] | None) -> Entrant:
    found = read_policy(file)
    saved = found.saved
    if saved is not None:
        names = saved.wrappers
    elif wrappers is not None:
        names = tuple(wrappers)
    else:
        known = ", ".join(WRAPPERS)
        raise ControllerFileError(
            f"{name!r} does not say which observations it was trained with: write them "
            f"to {file.with_suffix('.json').name} beside it, such as "
            '{"algo": "ppo", "wrappers": ["goal-relative", "flatten"]} '
            f"(wrappers: {known}; [] without any), or give tdac evaluate --wrapper NAME"
        )
    check_wrappers(names)
    check_kind(found)
    load_weights(found.weights)
    content = read_file(file, MOST_BYTES)
    if not found.complete:
        # The same network with other observations is another policy.
        content += json.dumps(names).encode()
    sha256 = sha256_of(content)
    return Entrant(name, PolicySpec("sb3", file.resolve(), names), sha256, saved=saved)


def write_builtin(task: Task, tier: str = "auto") -> tuple[bytes, bool]:
    """Writes a controller without a model; returns it and whether it is verified.

    If no candidate is verified, the controller is the last one.
    """
    with tempfile.TemporaryDirectory(prefix="tdac-evaluate-") as name:
        run = synthesize(task, BUILTIN, out=Path(name) / "run", tier=tier)
        if run.verified:
            return run.controller.read_bytes(), True
        candidates = sorted((run.folder / "iterations").rglob("controller.py"))
        return candidates[-1].read_bytes(), False
