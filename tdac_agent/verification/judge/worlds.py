"""Where the episodes of a job take place: a task's world, or worlds of a task set."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.episodes.episode import Driver, Record
from tdac_agent.sandbox import Child
from tdac_agent.tasks.deviation import Deviation
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_agent.tasks.units import Units
from tdac_envs.drive.env import Observation
from tdac_envs.physics.moved import EXACT

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

FOREVER = 1 << 62
PUBLIC = ("dev", "test", "train")


class Program(NamedTuple):
    """A controller.

    Attributes:
        source: Bytes of its file; empty without one.
        weights: Bytes of its weights, if it was learned.
    """

    source: bytes
    weights: bytes | None = None


class Worlds(Protocol):
    """Makes episodes by number: a seed of a task, or the index of a world."""

    @property
    def units(self) -> Units:
        """Units of the environment."""

    def record(self, number: int, most: int = FOREVER) -> Record:
        """An empty record for an episode of at most `most` steps."""

    def name(self, number: int) -> str:
        """Name of an episode in texts."""

    def supply(self, child: Child, number: int, program: Program) -> None:
        """Gives a child the controller and the files that it may read.

        Raises:
            ControllerFault: The controller is too large.
        """

    def seen(self, observation: Observation) -> Observation:
        """An observation as a controller gets it."""

    def load(self, child: Child) -> Driver:
        """Imports the controller in a child.

        Raises:
            ControllerFault: It cannot be imported.
        """

    def facts(self, env: JudgedEnv, number: int) -> dict[str, Any]:
        """What a row says of an episode before it is driven; see `driven_row`."""

    def diagnosed(self, env: JudgedEnv) -> tuple[Nominal, Units | None]:
        """The task of the last episode, and the units of its diagnosis."""


class TaskWorld(BaseModel):
    """The world of a task, whose folder has been laid out.

    Attributes:
        task: Its folder.
        disturbance: Disturbance of the environment.
        variation: Variation of start and goal.
        on_level: Whether controllers read the files of a task set.
        physics: What moves the robot.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["task"] = "task"
    task: Path
    disturbance: Disturbance
    variation: str = "jitter"
    on_level: bool = False
    physics: str = EXACT


class SetWorlds(BaseModel):
    """Worlds of a split of a task set.

    Attributes:
        set_file: Its set file.
        split: The split.
        salt_file: File with the salt of hidden worlds.
        hidden_folder: Folder of hidden worlds that are files.
        physics: What moves the robot.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["set"] = "set"
    set_file: Path
    split: str
    salt_file: Path | None = None
    hidden_folder: Path | None = None
    physics: str = EXACT


class Case(BaseModel):
    """An episode in which something differs from what the controller is told.

    Attributes:
        number: The episode: a seed of a task, or the number of a world.
        deviation: What differs.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    deviation: Deviation


class DeviatedWorlds(BaseModel):
    """Cases of a problem, in the order of their numbers in the job.

    Attributes:
        within: The world, or the worlds, without deviations.
        cases: The cases; the numbers of the job are their positions here.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["deviated"] = "deviated"
    within: TaskWorld | SetWorlds = Field(discriminator="kind")
    cases: tuple[Case, ...]


def public_split(tasks: TaskSet) -> str | None:
    """A split whose worlds may be told of; None if a set has none."""
    return next((name for name in PUBLIC if tasks.count(name) != 0), None)
