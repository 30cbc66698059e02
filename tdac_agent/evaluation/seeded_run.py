"""Has the judge's process run many episodes, and reads what it found."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import ValidationError

from tdac_agent.errors import Fault
from tdac_agent.tasks.setting import Nominal
from tdac_agent.verification.diagnosis.measures import Measured
from tdac_agent.verification.judge.seeded import (
    ENDING_FILE,
    EPISODES_FILE,
    Ending,
    SeededEpisode,
    SeededJob,
)
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import DEADLINE_SECONDS

E = TypeVar("E", SeededEpisode, Measured)
# A policy twice too slow is cut off, and a time-out is tried once more.
SLOWEST = 4.0


def run_seeds(
    job: SeededJob,
    nominal: Nominal,
    kind: type[E],
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> tuple[list[E], Ending]:
    """Has a job done; returns the episodes and what else was found.

    Args:
        job: With a folder for its results whose parent is there.
        nominal: Its task, which says how long an episode may take.
        kind: Of the episodes.
        judge: A warm one; one of its own by default.
        watch: Called now and then with the number of episodes and of successes.

    Raises:
        Fault: The judge or the sandbox is broken.
    """
    job.out.mkdir()
    request = job.out.parent / f"{job.out.name}.json"
    request.write_text(job.model_dump_json(), encoding="utf-8")
    longest = SLOWEST * nominal.horizon * nominal.dt
    tail = _Tail(kind, job.out / EPISODES_FILE, watch)
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge())
        warm.run(request, longest * len(job.seeds) + DEADLINE_SECONDS, tail.read)
    tail.read()
    return tail.episodes, _ending(job.out / ENDING_FILE, request.parent / "output.txt")


def _ending(path: Path, output: Path) -> Ending:
    try:
        ending = Ending.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        printed = output.read_text("utf-8", "replace") if output.is_file() else ""
        lines = [line.strip() for line in printed.splitlines() if line.strip()]
        said = " | ".join(lines[-4:]) or "no output"
        raise Fault(f"the judge did not finish the episodes: {said}") from error
    if ending.fault is not None:
        raise Fault(ending.fault)
    return ending


@dataclass(slots=True)
class _Tail(Generic[E]):
    """Reads what the judge's process appends, as it comes.

    Attributes:
        kind: Of the episodes.
        path: File with a line for each episode; not there at first.
        watch: Told the number of episodes and of successes, where both grew.
        episodes: Those read so far.
    """

    kind: type[E]
    path: Path
    watch: Callable[[int, int], None] | None = None
    episodes: list[E] = field(default_factory=list)
    _offset: int = 0
    _successes: int = 0

    def read(self) -> None:
        """Takes the lines that are whole by now."""
        if not self.path.is_file():
            return
        with self.path.open("rb") as file:
            file.seek(self._offset)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._offset += len(whole)
        for line in whole.splitlines():
            episode = self.kind.model_validate_json(line)
            self.episodes.append(episode)
            self._successes += episode.success
        if whole and self.watch is not None:
            self.watch(len(self.episodes), self._successes)
