"""Runs many episodes in the judge's process, and reads their results."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from tdac_agent.errors import Fault
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.verification.diagnosis.measures import Measured
from tdac_agent.verification.judge.drivers import PolicySpec
from tdac_agent.verification.judge.jobs import write_job
from tdac_agent.verification.judge.seeded import (
    ENDING_FILE,
    EPISODES_FILE,
    JobEnding,
    ScoredEpisode,
    SeededEpisode,
    SeededJob,
)
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.set_job import WorldEpisode
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import DEADLINE_SECONDS
from tdac_envs.core.errors import TaskError

E = TypeVar("E", SeededEpisode, ScoredEpisode, Measured, WorldEpisode)
# Wall time / simulated time: a policy is stopped at 2, a time-out is repeated once.
SLOWEST = 4.0


def controller_job(
    folder: Path,
    source: bytes,
    task: Task,
    disturbance: Disturbance,
    seeds: Sequence[int],
    *,
    tier: str,
    limits: Limits | None = None,
    test: SequentialTest | None = None,
    failures: Path | None = None,
) -> SeededJob:
    """Lays out a controller and its task in a folder; returns the job to drive it.

    Args:
        folder: An empty folder; the results go there, too.
        source: Source of the controller.
        task: What it must do.
        disturbance: Disturbance of the environment.
        seeds: A seed for each episode; the starts are jittered.
        tier: Sandbox tier.
        limits: Limits of the controller's process.
        test: Stops early, once it has decided.
        failures: Folder for the trajectories of failed episodes, which are then scored.
    """
    file = folder / "controller.py"
    write_atomic(file, source)
    return SeededJob(
        task=lay_out(task, folder / "work"),
        policy=PolicySpec("controller", file),
        disturbance=disturbance,
        variation="jitter",
        seeds=tuple(seeds),
        test=test,
        failures=failures,
        tier=tier,
        limits=limits or Limits(),
        out=folder / "results",
    )


def run_seeds(
    job: SeededJob,
    nominal: Nominal,
    kind: type[E],
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> tuple[list[E], JobEnding]:
    """Runs a job; returns its episodes and its ending.

    Args:
        job: The job; the parent of its result folder must exist.
        nominal: The nominal task, which limits the duration of an episode.
        kind: Type of the episodes.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        Fault: The judge or the sandbox is broken.
    """
    seconds = nominal.horizon * nominal.dt * len(job.seeds)
    return run_job(job, job.out, seconds, kind, judge, watch)


def run_job(
    job: BaseModel,
    out: Path,
    simulated: float,
    kind: type[E],
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> tuple[list[E], JobEnding]:
    """Runs a job of many episodes; returns them and its ending.

    Args:
        job: The job.
        out: Its result folder, which is made.
        simulated: Longest simulated time of all episodes together, s.
        kind: Type of the episodes.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        Fault: The judge or the sandbox is broken.
        TaskError: A world cannot be made.
    """
    out.mkdir()
    request = out.parent / f"{out.name}.json"
    write_job(job, request)
    tail = _Tail(kind, out / EPISODES_FILE, watch)
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge())
        warm.run(request, SLOWEST * simulated + DEADLINE_SECONDS, tail.read)
    tail.read()
    return tail.episodes, _ending(out / ENDING_FILE, request.parent / "output.txt")


def _ending(path: Path, output: Path) -> JobEnding:
    try:
        ending = JobEnding.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
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
class _Tail(Generic[E]):
    """Reads the episodes that the judge's process appends to a file.

    Attributes:
        kind: Type of the episodes.
        path: File with a line for each episode; does not exist at first.
        watch: Called with the numbers of episodes and successes after new episodes.
        episodes: Episodes read so far.
    """

    kind: type[E]
    path: Path
    watch: Callable[[int, int], None] | None = None
    episodes: list[E] = field(default_factory=list)
    _offset: int = 0
    _successes: int = 0

    def read(self) -> None:
        """Reads the lines that are complete."""
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
