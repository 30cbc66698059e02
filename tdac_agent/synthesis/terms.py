"""What the trials of a run share, and what came of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.runs.recorder import Recorder
from tdac_agent.synthesis.archive import Archive
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.synthesis.workload import Shares
from tdac_agent.verification.judge.warm import WarmJudge


@dataclass(frozen=True, slots=True)
class Terms:
    """What all tests of candidates share.

    Attributes:
        recorder: Records the run.
        judge: A warm judge.
        shares: How the episodes are divided.
        options: Options of the synthesis.
    """

    recorder: Recorder
    judge: WarmJudge
    shares: Shares
    options: SynthOptions

    @property
    def tier(self) -> str:
        """Sandbox tier."""
        return self.options.tier

    @property
    def block(self) -> int:
        """Most episodes of a test on a task set."""
        return self.options.feedback_episodes

    def watch(self, **about: Any) -> Callable[[int, int], None]:
        """Returns what tells how a drive goes; it takes episodes and successes."""

        def tell(done: int, reached: int) -> None:
            step = {"event": "drive.step", **about, "done": done, "reached": reached}
            self.recorder.tell(step)

        return tell

    @property
    def trusts_record(self) -> bool:
        """Whether results in the run folder are reused: not another installation's."""
        return bool(self.recorder.run.mark)

    @property
    def folder(self) -> Path:
        """The run folder."""
        return self.recorder.run.folder


@dataclass(frozen=True, slots=True)
class Chosen:
    """The candidate that a run came to, and how.

    Attributes:
        candidate: The candidate.
        written: All candidates.
        archive: What a search for improvements found; None without one.
        asked: Number of variations that were answered.
        stopped: What ended the writing early.
    """

    candidate: Candidate
    written: Sequence[Candidate]
    archive: Archive | None = None
    asked: int = 0
    stopped: str = ""
