"""Base class of registered environments: how their tasks are judged and drawn."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tdac_agent.tasks.first_run import CodePart
from tdac_agent.tasks.setting import JudgedEnv, Nominal, Setting
from tdac_agent.tasks.units import Point, Units

if TYPE_CHECKING:
    from tdac_agent.builtin.template import Template
    from tdac_agent.tasks.parts import Pictures, Surroundings
    from tdac_agent.tasks.task import Task
    from tdac_agent.tasks.task_file import TaskFile
    from tdac_agent.verification.suite.oracle import Oracle


@dataclass(frozen=True, slots=True)
class Names:
    """Names that a controller of the profile `paper` must define at its top level."""

    constants: tuple[str, ...]
    functions: tuple[str, ...]
    classes: tuple[str, ...] = ()


class Environment(ABC):
    """A registry entry: everything that differs between environments.

    Other packages register environments with the entry-point group
    `tdac.environments`: the entry's name is the Gymnasium id, its object an instance
    of a subclass of this class.

    Attributes:
        id: Gymnasium id.
        folder: Folder with the verification tests in `suite/`, the prompt templates in
            `prompts/`, and the controllers `controller.py.j2` (of the provider
            `builtin`) and `privileged.py.j2` (which proves that a task can be passed).
        units: Units of places and lengths.
        keys: Task file keys that only this environment has; the first one names the
            map or world.
        robot_keys: Those below the key `robot` that it has; None for all.
        names: Names that controllers of the profile `paper` must define.
        kernels: Package with the compiled functions.
        code: Folders and files of `tdac_envs` that decide what happens in an episode;
            by default all.
    """

    id: ClassVar[str]
    folder: ClassVar[Path]
    units: ClassVar[Units]
    keys: ClassVar[tuple[str, ...]]
    robot_keys: ClassVar[frozenset[str] | None] = None
    names: ClassVar[Names]
    kernels: ClassVar[str]
    code: ClassVar[tuple[str, ...]] = (".",)

    @property
    def suite(self) -> Path:
        """Folder of the verification tests."""
        return self.folder / "suite"

    def has_key(self, key: str) -> bool:
        """Returns whether it has a key of task files, such as `robot.radius`."""
        part, _, inner = key.partition(".")
        if part not in self.keys:
            return False
        return not inner or self.robot_keys is None or inner in self.robot_keys

    @abstractmethod
    def bundled(self) -> dict[str, str]:
        """Returns the map or world of each bundled task, by the task's name."""

    @abstractmethod
    def open(self, spec: TaskFile, base: Path) -> tuple[str, Setting]:
        """Returns the name of the map or world, and the feasible task.

        Args:
            spec: Contents of the task file.
            base: Folder that relative paths refer to.

        Raises:
            TdacError: The map, the world or the task cannot be used.
        """

    @abstractmethod
    def small_env(self) -> JudgedEnv:
        """Returns an environment for warm-ups that is quick to construct."""

    def code_parts(
        self,
        *,
        movers: bool,  # noqa: ARG002 - for subclasses
        worlds: bool = False,  # noqa: ARG002
    ) -> list[CodePart]:
        """Returns the parts of the compiled code that tasks need; by default, all.

        Args:
            movers: Whether there are moving obstacles.
            worlds: Whether the tasks are those of a task set, whose worlds are made.
        """
        return [CodePart(self.use_kernels, self.kernels, "kernels.drive", 30.0)]

    @abstractmethod
    def use_kernels(self) -> None:
        """Calls every kernel, so that all of them get compiled."""

    @abstractmethod
    def pictures(self, setting: Setting) -> Pictures:
        """Returns an object that draws a task's episodes."""

    @abstractmethod
    def surroundings(self, task: Nominal) -> Surroundings:
        """Returns the map or world, with the queries that a diagnosis needs."""

    @abstractmethod
    def oracle(self) -> Oracle:
        """Returns the exact answers that the verification tests compare with."""

    @abstractmethod
    def reference_path(self, task: Nominal, x: float, y: float) -> list[Point]:
        """Returns the corners of the oracle's path, including (x, y) and the goal."""

    @abstractmethod
    def privileged_facts(self, task: Nominal) -> dict[str, Any]:
        """Returns the variables of the template `privileged.py.j2`.

        `largest` is the largest coordinate, which limits the precision of float32.
        """

    @abstractmethod
    def prompt_facts(self, task: Task) -> dict[str, Any]:
        """Returns the environment's own variables for the prompt templates."""

    @abstractmethod
    def template(self, setting: Setting) -> Template[Any]:
        """Returns the parametrised controller of the provider `builtin`."""
