"""Executes one run of a campaign, for every executor."""

from __future__ import annotations

import functools
import shutil
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tdac_agent.campaign.concurrency import limited_provider
from tdac_agent.campaign.plan import SET_LIMITS, PlannedRun
from tdac_agent.errors import Fault, RunError
from tdac_agent.executors.executor import Work
from tdac_agent.models.budget import Budget
from tdac_agent.models.choice import choose_models
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.problems.choice import problem_of
from tdac_agent.runs.ownership import is_own_folder, load_task, mark_anew
from tdac_agent.runs.resume import existing_run
from tdac_agent.runs.run_record import FINISHED, JOURNAL, RUN_FILE, Run, load_run
from tdac_agent.runs.selection_record import HIDDEN_FILE
from tdac_agent.synthesis.synthesize import synthesize
from tdac_agent.tasks.installation import seed_from
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import SET_FILE, TASK_FILE
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.errors import TdacError
from tdac_envs.ladder.task_sets import TaskSet, load_set

PATIENCE = RetryPolicy(seconds=4 * 3600.0)
"""Longer than for a single run, since no user is waiting."""
REPORTED_EVENTS = frozenset(
    {"call.intent", "call.fault", "verify.start", "drive.start", "hidden.start"}
)
REPORTED_KEYS = ("event", "kind", "k", "j", "fault", "what", "worlds")
SETTINGS = "iterations", "patience", "refine", "base_url", "prompt", "max_output"
"""Options of `synthesize` that a cell has by the same names."""
RUNS = "runs"
"""Folder of the runs, inside the campaign folder."""
KEPT = frozenset(
    {RUN_FILE, JOURNAL, TASK_FILE, "controller.py", "report.json"}
    | {SET_FILE, HIDDEN_FILE}
)


