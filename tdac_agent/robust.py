"""Robust verification: many disturbed episodes in, a success rate out."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import ValidationError

from tdac_agent.disturbance import Disturbance
from tdac_agent.errors import Fault
from tdac_agent.files import write_atomic
from tdac_agent.provenance import origin
from tdac_agent.robust_report import RobustProvenance, RobustReport, summarise
from tdac_agent.sandbox import Limits
from tdac_agent.seeded import (
    ENDING_FILE,
    EPISODES_FILE,
    Ending,
    SeededEpisode,
    SeededJob,
)
from tdac_agent.sequential import MARGIN, SequentialTest
from tdac_agent.task import Task, portable_task_file, write_workdir
from tdac_agent.verification import DEADLINE_SECONDS, read_source
from tdac_agent.warm import WarmJudge
from tdac_envs.arguments import whole_number

EPISODES = 200
# A policy twice too slow is cut off, and a time-out is tried once more.
SLOWEST = 4.0


def verify_robust(
    controller: str | bytes | Path,
    task: Task,
    episodes: int = EPISODES,
    *,
    disturbance: Disturbance | None = None,
    first_seed: int = 0,
    accept_at: float | None = None,
    margin: float = MARGIN,
    tier: str = "auto",
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Callable[[int, int], None] | None = None,
) -> RobustReport:
    """Counts how often a controller reaches the goal when it is disturbed.

    Each episode depends on the task, the disturbance and its seed alone, and has a
    fresh process. The suite is not run; see `verify`.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        task: What it must do.
        episodes: How many; with `accept_at`, how many at most.
        disturbance: Of the environment.
        first_seed: The episodes have this seed and the following ones.
        accept_at: Stop as soon as a sequential test decides whether the success rate
            is at least this, or at most `margin` less; then there is no interval.
        margin: See `accept_at`.
        tier: Sandbox tier, `auto` for the best one here.
        limits: Of the controller's process in each episode, `cpu_seconds` too.
        out: Folder for `robust.json`; none by default.
        judge: A warm one; one of its own by default.
        watch: Called now and then with the number of episodes and of successes.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: A number makes no sense.
        Fault: The sandbox is broken: neither pass nor fail.
    """
    began = time.monotonic()
    whole_number("episodes", episodes, 1)
    whole_number("first seed", first_seed, 0)
    test = None if accept_at is None else SequentialTest(accept_at, episodes, margin)
    source = read_source(controller)
    with tempfile.TemporaryDirectory(prefix="tdac-robust-") as name:
        folder = Path(name)
        job = SeededJob(
            task=folder / "work",
            controller=folder / "controller.py",
            disturbance=disturbance or Disturbance(),
            first_seed=first_seed,
            episodes=episodes,
            test=test,
            tier=tier,
            limits=limits or Limits(),
            out=folder / "results",
        )
        ended, ending = _run(job, task, source, folder, judge, watch)
        provenance = RobustProvenance(
            **origin(task, source, job.task, ending.tier, job.limits),
            disturbance=job.disturbance,
            first_seed=first_seed,
        )
    report = summarise(provenance, ended, test, time.monotonic() - began)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_atomic(out / "robust.json", report.model_dump_json(indent=2) + "\n")
    return report


def _run(
    job: SeededJob,
    task: Task,
    source: bytes,
    folder: Path,
    judge: WarmJudge | None,
    watch: Callable[[int, int], None] | None,
) -> tuple[list[SeededEpisode], Ending]:
    """Has the job done; returns the episodes and what else was found."""
    job.out.mkdir()
    write_workdir(job.task, task)
    write_atomic(job.task / "task.yaml", portable_task_file(task))
    write_atomic(job.controller, source)
    request = folder / "job.json"
    request.write_text(job.model_dump_json(), encoding="utf-8")
    nominal = task.nominal
    seconds = SLOWEST * nominal.horizon * nominal.dt * job.episodes + DEADLINE_SECONDS
    tail = Tail(job.out / EPISODES_FILE, watch)
    with contextlib.ExitStack() as stack:
        warm = judge or stack.enter_context(WarmJudge())
        warm.run(request, seconds, tail.read)
    tail.read()
    return tail.episodes, _ending(job.out / ENDING_FILE, folder / "output.txt")


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
class Tail:
    """Reads what the judge's process appends, as it comes.

    Attributes:
        path: File with a line for each episode; not there at first.
        watch: Told the number of episodes and of successes, where both grew.
        episodes: Those read so far.
    """

    path: Path
    watch: Callable[[int, int], None] | None = None
    episodes: list[SeededEpisode] = field(default_factory=list)
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
            episode = SeededEpisode.model_validate_json(line)
            self.episodes.append(episode)
            self._successes += episode.success
        if whole and self.watch is not None:
            self.watch(len(self.episodes), self._successes)
