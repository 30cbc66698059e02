"""Carries out a campaign: which runs are left, their order, and when to stop."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tdac_agent.campaign.config import CampaignError
from tdac_agent.campaign.perform import RUNS, Outcome, Terms, read_outcome, work_of
from tdac_agent.campaign.plan import Plan, PlannedRun, Shard
from tdac_agent.campaign.progress import CampaignProgress, RunEnded, RunUpdate
from tdac_agent.errors import RunError
from tdac_agent.executors.executor import Ended, Executor
from tdac_agent.runs.ownership import is_own_folder
from tdac_agent.runs.run_record import load_run
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import own_folder

CONFIG_FILE = "campaign.yaml"
Watch = Callable[[RunUpdate], None]


@dataclass(slots=True)
class _Queue:
    """The runs that are left, and those to retry."""

    progress: CampaignProgress
    todo: deque[PlannedRun]
    retries: deque[tuple[PlannedRun, Outcome]] = field(default_factory=deque)
    _retried: set[str] = field(default_factory=set)

    def next(self) -> PlannedRun | None:
        """The next run; runs that a fault ended are retried once, after all others."""
        while self.todo:
            planned = self.todo.popleft()
            if not (self.progress.exhausted and planned.cell.asks_models):
                return planned
        if not self.retries:
            return None
        planned, outcome = self.retries.popleft()
        self.progress.take_back(planned, outcome)
        return planned

    def ended(self, update: RunEnded) -> None:
        """Queues a run for a retry when a fault ends it for the first time."""
        name = update.job.name
        if update.outcome.status == "fault" and name not in self._retried:
            self._retried.add(name)
            self.retries.append((update.job, update.outcome))


def read_progress(
    plan: Plan, shard: Shard, runs: Path
) -> tuple[CampaignProgress, list[PlannedRun]]:
    """Reads the progress and the remaining runs of a campaign from its folder."""
    progress, left = CampaignProgress.of(plan, shard), []
    for planned in plan.all(shard):
        known = read_outcome(planned.name, runs)
        if known is not None and known.finished:
            progress.had(planned, known)
        else:
            left.append(planned)
    return progress, left


def run_all(
    progress: CampaignProgress,
    left: list[PlannedRun],
    terms: Terms,
    run: Executor[Outcome, PlannedRun],
    watch: Watch,
) -> None:
    """Executes the runs that are left; a run that fails does not stop the others.

    Once the budget is exhausted, no further run that may cost money begins.

    Args:
        progress: Updated in place.
        left: The runs that are left, in order.
        terms: Settings that all runs share.
        run: The executor.
        watch: Called with each update, after `progress` is updated.
    """
    queue = _Queue(progress, deque(left))
    with closing(run(work_of(terms), queue.next)) as updates:
        for update in updates:
            progress.update(update)
            if isinstance(update, Ended):
                queue.ended(update)
            watch(update)


@contextmanager
def campaign_folder(out: Path, shard: Shard, config: str) -> Generator[None]:
    """Makes a campaign's folder, and locks it against other drivers of the shard.

    Args:
        out: The folder.
        shard: The part that is carried out.
        config: Text of the campaign file, which is copied to the folder.

    Raises:
        RunError: The folder cannot be used, another driver uses it, or a link leads
            out of it.
    """
    lock = f".driver-{shard.i}-of-{shard.n}.lock"
    with ExitStack() as stack:
        try:
            if out.is_dir() and any(out.iterdir()) and not (out / RUNS).is_dir():
                reason = "is not empty; give another folder with --out"
                raise CampaignError(f"{out} {reason}")
            stack.enter_context(own_folder(out, "*", lock=lock))
            (out / RUNS).mkdir(exist_ok=True)
            write_atomic(out / CONFIG_FILE, config)
        except OSError as error:
            raise CampaignError(f"cannot write to {out}: {error.strerror}") from error
        yield


def foreign_runs(plan: Plan, runs: Path) -> int:
    """Number of finished runs that this installation did not write as they are.

    Those of other shards can be from other machines, so they count.
    """
    return sum(_is_foreign(runs / planned.name) for planned in plan.all())


def _is_foreign(folder: Path) -> bool:
    try:
        run = load_run(folder)
    except RunError:
        return False
    return run.finished and not is_own_folder(run)


def unplanned_folders(plan: Plan, runs: Path) -> list[str]:
    """Run folders that are not in the plan, e.g. of a changed task or file."""
    known = {cell.folder for cell in plan.cells}
    return sorted(path.name for path in runs.iterdir() if path.name not in known)
