"""The policies of an evaluation, from the names and paths that the user gives."""

from __future__ import annotations

import inspect
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from tdac_agent.builtin.level import controller_of
from tdac_agent.episodes.learned import Learned, check_kind
from tdac_agent.episodes.sb3_file import (
    MOST_BYTES,
    POLICY,
    SavedPolicy,
    load_weights,
    read_policy,
)
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.controller_file import check_controller
from tdac_agent.planners.names import planner_names
from tdac_agent.planners.planner import planner_on
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.set_episodes import planner_sha256
from tdac_agent.sandbox import ControllerFault
from tdac_agent.sandbox.folder import WEIGHTS_BYTES
from tdac_agent.storage.hashes import sha256_of, sha256_of_file
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE, read_task_file
from tdac_agent.verification.judge.drivers import WaypointDriver
from tdac_agent.verification.judge.policy_spec import Kind, PolicySpec
from tdac_agent.verification.judge.set_files import write_set
from tdac_agent.verification.verify import read_source, weights_file
from tdac_agent.verification.verify_episodes import written_by
from tdac_envs.core.dynamics import code_of, code_sha256
from tdac_envs.core.errors import TaskError, hint, one_line_reason
from tdac_envs.core.intake import read_file
from tdac_envs.ladder.env import make
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.learning.wrappers import WRAPPERS, check_wrappers

OURS: tuple[Kind, ...] = ("reference", "random", "go-to-goal", "follow-guidance")
_ZIPPED = b"PK"
"""How a zip file begins."""
BUILTIN, PRIVILEGED = "builtin", "privileged"
FOLLOWER: Kind = "follow-waypoints"
EntrantKind = Literal[
    "builtin", "planner", "controller", "learned", "baseline", "privileged"
]
"""What an entrant is; further baselines of ours have none."""


@dataclass(frozen=True, slots=True)
class Entrant:
    """A policy as the user named it.

    Attributes:
        name: Name in tables and files.
        policy: The policy for the judge; that of a planner, and of `builtin`, has a
            file or a source only once it is fitted to a problem.
        sha256: Hash of its file; empty without one.
        kind: What it is; None for a baseline of ours.
        env: Environment of its run folder, if it has one.
        set_file: Task set of its run folder, if it was written for one.
        saved: What a learned policy records about its training, if anything.
        source: Source of a program, which drives even if its file changes.
        weights: Content of its weights, if it has any.
        tuned: Whether its constants were tuned for the problem; None if it has none.
    """

    name: str
    policy: PolicySpec
    sha256: str = ""
    kind: EntrantKind | None = None
    env: str | None = None
    set_file: Path | None = None
    saved: SavedPolicy | None = None
    source: bytes | None = None
    weights: bytes | None = None
    tuned: bool | None = None

    @property
    def lineage(self) -> str | None:
        """Id of the run that wrote it, if one did."""
        is_file = self.kind == "controller" and self.policy.file is not None
        return written_by(self.policy.file) if is_file and self.policy.file else None


