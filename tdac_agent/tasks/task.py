"""Feasible tasks: loading, hashing and writing them for the judge."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from tdac_agent.storage.hashes import sha256_of_json
from tdac_agent.tasks.disturbance import LENGTHS, OF_ALL, PARTS, Disturbance
from tdac_agent.tasks.environment import Environment
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.parts import Pictures
from tdac_agent.tasks.registry import environment, own_environments
from tdac_agent.tasks.setting import JudgedEnv, Nominal, Params, Setting, tolerance_text
from tdac_agent.tasks.task_file import (
    TASK_FILE,
    Profile,
    TaskFile,
    bundled_task,
    bundled_tasks,
    check_frame,
    read_task_file,
)
from tdac_agent.tasks.units import Units
from tdac_envs.core.dynamics import code_sha256
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import printable
from tdac_envs.drive.env import Observation
from tdac_envs.drive.task import Pose
from tdac_envs.physics.moved import EXACT

SENSORS_FILE = Path(__file__).parents[2] / "tdac_envs" / "controller_kit" / "sensors.py"
MIN_PROGRESS_STEPS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A task that has been checked and is feasible.

    Attributes:
        name: Display name.
        spec: Contents of the task file.
        setting: Map or world, start, goal and robot.
        suite: Folder with additional test files, or None.
        trusted: Whether these tests may run; they run outside the sandbox.
        folder: Folder of the task file, or None.
    """

    name: str
    spec: TaskFile
    setting: Setting
    suite: Path | None = None
    trusted: bool = True
    folder: Path | None = None

    @property
    def environment(self) -> Environment:
        """Registry entry of the task's environment."""
        return environment(self.spec.env)

    @property
    def params(self) -> Params:
        """Contents of `params.json`, with start, goal and robot."""
        return self.setting.params

    @property
    def nominal(self) -> Nominal:
        """The feasible task: `Map2DTask` or `EPuckTask`."""
        return self.setting.nominal

    @property
    def progress_fraction(self) -> float:
        """Share of the distance that may be left in the progress test."""
        return self.spec.progress.fraction

    @property
    def progress_steps(self) -> int:
        """Step limit of the progress test."""
        return self.spec.progress.steps or progress_steps(self.nominal.horizon)

    @property
    def told_units(self) -> Units | None:
        """Units of diagnoses for models; None for those of the environment."""
        return None

    def with_profile(self, profile: Profile | None) -> Task:
        """Returns the task with another profile; None keeps its own.

        Raises:
            TaskError: Controllers in metres cannot have it.
        """
        if profile is None:
            return self
        check_frame(self.spec.frame, profile)
        spec = self.spec.model_copy(update={"profile": profile})
        return replace(self, spec=spec)

    def without_movers(self) -> Task:
        """Returns the same task without moving obstacles."""
        if not self.spec.movers:
            return self
        spec = self.spec.model_copy(update={"movers": ()})
        return replace(self, spec=spec, setting=self.setting.without_movers())

    def env_kwargs(self) -> dict[str, Any]:
        """Returns the constructor arguments of this task's environment."""
        return self.setting.env_kwargs()

    def make_env(self, **options: Any) -> JudgedEnv:
        """Constructs this task's environment; `options` override its arguments."""
        return self.setting.make_env(**options)

    def pictures(self) -> Pictures:
        """Returns an object that draws this task's episodes."""
        return self.environment.pictures(self.setting)

    def seen(self, observation: Observation) -> Observation:
        """An observation as a controller gets it."""
        return self.setting.seen(observation)

    def start_check(self) -> Callable[[Pose], bool]:
        """Returns a function: whether an episode may begin at a feasible start.

        It may not if a mover with a given start would soon touch the robot there.
        """
        if not self.spec.movers:
            return lambda _: True
        env = self.make_env()

        def allows(start: Pose) -> bool:
            try:
                env.reset(seed=0, options={"start": start})
            except TaskError:
                return False
            return True

        return allows

    def disturbed_env(
        self,
        disturbance: Disturbance,
        variation: str = "jitter",
        physics: str = EXACT,
    ) -> JudgedEnv:
        """Constructs this task's environment with a disturbance."""
        options = self.disturbed_options(disturbance) | {"variation": variation}
        if physics != EXACT:  # environments of others may have no other one
            options["physics"] = physics
        return self.make_env(**options)

    def disturbed_options(self, disturbance: Disturbance) -> dict[str, Any]:
        """Returns the arguments of this task's environment for a disturbance.

        Raises:
            TaskError: The environment does not have one of its parts.
        """
        options = disturbance.env_options()
        if "range_dropout" in options and not self.setting.has_dropouts:
            raise TaskError(
                f"the sensors of {self.spec.env} have no dropouts; leave out "
                "--range-dropout"
            )
        if not self.setting.has_dropouts:
            _refuse_reception(options, self.spec.env)
        for name in LENGTHS:
            if name in options:
                options[name] = self.setting.length_of(options[name])
        return options | self.setting.noise(options.pop("range_noise"))

    @property
    def says_disturbances(self) -> bool:
        """Whether the robot's file or the task file says what disturbs the robot."""
        return bool(self.setting.disturbances or self.spec.disturbances)

    def own_disturbance(self, **sizes: Any) -> Disturbance:
        """Returns what disturbs this task's robot when it is confirmed.

        It is what the robot's file says, or else the default, then the task file's
        `disturbances`, then the given sizes.

        Raises:
            TaskError: A size is out of range.
        """
        robot = self.setting.disturbances
        usual = Disturbance.none().changed(robot) if robot else Disturbance()
        return usual.changed(self.spec.disturbances).changed(sizes)

    def sha256(self) -> str:
        """Hash of all values that determine an episode and the progress test."""
        facts = {**self.setting.facts(), "progress": self.spec.progress.model_dump()}
        if self.says_disturbances:
            facts["disturbances"] = asdict(self.own_disturbance())
        return sha256_of_json(facts)

    def dynamics(self) -> str:
        """Hash of all that decides what happens in an episode, code included."""
        facts = {"task": self.sha256(), "code": code_sha256(*self.environment.code)}
        return sha256_of_json(facts)