@dataclass(frozen=True, slots=True)
class Terms:
    """Settings that all runs of a campaign share.

    Attributes:
        folder: Folder of the campaign, absolute.
        workers: Number of runs at a time.
        max_cost: Limit for all runs together, USD.
        max_tokens: Token limit for all runs together.
        keep: `all`, or `records`.
        key_over_http: As for `synthesize`.
    """

    folder: str
    workers: int
    max_cost: float | None
    max_tokens: int | None
    keep: str
    key_over_http: bool = False

    @property
    def runs(self) -> Path:
        """The folder of all runs."""
        return Path(self.folder) / RUNS

    def budget(self, planned: PlannedRun) -> Budget:
        """The shared budget, or an unlimited one if the run asks only free models."""
        if not planned.cell.asks_models:
            return Budget()
        return _budget(self)


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a run.

    Attributes:
        name: Name of the run.
        status: As in `run.json`; `error` if the run could not be executed.
        reason: Why it is not finished.
        tau: Iteration of the first success.
        tokens: Input and output tokens.
        cost: USD; None if unknown.
        seconds: Duration, all of its processes together.
    """

    name: str
    status: str
    reason: str = ""
    tau: int | None = None
    tokens: int = 0
    cost: float | None = 0.0
    seconds: float = 0.0

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        return self.status in FINISHED

    def to_json(self) -> dict[str, Any]:
        """The outcome as JSON, for another process."""
        return asdict(self)


Tell = Callable[[dict[str, Any]], None]


def perform(
    planned: PlannedRun, terms: Terms, judge: WarmJudge | None, tell: Tell | None = None
) -> Outcome:
    """Executes or resumes a run; an error becomes an outcome.

    Args:
        planned: The run.
        terms: Settings that all runs share.
        judge: A warm judge; None starts one for this run.
        tell: Called with each journal record.
    """
    try:
        run = _synthesize(planned, terms, judge, tell)
    except Fault as error:
        known = read_outcome(planned.name, terms.runs)
        return known or Outcome(planned.name, "error", str(error))
    except (TdacError, OSError) as error:
        return Outcome(planned.name, "error", " ".join(str(error).split()))
    except Exception as error:  # must not stop the other runs
        traceback.print_exc(file=sys.stderr)
        reason = " ".join(str(error).split())
        return Outcome(planned.name, "error", f"{type(error).__name__}: {reason}")
    if terms.keep == "records" and run.finished:
        own = is_own_folder(run)
        _thin_out(run.folder)
        if own:
            mark_anew(run)
    return _outcome(planned.name, run)


def perform_job(
    job: str, terms: dict[str, Any], judge: WarmJudge, tell: Tell
) -> dict[str, Any]:
    """Executes a run for an executor; see `executors.executor.Work`."""

    def report(record: dict[str, Any]) -> None:
        if record.get("event") in REPORTED_EVENTS:
            tell({name: record[name] for name in REPORTED_KEYS if name in record})

    planned = PlannedRun.from_json(job)
    return perform(planned, Terms(**terms), judge, report).to_json()


def work_of(terms: Terms) -> Work[Outcome]:
    """The runs of a campaign as work for an executor."""
    return Work(
        module=__name__,
        terms=asdict(terms),
        workers=terms.workers,
        folder=Path(terms.folder),
        read=lambda values: Outcome(**values),
        failed=lambda name, reason: Outcome(name, "error", reason),
    )


def _synthesize(
    planned: PlannedRun, terms: Terms, judge: WarmJudge | None, tell: Tell | None
) -> Run:
    cell = planned.cell
    problem = problem_of(_load(cell.task, cell.on_set))
    models = choose_models(
        cell.learner,
        cell.optimizer,
        problem.setting,
        cell.base_url,
        key_over_http=terms.key_over_http,
    )
    gates, same = Path(terms.folder) / "gates", models[0] is models[1]
    learner = limited_provider(models[0], gates, terms.workers)
    optimizer = learner if same else limited_provider(models[1], gates, terms.workers)
    folder = terms.runs / planned.name
    folder.parent.mkdir(parents=True, exist_ok=True)
    limits = SET_LIMITS if problem.has_hidden else ()
    settings = {name: getattr(cell, name) for name in (*SETTINGS, *limits)}
    settings |= cell.search | dict(cell.options)
    return synthesize(
        problem,
        learner,
        optimizer,
        out=folder,
        seed=_seed(planned, problem.sha256, folder),
        then_verify=problem.has_hidden,
        confirm=False,  # its metrics count what passed
        budget=terms.budget(planned),
        index=planned.index,
        retry=PATIENCE,
        judge=judge,
        on_event=tell,
        **settings,
    )


def _seed(planned: PlannedRun, task_sha256: str, folder: Path) -> int:
    """The seed of a run: the planned one, the recorded one, or an unpredictable one.

    Runs of all kinds with the same index on the same task or task set share it.
    """
    if planned.seed is not None:
        return planned.seed
    before = existing_run(folder)
    if before is not None and before.seed is not None:
        return before.seed
    return seed_from(f"run {planned.index}".encode(), task_sha256)


@functools.lru_cache(maxsize=1)
def _budget(terms: Terms) -> Budget:
    """The shared budget; cached, so that it reads only new entries of its ledger."""
    ledger = Path(terms.folder) / "ledger.jsonl"
    return Budget(terms.max_cost, terms.max_tokens, ledger)


@functools.lru_cache(maxsize=4)
def _load(name: str, on_set: bool) -> Task | TaskSet:
    """A task or task set; cached, since a worker executes many runs of it."""
    # Its tests were permitted when the campaign was planned.
    return load_set(name) if on_set else load_task(name, trust=True)


def read_outcome(name: str, runs: Path) -> Outcome | None:
    """The recorded outcome of a run; None if there is no readable record.

    Args:
        name: Name of the run.
        runs: Folder of all runs.
    """
    with suppress(RunError):
        return _outcome(name, load_run(runs / name))
    return None


def _outcome(name: str, run: Run) -> Outcome:
    cost = None if run.cost is None else run.cost + run.cost_lost
    return Outcome(name, run.status, run.reason, run.tau, run.tokens, cost, run.seconds)


def _thin_out(folder: Path) -> None:
    """Deletes all but the files in `KEPT` from the folder of a finished run."""
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name not in KEPT:
            path.unlink()
