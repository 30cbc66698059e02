"""Runs a job of many episodes in the judge's process, and reads its rows."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from tdac_agent.errors import Fault
from tdac_agent.verification.judge.episode_job import (
    ENDING_FILE,
    EPISODES_FILE,
    EpisodeJob,
    JobEnding,
)
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.jobs import write_job
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import DEADLINE_SECONDS
from tdac_envs.core.errors import TaskError

# Wall time / simulated time: a policy is stopped at 2, a time-out is repeated once.
SLOWEST = 4.0
Watch = Callable[[int, int], None]


def run_episodes(
    job: EpisodeJob,
    simulated: float,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
    series: str = "",
) -> tuple[list[EpisodeRow], JobEnding]:
    """Runs a job; returns its rows and its ending.

    Args:
        job: The job; the parent of its result folder must exist.
        simulated: Longest simulated time of an episode, s.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.
        series: Name of the series if the job is one of a series; see `WarmJudge.run`.

    Raises:
        Fault: The judge or the sandbox is broken.
        TaskError: A world cannot be made.
    """
    job.out.mkdir()
    request = job.out.parent / f"{job.out.name}.json"
    write_job(job, request)
    tail = _Tail(job.out / EPISODES_FILE, watch)
    longest = SLOWEST * simulated * len(job.numbers) + DEADLINE_SECONDS
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge())
        warm.run(request, longest, tail.read, series)
    tail.read()
    return tail.rows, _ending(job.out / ENDING_FILE, request.parent / "output.txt")


def _ending(path: Path, output: Path) -> JobEnding:
    try:
        # raw read: our temporary folder
        ending = JobEnding.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        # raw read: our temporary folder
        printed = output.read_text("utf-8", "replace") if output.is_file() else ""
        lines = [line.strip() for line in printed.splitlines() if line.strip()]
        last = " | ".join(lines[-4:]) or "no output"
        raise Fault(f"the judge did not finish the episodes: {last}") from error
    if ending.fault is not None:
        raise Fault(ending.fault)
    if ending.problem is not None:
        raise TaskError(ending.problem)
    return ending


@dataclass(slots=True)
class _Tail:
    """Reads the rows that the judge's process appends to a file.

    Attributes:
        path: File with a line for each episode; does not exist at first.
        watch: Called with the numbers of episodes and successes after new episodes.
        rows: Rows read so far.
    """

    path: Path
    watch: Watch | None = None
    rows: list[EpisodeRow] = field(default_factory=list)
    _offset: int = 0
    _successes: int = 0

    def read(self) -> None:
        """Reads the lines that are complete."""
        if not self.path.is_file():
            return
        with self.path.open("rb") as file:  # raw read: our temporary folder
            file.seek(self._offset)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._offset += len(whole)
        for line in whole.splitlines():
            row = EpisodeRow.model_validate_json(line)
            self.rows.append(row)
            self._successes += row.success
        if whole and self.watch is not None:
            self.watch(len(self.rows), self._successes)
