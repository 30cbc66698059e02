"""Judges answers to the question of a problem, for other frameworks.

They ask and record; nothing here depends on one of them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.builtin.level import controller_of
from tdac_agent.errors import RunError
from tdac_agent.problems.choice import problem_of
from tdac_agent.problems.problem import Judged, Poll, Problem
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.runs.ownership import load_task
from tdac_agent.synthesis.set_reports import set_feedback, summary_of
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_agent.synthesis.world_trials import BLOCKS
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verify import verify
from tdac_agent.verification.verify_episodes import JUDGED, verify_episodes
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.salt import read_salt
from tdac_envs.ladder.task_sets import load_set

FEEDBACK_WORLDS = 8
"""Worlds of `dev` that a controller for a task set drives on between two answers."""


@dataclass(frozen=True, slots=True, eq=False)
class Exam:
    """What answers are for, and how they are judged: by a suite, or on worlds.

    Attributes:
        problem: A task, or a task set.
        worlds: Number of worlds of a set.
        split: The split that they are from.
        salt_file: File with the salt of the split `hidden`.
    """

    problem: Problem
    worlds: int = 20
    split: str = "test"
    salt_file: Path | None = None

    def __post_init__(self) -> None:
        """Checks all values before a model is asked."""
        one_of("split", self.split, JUDGED)
        whole_number("worlds", self.worlds, 1, MOST_EPISODES)
        if self.problem.tasks is not None:
            salt = None if self.salt_file is None else read_salt(self.salt_file)
            self.problem.tasks.key(self.split, 0, "world", salt)

    @property
    def scores(self) -> tuple[str, ...]:
        """Names of the scores, the main one first."""
        return ("success", "time") if self.problem.has_hidden else ("passed",)

    def question(self) -> str:
        """The first question to a model."""
        self.problem.check()
        return self.problem.question()

    def judge(self, source: bytes, poll: Poll) -> Judged:
        """The verdict, or the scores.

        Args:
            source: The controller.
            poll: Called repeatedly.
        """
        return self._judged(source, poll, self.split, self.worlds, 0, self.salt_file)

    def rehearse(self, source: bytes, turn: int, poll: Poll) -> Judged:
        """The feedback between two answers.

        That of a task is its verdict, which tells only pass or fail of held-out starts.
        On a task set, the worlds are other ones in each turn, and never those judged.

        Args:
            source: The controller.
            turn: Number of the answer, from 0.
            poll: Called repeatedly.
        """
        first = BLOCKS + turn * FEEDBACK_WORLDS  # not the judged ones of `dev`
        return self._judged(source, poll, "dev", FEEDBACK_WORLDS, first, None)

    def _judged(
        self,
        source: bytes,
        poll: Poll,
        split: str,
        worlds: int,
        first: int,
        salt_file: Path | None,
    ) -> Judged:
        if self.problem.task is not None:
            return _tested(verify(source, self.problem.task, meanwhile=poll))
        assert self.problem.tasks is not None
        report = verify_episodes(
            source,
            self.problem.tasks,
            worlds,
            split=split,
            first=first,
            salt_file=salt_file,
            watch=lambda _done, _reached: poll(),
        )
        return _driven(report)


def exam_of(about: Mapping[str, Any]) -> Exam:
    """How the answers to a sample are judged.

    Args:
        about: The sample's metadata: `task`, or `level`, `worlds`, `split`, and
            `salt_file` for hidden worlds.
    """
    if "task" in about:
        return Exam(problem_of(load_task(about["task"])))
    file = about.get("salt_file")
    salt_file = None if file is None else Path(file)
    level = problem_of(load_set(about["level"]))
    return Exam(level, about["worlds"], about["split"], salt_file)


def files_of(problem: Problem) -> dict[str, bytes]:
    """Files of a controller's working folder, by name."""
    with tempfile.TemporaryDirectory(prefix="tdac-files-") as name:
        folder = Path(name)
        problem.write_files(folder)
        # raw read: just written
        return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


def reference_of(problem: Problem) -> str:
    """The source of tdac's own controller, which knows what a model knows.

    On a task, it is tuned until it passes.

    Raises:
        RunError: Tuning did not help.
        TaskError: There is none for the task set.
    """
    if problem.tasks is not None:
        # raw read: shipped
        return controller_of(problem.tasks, "ask a model").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="tdac-builtin-") as name:
        run = synthesize(problem, out=Path(name) / "run", confirm=False)
        if not run.passed:
            raise RunError(
                "the learner `builtin` has no controller that passes the task "
                f"{problem.name}"
            )
        # raw read: just written
        return run.controller.read_text(encoding="utf-8")


def unusable(problem: str) -> str:
    """What is said of an answer without a controller."""
    return (
        f"Your answer cannot be used: {problem}. Answer with the whole file in one "
        "fenced ```python block."
    )


def _tested(report: Report) -> Judged:
    about, passed = report.provenance, f"all {report.verdict.expected} tests passed"
    return Judged(
        passed=report.passed,
        scores={"passed": float(report.passed)},
        feedback=passed if report.passed else render_feedback(report),
        facts={
            "task_sha256": about.task_sha256,
            "suite_sha256": about.suite_sha256,
            "controller_sha256": about.controller_sha256,
            "sandbox": about.sandbox,
            "versions": about.versions,
            "report": report.model_dump(mode="json"),
        },
    )


def _driven(report: EpisodeReport) -> Judged:
    """The scores on worlds of a set; 0 if the tests refused the file."""
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
