"""Interface of what submissions are judged on: one task, or a task set."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from tdac_agent.mcp.answers import ChooseAnswer, Judged, Left
from tdac_agent.runs.recorder import Recorder


@dataclass(frozen=True, slots=True)
class Submission:
    """A controller that an agent submitted, and how it did.

    Attributes:
        number: Its number, from 1; in the run it is the candidate (number, 0).
        source: Its source.
        folder: Its folder.
        judged: How it did.
    """

    number: int
    source: str
    folder: Path
    judged: Judged


class Judging(Protocol):
    """Judges submissions: `OnTask` or `OnSet`."""

    @property
    def recorder(self) -> Recorder:
        """Records the run."""

    @property
    def about(self) -> str:
        """What the submissions are for, in a few words."""

    def question(self) -> str:
        """What is to be written: the first question to a model."""

    def left(self, submissions: int) -> Left:
        """What is left of the budget after a number of submissions."""

    def judge(self, number: int, source: str, folder: Path) -> Judged:
        """Tests a controller, and records the result; a recorded one is reused.

        Raises:
            Fault: The sandbox is broken; the controller neither passes nor fails.
        """

    def recorded(self, number: int, folder: Path) -> Judged:
        """How a submission of a finished run did."""

    def picture(self, submission: Submission, episode: str) -> bytes:
        """A PNG of an episode.

        Raises:
            Refused: There is no such episode, or it is not shown.
        """

    def choose(self, submission: Submission) -> None:
        """Delivers a controller and ends the run; repeated after an interruption.

        Raises:
            Fault: The sandbox is broken; the run goes on, with this choice.
        """

    def verdict(self, number: int) -> ChooseAnswer:
        """The verdict of a run that ended with the choice of a submission."""
