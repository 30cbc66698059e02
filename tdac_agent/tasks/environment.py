"""What an environment brings for its tasks to be judged, drawn and explained."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tdac_agent.tasks.setting import JudgedEnv, Nominal, Setting
from tdac_agent.tasks.units import Units

if TYPE_CHECKING:
    from tdac_agent.builtin.template import Template
    from tdac_agent.episodes.pictures import Pictures
    from tdac_agent.tasks.task import Task
    from tdac_agent.tasks.task_file import TaskFile
    from tdac_agent.verification.diagnosis.surroundings import Surroundings
    from tdac_agent.verification.suite.oracle import Oracle

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Names:
    """What a controller of the profile `paper` must define at its top level.

    Attributes:
        constants: Assigned names.
        functions: Plain functions.
        classes: Classes.
    """

    constants: tuple[str, ...]
    functions: tuple[str, ...]
    classes: tuple[str, ...] = ()


class Environment(ABC):
    """An entry of the registry: everything that differs between environments.

    Further environments are found by the entry-point group `tdac.environments`: the
    name is the Gymnasium id, the object an instance of a subclass of this class.

    Attributes:
        id: Gymnasium id.
        folder: Folder with the verification tests in `suite/`, the prompt templates in
            `prompts/`, and the controllers `controller.py.j2` (of the provider
            `builtin`) and `privileged.py.j2` (which proves that a task can be passed).
        units: Units of places and lengths.
        keys: Keys of a task file that only this environment has; the first one names
            the map or world.
        names: What controllers of the profile `paper` must define.
        kernels: Package with the compiled functions.
    """

    id: ClassVar[str]
    folder: ClassVar[Path]
    units: ClassVar[Units]
    keys: ClassVar[tuple[str, ...]]
    names: ClassVar[Names]
    kernels: ClassVar[str]

    @property
    def suite(self) -> Path:
        """Folder of the verification tests."""
        return self.folder / "suite"

    @abstractmethod
    def bundled(self) -> dict[str, str]:
        """Name of each bundled task, with the map or world it is about."""

    @abstractmethod
    def open(self, spec: TaskFile, base: Path) -> tuple[str, Setting]:
        """Name of the map or world, and the feasible task.

        Args:
            spec: Contents of the task file.
            base: Folder that relative paths refer to.

        Raises:
            TdacError: The map, the world or the task cannot be used.
        """

    @abstractmethod
    def small_env(self) -> JudgedEnv:
        """An environment that is made quickly, for warm-ups."""

    @abstractmethod
    def use_kernels(self) -> None:
        """Calls every compiled function, so that all of them are compiled."""

    @abstractmethod
    def pictures(self, setting: Setting) -> Pictures:
        """Pictures of a task's episodes."""

    @abstractmethod
    def surroundings(self, task: Nominal) -> Surroundings:
        """The map or world as a diagnosis asks about it."""

    @abstractmethod
    def oracle(self) -> Oracle:
        """Exact answers for the verification tests."""

    @abstractmethod
    def reference_path(self, task: Nominal, x: float, y: float) -> list[Point]:
        """The oracle's path from (x, y) to the goal, after shortcuts; ends included."""

    @abstractmethod
    def privileged_facts(self, task: Nominal) -> dict[str, Any]:
        """Names and values for `privileged.py.j2` in the folder.

        `largest` is the largest coordinate, which limits the precision of float32.
        """

    @abstractmethod
    def prompt_facts(self, task: Task) -> dict[str, Any]:
        """Names and values for the prompt templates, beside those of all tasks."""

    @abstractmethod
    def template(self, setting: Setting) -> Template[Any]:
        """The parametrised controller of the provider `builtin`."""