def entrants_of(
    policies: Sequence[str | Path], wrappers: Sequence[str] | None = None
) -> tuple[Entrant, ...]:
    """The entrants for names and paths of policies.

    Args:
        policies: `reference`, `builtin`, `random`, `go-to-goal`, `follow-guidance`,
            `follow-waypoints`, names of planners, controller files, folders of runs
            and trainings, policies saved by stable-baselines3.
        wrappers: Wrappers of saved policies that do not record their own.

    Raises:
        TaskError: No policy is given, one is given twice, or a wrapper is unknown.
        ControllerFileError: A file is missing or is not a policy.
    """
    for name in wrappers or ():
        if name not in WRAPPERS:
            known = ", ".join(WRAPPERS)
            raise TaskError(f"unknown wrapper {name!r}; expected some of {known}")
    found = tuple(entrant_of(str(policy), wrappers) for policy in policies)
    if not found:
        raise TaskError("expected at least one policy to evaluate")
    names = [entrant.name for entrant in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise TaskError(f"the policy {twice[0]!r} is given twice")
    return found


def entrant_of(
    word: str, wrappers: Sequence[str] | None = None, ours: Sequence[str] = OURS
) -> Entrant:
    """The entrant of a word.

    Args:
        word: See `entrants_of`.
        wrappers: See there.
        ours: Names of baselines, which come before planners of the same name.

    Raises:
        ControllerFileError: A file is missing or is not a policy.
    """
    if word in ours:
        return Entrant(word, PolicySpec(word))  # type: ignore[arg-type]
    if word == BUILTIN:
        return Entrant(word, PolicySpec("controller"), kind="builtin")
    if word in planner_names():
        return Entrant(word, PolicySpec("controller"), kind="planner")
    if word == FOLLOWER:
        return Entrant(word, PolicySpec(FOLLOWER), _follower_sha256(), "baseline")
    if word == PRIVILEGED:
        spec = PolicySpec("privileged")
        return Entrant(word, spec, planner_sha256(), "privileged")
    return _of_path(word, wrappers)


def _follower_sha256() -> str:
    """The hash of the code that follows waypoints."""
    files = "seen_map", "seen_kernels", "seen_ways", "body_frame"
    own = [f"learning/{name}.py" for name in files]
    driver = inspect.getsource(WaypointDriver)
    return sha256_of(code_sha256(*own) + code_of(driver))


def _of_path(word: str, wrappers: Sequence[str] | None) -> Entrant:
    path = Path(word)
    if is_training(path):
        return _learned(word, path / POLICY, wrappers)
    if path.is_dir():
        found = _controller(word, path / "controller.py")
        return replace(found, env=_env_of(path), set_file=_set_of(path))
    if not path.is_file():
        names = sorted((*OURS, BUILTIN, FOLLOWER, *planner_names()))
        raise ControllerFileError(not_found("policy", word, names))
    if path.suffix == ".zip":
        return _learned(word, path, wrappers)
    if path.suffix != ".py":
        raise ControllerFileError(
            f"{word!r} is not a controller: expected a .py (or a run folder, or a "
            ".zip of stable-baselines3)"
        )
    return _controller(word, path)


def is_training(path: Path) -> bool:
    """Whether a folder has a trained policy, and no controller."""
    return (path / POLICY).is_file() and not (path / "controller.py").exists()


def not_found(what: str, word: str, names: Sequence[str]) -> str:
    """The message that there is no such file or program of ours.

    Args:
        what: What it should be.
        word: The word of the user.
        names: Our programs.
    """
    if any(mark in word for mark in "/."):
        return f"no {what} {word!r}: there is no such file or folder"
    return (
        f"no {what} {word!r}: expected a controller.py, the folder of a run or "
        f"training, a .zip of stable-baselines3, or one of {', '.join(names)}"
        f"{hint(word, names)}"
    )


def _controller(name: str, file: Path) -> Entrant:
    if not file.is_file():
        raise ControllerFileError(f"no controller.py in {name!r}")
    source = read_source(file)
    check_controller(name, source)
    policy = PolicySpec("controller", file.resolve())
    beside = weights_file(file)
    if beside is None:
        return Entrant(name, policy, sha256_of(source), "controller", source=source)
    numbers = _weights(name, beside)
    both = sha256_of(f"{sha256_of(source)} {sha256_of(numbers)}")
    return Entrant(name, policy, both, "learned", source=source, weights=numbers)


def _weights(name: str, file: Path) -> bytes:
    """Content of the weights of a learned controller.

    Raises:
        ControllerFileError: They cannot be read, or are no file of numpy.
    """
    try:
        if file.is_symlink():
            # A file that the controller must not read, perhaps.
            raise ValueError("it is a link: copy the file")
        content = read_file(file, WEIGHTS_BYTES)
        if not content.startswith(_ZIPPED):
            raise ValueError("expected a file of numpy.savez")
    except (OSError, ValueError) as error:
        reason = one_line_reason(error)
        raise ControllerFileError(f"{name!r}: weights {file}: {reason}") from error
    return content


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
        if saved is not None and (saved.after or saved.actions != "likely"):
            content += saved.model_dump_json(include={"after", "actions"}).encode()
    policy = PolicySpec("sb3", file.resolve(), names)
    return Entrant(name, policy, sha256_of(content), "learned", saved=saved)


def fitted(entrant: Entrant, problem: Task | TaskSet) -> Entrant:
    """An entrant as it drives on a problem; on a set, `builtin` gets its file.

    Raises:
        TaskError: It does not drive there, or was written for something else.
        ControllerFileError: It was trained elsewhere.
    """
    if entrant.kind == "planner":
        planner = planner_on(entrant.name, problem)
        source, spec = planner.source.encode(), PolicySpec("controller", on_level=True)
        return replace(
            entrant,
            policy=spec,
            sha256=sha256_of(source),
            source=source,
            tuned=planner.tuned,
        )
    episodes_of(problem).check(entrant.policy)
    if isinstance(problem, TaskSet):
        return _fitted_to_set(entrant, problem)
    if entrant.set_file is not None:
        raise TaskError(
            f"{entrant.name} was written for a task set, not for tasks: evaluate it "
            f"with --set {entrant.set_file}"
        )
    if entrant.saved is not None and entrant.saved.set is not None:
        raise TaskError(
            f"{entrant.name} was trained on the task set {entrant.saved.set!r}, not on "
            "tasks: evaluate it with --set"
        )
    if entrant.env not in (None, problem.spec.env):
        raise TaskError(
            f"{entrant.name} was written for {entrant.env}; the task "
            f"{problem.name!r} is of {problem.spec.env}"
        )
    return entrant


def _fitted_to_set(entrant: Entrant, tasks: TaskSet) -> Entrant:
    if entrant.kind == "builtin":
        file = controller_of(tasks, "leave out builtin")
        policy = replace(entrant.policy, file=file)
        return replace(entrant, policy=policy, sha256=sha256_of_file(file))
    if entrant.saved is not None:
        _check_training(entrant.name, entrant.saved, tasks)
    if entrant.policy.kind == "sb3":
        _check_observations(entrant, tasks)
    return entrant


MAPPED = {"map-view", "seen-map", "waypoints"}
"""Wrappers that show the given map, where there is one."""


def knowledge(policy: PolicySpec, problem: Task | TaskSet) -> str:
    """What a policy may use: `sensors` include the goal, and the pose if observed."""
    if isinstance(problem, Task) or policy.kind not in ("controller", "sb3", FOLLOWER):
        return policy.knows
    reads_map = policy.kind != "sb3" or MAPPED & set(policy.wrappers)
    if problem.file.map and reads_map:
        return "+ map"
    return "sensors" if policy.kind == "controller" else policy.knows


def _check_observations(entrant: Entrant, tasks: TaskSet) -> None:
    """Refuses a policy that does not fit what a set observes.

    Raises:
        ControllerFileError: It does not.
    """
    assert entrant.policy.file is not None
    split = next(each for each in ("dev", "test", "train") if tasks.count(each) != 0)
    with tempfile.TemporaryDirectory(prefix="tdac-set-") as name:
        env = make(write_set(tasks, Path(name) / "set.yaml"), split=split)
    try:
        Learned(entrant.policy.file, entrant.policy.wrappers, env)
    except ControllerFault as fault:
        raise ControllerFileError(f"{entrant.name}: {fault}") from fault


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


def prepared(
    entrant: Entrant, problem: Task | TaskSet, tier: str = "auto"
) -> tuple[Entrant, bool]:
    """A fitted entrant, ready to drive: on a task, `builtin` is written here.

    Returns:
        The entrant, and whether it passed its tests, if it was written. If no candidate
        did, it is the last one.
    """
    if entrant.kind != "builtin" or isinstance(problem, TaskSet):
        return entrant, True
    source, passed = _written_for(problem, tier)
    return replace(entrant, source=source, sha256=sha256_of(source)), passed


def _written_for(task: Task, tier: str) -> tuple[bytes, bool]:
    with tempfile.TemporaryDirectory(prefix="tdac-evaluate-") as name:
        run = synthesize(
            task, BUILTIN, out=Path(name) / "run", tier=tier, confirm=False
        )
        if run.passed:
            return run.controller.read_bytes(), True  # raw read: our temporary folder
        candidates = sorted((run.folder / "iterations").rglob("controller.py"))
        return candidates[-1].read_bytes(), False  # raw read: our temporary folder
