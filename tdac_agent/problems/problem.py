"""The question of a task or a level, and how answers are judged.

Other frameworks ask and record; nothing here depends on one of them.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

from tdac_agent.builtin.level import controller_of
from tdac_agent.errors import RunError
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.prompting.prompt import FULL, generate_prompt
from tdac_agent.prompting.set_prompt import check_generated, set_prompt
from tdac_agent.runs.ownership import load_task
from tdac_agent.set_synthesis.feedback import set_feedback, summary_of
from tdac_agent.set_synthesis.trials import BLOCKS
from tdac_agent.synthesis.loop import synthesize
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.sequential import MOST_EPISODES
from tdac_agent.verification.judge.set_files import level_params
from tdac_agent.verification.verify import verify
from tdac_agent.verification.verify_episodes import JUDGED, verify_episodes
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import TaskSet, load_set

FEEDBACK_WORLDS = 8
"""Worlds of `dev` that a controller for a level drives on between two answers."""

Poll = Callable[[], None]
"""Called repeatedly while the judge works; an error that it raises ends the work."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What the judge found.

    Attributes:
        passed: Whether nothing is left to repair.
        scores: The scores, each in [0, 1].
        feedback: How the controller failed, or that it did not.
        facts: Hashes, versions, and the whole report.
    """

    passed: bool
    scores: dict[str, float]
    feedback: str
    facts: dict[str, Any]


class Problem(Protocol):
    """A question, and the judge of its answers.

    Attributes:
        scores: Names of the scores, the main one first.
    """

    scores: ClassVar[tuple[str, ...]]

    def question(self) -> str:
        """The first question to a model."""

    def files(self) -> dict[str, bytes]:
        """Files of a controller's working folder, by name."""

    def reference(self) -> str:
        """The source of tdac's own controller, which knows what a model knows."""

    def judge(self, source: bytes, poll: Poll) -> Judged:
        """The verdict, or the scores."""

    def rehearse(self, source: bytes, turn: int, poll: Poll) -> Judged:
        """The feedback between two answers.

        Args:
            source: The controller.
            turn: Number of the answer, from 0.
            poll: Called repeatedly.
        """


@dataclass(frozen=True)
class TaskProblem:
    """A single task."""

    scores: ClassVar[tuple[str, ...]] = ("verified",)
    task: Task

    def question(self) -> str:
        """See `Problem`."""
        return generate_prompt(self.task, ())

    def files(self) -> dict[str, bytes]:
        """See `Problem`."""
        with tempfile.TemporaryDirectory(prefix="tdac-files-") as name:
            folder = Path(name)
            write_workdir(folder, self.task)
            # raw read: our temporary folder
            return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}

    def reference(self) -> str:
        """See `Problem`. It is tuned until it is verified.

        Raises:
            RunError: Tuning did not help.
        """
        with tempfile.TemporaryDirectory(prefix="tdac-builtin-") as name:
            run = synthesize(self.task, out=Path(name) / "run")
            if not run.verified:
                raise RunError(
                    f"the learner `builtin` has no verified controller for the task "
                    f"{self.task.name}"
                )
            # raw read: our temporary folder
            return run.controller.read_text(encoding="utf-8")

    def judge(self, source: bytes, poll: Poll) -> Judged:
        """See `Problem`."""
        report = verify(source, self.task, meanwhile=poll)
        about = report.provenance
        return Judged(
            passed=report.passed,
            scores={"verified": float(report.passed)},
            feedback=(
                f"all {report.verdict.expected} tests passed"
                if report.passed
                else render_feedback(report)
            ),
            facts={
                "task_sha256": about.task_sha256,
                "suite_sha256": about.suite_sha256,
                "controller_sha256": about.controller_sha256,
                "sandbox": about.sandbox,
                "versions": about.versions,
                "report": report.model_dump(mode="json"),
            },
        )

    def rehearse(self, source: bytes, turn: int, poll: Poll) -> Judged:
        """See `Problem`. The verdict: it tells only pass or fail of held-out starts."""
        del turn
        return self.judge(source, poll)


