"""What controllers are written for, and what a judge found about one of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from tdac_agent.prompting.prompt import FULL, PromptTemplate
from tdac_agent.prompting.rules import RepairRule
from tdac_agent.tasks.setting import Setting
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import Profile

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

Poll = Callable[[], None]
"""Called repeatedly while the judge works; an error that it raises ends the work."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What the judge found.

    Attributes:
        passed: Whether nothing is left to repair.
        scores: The scores, each in [0, 1], the main one first.
        feedback: How the controller failed, or that it did not.
        facts: Hashes, versions, and the whole report.
    """

    passed: bool
    scores: dict[str, float]
    feedback: str
    facts: dict[str, Any]


class Problem(Protocol):
    """What controllers are written for: `TaskProblem` or `SetProblem`."""

    @property
    def task(self) -> Task | None:
        """The task; None for a task set."""

    @property
    def tasks(self) -> TaskSet | None:
        """The task set; None for a single task."""

    @property
    def name(self) -> str:
        """Its display name."""

    @property
    def called(self) -> str:
        """Its name in texts, such as `the task set known`."""

    @property
    def scope(self) -> str:
        """What a rule with the scope `task` is about."""

    @property
    def sha256(self) -> str:
        """Hash of all values that determine an episode."""

    @property
    def dynamics(self) -> str:
        """The same with the code that drives."""

    @property
    def suite_sha256(self) -> str:
        """Hash of the suite of tests that verifies its controllers; empty without."""

    @property
    def suite(self) -> Path | None:
        """Folder of the user's own tests, if there are any."""

    @property
    def has_hidden(self) -> bool:
        """Whether it has hidden worlds, on which a controller is verified."""

    @property
    def profile(self) -> Profile:
        """Which functions a controller must define."""

    @property
    def contract(self) -> tuple[str, ...]:
        """Names that a controller must define at its top level."""

    @property
    def setting(self) -> Setting | TaskSet:
        """What providers of models may know of it."""

    @property
    def file(self) -> str:
        """Name of the file of a run folder that describes it."""

    @property
    def text(self) -> str:
        """Content of this file."""

    def check(self, improve: int = 0) -> None:
        """Checks that a controller can be written for it.

        Args:
            improve: Simulated episodes to improve what works.

        Raises:
            TaskError: It has too few worlds, or no disturbances for `improve`.
        """

    def permitted(self, suite: Path | None) -> Problem:
        """The same, where the user's own tests may run.

        Args:
            suite: Folder of other tests that replace them.
        """

    def allowed(self, suite: Path | None, *, trust: bool) -> Problem:
        """The same, with tests that the user gave or trusts.

        Args:
            suite: Folder of the flag `--suite`; replaces the tests that it brings.
            trust: Whether the user gave `--trust`.

        Raises:
            NotTrustedError: It brings tests that are not permitted.
        """

    def question(
        self, rules: tuple[RepairRule, ...] = (), template: PromptTemplate = FULL
    ) -> str:
        """The question for a new controller.

        Args:
            rules: The rules in force.
            template: Its template.

        Raises:
            PromptError: The template cannot be used.
        """

    def write_files(self, folder: Path) -> None:
        """Writes what a controller has in its working folder."""

    def write_originals(self, folder: Path) -> None:
        """Writes what else a run folder keeps, without `file`."""