def progress_steps(horizon: int) -> int:
    """Default step limit of the progress test, for episodes of `horizon` steps."""
    return max(MIN_PROGRESS_STEPS, math.ceil(0.16 * horizon))


def _refuse_reception(options: dict[str, Any], env: str) -> None:
    """Refuses parts of a disturbance that only robots on maps have."""
    for name, part in PARTS.items():
        if name in options and not part.everywhere and name not in OF_ALL:
            flag = name.replace("_", "-")
            raise TaskError(f"{env} has no {part.words}; leave out --{flag}")


def read_task(
    source: str | Path | TaskFile, *, base: Path | None = None, trust: bool = False
) -> Task:
    """As `load_task` of `tdac_agent.runs.ownership`, but runs are trusted like others.

    The judge uses it, which gets the tests that may run with each job.
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
    task = _resolve(name, spec, base)
    return replace(task, folder=path.parent, trusted=task.suite is None or trust)


def _resolve(name: str | None, spec: TaskFile, base: Path) -> Task:
    own, setting = _open(spec, base)
    suite = None if spec.suite is None else base / spec.suite
    return Task(spec.name or printable(name or own), spec, setting, suite)


def _open(spec: TaskFile, base: Path) -> tuple[str, Setting]:
    entry = environment(spec.env)
    compile_first(entry.code_parts(movers=bool(spec.movers)))
    return entry.open(spec, base)


def display_name(task: Task) -> str:
    """Describes a task: a bundled one by its name, others also by map hash and goal.

    A name alone does not identify a task: any map may have a bundled map's name. The
    task of a bundled world may be named after the world (`maze` for `epuck-maze`).
    """
    name, setting = task.name, task.setting
    places = task.environment.bundled().items()
    alias = next((known for known, place in places if name in (known, place)), None)
    known = None if alias is None else _bundled(alias)
    if alias and known and known.setting.world_sha256() == setting.world_sha256():
        if known.sha256() == task.sha256():
            return alias
        name = f"{alias}, changed"
    elif name in bundled_tasks():
        name += ", not the bundled one"
    near = tolerance_text(setting)
    return f"{name} (map {setting.world_sha256()[:8]}, goal within {near})"


@functools.cache
def _bundled(name: str) -> Task:
    return read_task(name)


def write_workdir(folder: Path, task: Task) -> None:
    """Fills a controller's working folder with everything but the controller.

    Writes `params.json` and `sensors.py`, and either `occupancy.npy`, `occupancy.png`
    and `robot.png`, or `world.wbt`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    task.setting.write_files(folder)
    (folder / "sensors.py").write_bytes(SENSORS_FILE.read_bytes())  # raw read: shipped


def lay_out(task: Task, folder: Path) -> Path:
    """Writes `task.yaml` and the files a controller may read; returns the folder."""
    write_workdir(folder, task)
    (folder / TASK_FILE).write_text(portable_task_file(task), encoding="utf-8")
    return folder


def portable_task_file(task: Task, own_suite: str | None = None) -> str:
    """Returns a `task.yaml` for a run folder, with the map or world in that folder.

    Args:
        task: The task.
        own_suite: Name of the subfolder with the task's suite, if it has one.
    """
    nominal = task.nominal
    own_keys = (key for one in own_environments() for key in one.keys)
    excluded = {"suite", *own_keys, *task.environment.keys}
    spec = task.spec.model_dump(
        mode="json", exclude_none=True, exclude=excluded, by_alias=True
    )
    spec.pop("disturbances", None)
    if task.says_disturbances:
        spec["disturbances"] = asdict(task.own_disturbance())
    spec["name"] = task.name
    spec.update(task.setting.portable())
    if task.suite is not None and own_suite is not None:
        spec["suite"] = own_suite
    spec.update(task.setting.ends())
    spec["dt"] = nominal.dt
    spec["horizon"] = nominal.horizon
    return yaml.safe_dump(spec, sort_keys=False)