@dataclass(frozen=True)
class LevelProblem:
    """A level of the ladder.

    Attributes:
        tasks: Its task set.
        worlds: Number of worlds.
        split: The split that they are from.
        salt_file: File with the salt of the split `hidden`.
    """

    scores: ClassVar[tuple[str, ...]] = ("success", "time")
    tasks: TaskSet
    worlds: int = 20
    split: str = "test"
    salt_file: Path | None = None

    def __post_init__(self) -> None:
        """Checks all values before a model is asked."""
        one_of("split", self.split, JUDGED)
        whole_number("worlds", self.worlds, 1, MOST_EPISODES)
        salt = None if self.salt_file is None else read_salt(self.salt_file)
        self.tasks.key(self.split, 0, "world", salt)

    def question(self) -> str:
        """See `Problem`."""
        check_generated(self.tasks)
        return set_prompt(self.tasks, (), FULL)

    def files(self) -> dict[str, bytes]:
        """See `Problem`. What differs between worlds is left out."""
        params = json.dumps(level_params(self.tasks.file), indent=2) + "\n"
        return {"params.json": params.encode()}

    def reference(self) -> str:
        """See `Problem`."""
        # raw read: shipped
        return controller_of(self.tasks, "ask a model").read_text(encoding="utf-8")

    def judge(self, source: bytes, poll: Poll) -> Judged:
        """See `Problem`."""
        report = verify_episodes(
            source,
            self.tasks,
            self.worlds,
            split=self.split,
            salt_file=self.salt_file,
            watch=lambda _done, _reached: poll(),
        )
        return _driven(report)

    def rehearse(self, source: bytes, turn: int, poll: Poll) -> Judged:
        """See `Problem`. Drives on other worlds in each turn, never on those judged."""
        report = verify_episodes(
            source,
            self.tasks,
            FEEDBACK_WORLDS,
            split="dev",
            first=BLOCKS + turn * FEEDBACK_WORLDS,  # not the judged ones of `dev`
            watch=lambda _done, _reached: poll(),
        )
        return _driven(report)


def problem_of(about: Mapping[str, Any]) -> Problem:
    """The problem of a sample.

    Args:
        about: The sample's metadata: `task`, or `level`, `worlds`, `split`, and
            `salt_file` for hidden worlds.
    """
    if "task" in about:
        return TaskProblem(load_task(about["task"]))
    salt_file = about.get("salt_file")
    return LevelProblem(
        load_set(about["level"]),
        about["worlds"],
        about["split"],
        None if salt_file is None else Path(salt_file),
    )


def raw(source: str) -> bytes:
    """The bytes of a controller's source."""
    return source.encode("utf-8", "surrogatepass")


def unusable(problem: str) -> str:
    """What is said of an answer without a controller."""
    return (
        f"Your answer cannot be used: {problem}. Answer with the whole file in one "
        "fenced ```python block."
    )


def _driven(report: EpisodeReport) -> Judged:
    """The scores on worlds of a level; 0 if the tests refused the file."""
    about, scores = report.provenance, report.scores
    failed = report.refused or report.successes < report.count
    told = report.count == 0 or bool(report.told)
    line = summary_of(report)
    return Judged(
        passed=not failed,
        scores={
            "success": 0.0 if scores is None else scores.success,
            "time": 0.0 if scores is None else scores.time,
        },
        feedback=set_feedback(report).text if failed and told else line,
        facts={
            "set_sha256": about.sha256,
            "split": about.split,
            "salt_sha256": about.salt_sha256,
            "controller_sha256": about.controller_sha256,
            "sandbox": about.sandbox,
            "versions": about.versions,
            "report": report.model_dump(mode="json"),
        },
    )
