"""The feasible task that a `task.yaml` stands for, and the files it comes with."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from tdac_agent.errors import RunError
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.environment import Environment
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.registry import environment, own_environments
from tdac_agent.tasks.setting import JudgedEnv, Nominal, Params, Setting
from tdac_agent.tasks.task_file import (
    TASK_FILE,
    TaskFile,
    bundled_task,
    bundled_tasks,
    read_task_file,
)
from tdac_envs.core.intake import printable

SENSORS_FILE = Path(__file__).parents[2] / "tdac_envs" / "controller_kit" / "sensors.py"
MIN_PROGRESS_STEPS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A task that was checked and found feasible.

    Attributes:
        name: For people.
        spec: The file's contents.
        setting: Environment, world, start and goal.
        suite: Folder with further test files, where there is one.
        trusted: Whether its tests may run: they are not in the sandbox.
        folder: Of its file, where it has one.
    """

    name: str
    spec: TaskFile
    setting: Setting
    suite: Path | None = None
    trusted: bool = True
    folder: Path | None = None

    @property
    def environment(self) -> Environment:
        """The registry's entry of the task's environment."""
        return environment(self.spec.env)

    @property
    def params(self) -> Params:
        """Contents of `params.json`, start, goal and robot filled in."""
        return self.setting.params

    @property
    def nominal(self) -> Nominal:
        """The feasible task: `Map2DTask` or `EPuckTask`."""
        return self.setting.nominal

    @property
    def progress_steps(self) -> int:
        """Steps within which the progress test wants its progress."""
        default = max(MIN_PROGRESS_STEPS, math.ceil(0.16 * self.nominal.horizon))
        return self.spec.progress.steps or default

    def env_kwargs(self) -> dict[str, Any]:
        """Arguments that make this task's environment; see its class."""
        return self.setting.env_kwargs()

    def make_env(self, **options: Any) -> JudgedEnv:
        """The environment of this task; options as for its class."""
        return self.setting.make_env(**options)

    def disturbed_env(
        self, disturbance: Disturbance, variation: str = "jitter"
    ) -> JudgedEnv:
        """The environment of this task, disturbed; `variation` as it has it."""
        options = {**disturbance.env_options(), "variation": variation}
        noise = self.setting.noise(options.pop("range_noise"))
        return self.make_env(**options, **noise)

    def sha256(self) -> str:
        """Hash of everything that decides an episode."""
        facts = {**self.setting.facts(), "progress": self.spec.progress.model_dump()}
        text = json.dumps(facts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def load_task(
    source: str | Path | TaskFile, *, base: Path | None = None, trust: bool = False
) -> Task:
    """Reads and checks a task.

    Args:
        source: Name of a bundled task, path of a `task.yaml`, folder that holds
            one, or its contents.
        base: Folder that relative paths in the contents refer to; the file's own
            by default.
        trust: Whether tests that a file brings may run, whoever wrote it; those of a
            run that was begun here may.

    Raises:
        TaskError: The file or the task cannot be used; the message says what to do.
        MapError: The map cannot be used.
        WorldError: The world cannot be used.
    """
    bundled = None if isinstance(source, TaskFile) else bundled_task(str(source))
    if isinstance(source, TaskFile):
        return _resolve(None, source, base or Path())
    if bundled is not None:
        return _resolve(str(source), bundled, Path())
    path = Path(source)
    path = path / TASK_FILE if path.is_dir() else path
    spec, base = read_task_file(path, source), base or path.parent
    name = path.parent.resolve().name if path.name == TASK_FILE else path.stem
    task = replace(_resolve(name, spec, base), folder=path.parent)
    if task.suite is None or trust:
        return task
    return replace(task, trusted=_is_of_own_run(path.parent, task.suite))


def _is_of_own_run(folder: Path, suite: Path) -> bool:
    """Whether a task is that of a run which was begun here, with these tests."""
    from tdac_agent.runs.ownership import is_own  # what it loads takes a while
    from tdac_agent.runs.records import load_run

    try:
        return is_own(load_run(folder), suite)
    except (RunError, OSError):
        return False


def _resolve(name: str | None, spec: TaskFile, base: Path) -> Task:
    own, setting = _open(spec, base)
    suite = None if spec.suite is None else base / spec.suite
    return Task(spec.name or printable(name or own), spec, setting, suite)


def _open(spec: TaskFile, base: Path) -> tuple[str, Setting]:
    """Name and setting of a task."""
    about = environment(spec.env)
    compile_first(about)
    return about.open(spec, base)


def called(task: Task) -> str:
    """A task in words: a bundled one by its name, others with what they are about.

    Anybody's map may have the name of a bundled one, and its goal may be anywhere.
    """
    name, setting = task.name, task.setting
    if name in bundled_tasks():
        known = _bundled(name)
        if known.sha256() == task.sha256():
            return name
        same = known.setting.world_sha256() == setting.world_sha256()
        name += ", changed" if same else ", not the bundled one"
    tolerance = setting.units.told(task.nominal.goal_tolerance)
    return f"{name} (map {setting.world_sha256()[:8]}, goal within {tolerance})"


@functools.cache
def _bundled(name: str) -> Task:
    return load_task(name)


def write_workdir(folder: Path, task: Task) -> None:
    """Fills the folder a controller works in.

    Writes `params.json` and `sensors.py`, and `occupancy.npy`, `occupancy.png` and
    `robot.png`, or `world.wbt`; the controller itself comes beside them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    task.setting.write_files(folder)
    (folder / "sensors.py").write_bytes(SENSORS_FILE.read_bytes())


def lay_out(task: Task, folder: Path) -> Path:
    """Writes a task for the judge, with all that a controller may read; its folder."""
    write_workdir(folder, task)
    (folder / TASK_FILE).write_text(portable_task_file(task), encoding="utf-8")
    return folder


def portable_task_file(task: Task, own_suite: str | None = None) -> str:
    """`task.yaml` for a run folder: the map or the world is the folder's own.

    Args:
        task: Any.
        own_suite: Name of the subfolder that holds the task's suite, if it has one.
    """
    nominal = task.nominal
    own_keys = (key for one in own_environments() for key in one.keys)
    excluded = {"suite", *own_keys, *task.environment.keys}
    spec = task.spec.model_dump(
        mode="json", exclude_none=True, exclude=excluded, by_alias=True
    )
    spec["name"] = task.name
    spec.update(task.setting.portable())
    if task.suite is not None and own_suite is not None:
        spec["suite"] = own_suite
    spec["start"] = [float(v) for v in nominal.start]
    spec["goal"] = [float(v) for v in nominal.goal]
    spec["tolerance"] = nominal.goal_tolerance
    spec["dt"] = nominal.dt
    spec["horizon"] = nominal.horizon
    return yaml.safe_dump(spec, sort_keys=False)
