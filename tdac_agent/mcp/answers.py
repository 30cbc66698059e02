"""What the tools answer."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import BaseModel, Field

from tdac_agent.verification.decision import decision_text
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.verdict import is_verified, verified_text


class Refused(Exception):
    """A request that cannot be answered: what is wrong, in one line."""


class EpisodeAnswer(BaseModel):
    """An episode of a submission."""

    name: str = Field(description="Its name, for `picture`.")
    outcome: str = Field(description="`reached`, `collision`, `out of time`, …")
    steps: int
    gap: float | None = Field(
        description="Smallest gap to obstacles, px or m; 0 with a contact."
    )
    too_close: bool = Field(description="Whether it is smaller than the required gap.")


@dataclass(frozen=True, slots=True)
class Left:
    """What is left of the budget.

    Attributes:
        submissions: Number of submissions.
        episodes: Number of episodes on worlds of `dev`; None on a single task.
    """

    submissions: int
    episodes: int | None = None

    @property
    def spent(self) -> bool:
        """Whether nothing can be submitted any more."""
        return self.submissions == 0 or self.episodes == 0

    def __str__(self) -> str:
        parts = [] if self.episodes is None else [_count(self.episodes, "episode")]
        return " and ".join([*parts, _count(self.submissions, "submission")])


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


class SubmitAnswer(BaseModel):
    """Answer of `submit`."""

    submission: int = Field(description="Its number, for the other tools.")
    passed: bool = Field(
        description="Whether it passed all tests of the task. On a task set always "
        "false. Only `choose` verifies."
    )
    summary: str = Field(description="The result in one line.")
    episodes: list[EpisodeAnswer] = Field(description="Episodes that may be shown.")
    submissions_left: int
    episodes_left: int | None = Field(
        description="Episodes that are left on a task set; null on a single task."
    )


class SubmissionLine(BaseModel):
    """One of the submissions."""

    submission: int
    passed: bool = Field(description="As `submit` told it.")
    verified: bool = Field(description="Whether it was chosen, and verified.")
    can_be_chosen: bool
    summary: str


class SubmissionsAnswer(BaseModel):
    """Answer of `submissions`."""

    submissions: list[SubmissionLine]
    submissions_left: int = Field(description="0 if the run has ended.")
    episodes_left: int | None = Field(description="Null on a single task.")
    chosen: int | None = Field(description="The submission that was chosen, if any.")
    ended: str | None = Field(description="How the run ended; null while it goes on.")


class ChooseAnswer(BaseModel):
    """Answer of `choose`: the verdict, which ends the run."""

    submission: int
    verified: bool
    summary: str = Field(description="The verdict in one line.")
    worlds: int | None = Field(description="Hidden worlds driven; null on a task.")
    reached: int | None = Field(description="Those in which the goal was reached.")


def blind_verdict(number: int, report: EpisodeReport) -> ChooseAnswer:
    """The verdict on a task: blind drives of what passed the suite."""
    return ChooseAnswer(
        submission=number,
        verified=is_verified(report),
        summary=verified_text(report),
        worlds=None,
        reached=None,
    )


def hidden_verdict(number: int, report: EpisodeReport) -> ChooseAnswer:
    """The verdict on hidden worlds of a task set."""
    parts = [f"the goal reached in {report.successes} of {report.count} hidden worlds"]
    if report.refused:
        parts = ["the static and contract tests refused the file"]
    if report.sequential is not None:
        parts.append(decision_text(report.sequential).rstrip(","))
    if report.causes:
        counts = (f"{count} {name}" for name, count in report.causes.items())
        parts.append(f"failures: {', '.join(counts)}")
    return ChooseAnswer(
        submission=number,
        verified=report.passed,
        summary="; ".join(parts),
        worlds=report.count,
        reached=report.successes,
    )
