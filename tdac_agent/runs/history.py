"""Reads as much as possible of a run folder, even of a damaged one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

from tdac_agent.episodes.trajectory import Trajectory, nominal_first
from tdac_agent.errors import RunError
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.runs.ownership import load_task, remark_on
from tdac_agent.runs.rule_history import RuleChanges, rule_changes
from tdac_agent.runs.run_record import (
    AGENT,
    JOURNAL,
    RUN_FILE,
    Attempt,
    Run,
    at_work,
    candidate_at,
    load_rules,
    load_run,
    status_now,
)
from tdac_agent.storage.files import read_inside
from tdac_agent.storage.journal import read_records
from tdac_agent.storage.printable_record import load_record
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs.core.errors import TdacError

MOST_BYTES = 8 << 20
T = TypeVar("T")
_NO_MODELS = {
    "builtin": "no language model",
    AGENT: "an agent that submits controllers; tdac asked no model",
}
State = Literal["passed", "failed", "no code", "unfinished"]


@dataclass(frozen=True, slots=True)
class CandidateHistory:
    """A candidate (k, j) and its result.

    Attributes:
        k: Iteration.
        j: Edit; 0 for the Learner's code.
        folder: Folder of its files.
        state: Its result; `unfinished` if it was not judged.
        attempt: Its record, if it was judged.
        report: Its verification report, if there is a readable one.
        source: Its code, if there is any.
        diff: Unified diff from the previous candidate.
        learnt: Rules in force when it was written, and later changes to them.
        on_set: Whether it is for a task set.
        varies: Whether it is a variation of what works.
        author: Who wrote it, in words.
    """

    k: int
    j: int
    folder: Path
    state: State
    attempt: Attempt | None
    report: Report | None
    source: str | None
    diff: str
    learnt: RuleChanges
    on_set: bool = False
    varies: bool = False
    author: str = ""

    @property
    def failed(self) -> tuple[str, ...]:
        """The tests that it failed."""
        return self.attempt.failed_tests if self.attempt else ()

    def trajectories(self) -> Iterator[tuple[str, Trajectory]]:
        """Yields episode names and trajectories; skips damaged ones."""
        files = (self.folder / "trajectories").glob("*.npz")
        for path in sorted(files, key=nominal_first):
            try:
                yield path.stem.replace("_", " "), Trajectory.load(path)
            except RunError:
                continue


@dataclass(frozen=True, slots=True)
class RunHistory:
    """A run with everything that could be read from its folder.

    Attributes:
        run: Its record.
        status: Its present status; see `status_now`.
        task: Its task; None if it cannot be read, or for a task set.
        tried: Its candidates, oldest first.
        report: Report on the delivered controller, or else the last report.
        source: The delivered controller, or else the last candidate with
            code.
        book: Its rules.
        problems: What could not be read, one line each.
        foreign: Why its verdict is only a claim, after `this folder`; empty for an own
            run.
    """

    run: Run
    status: str
    task: Task | None
    tried: tuple[CandidateHistory, ...]
    report: Report | None
    source: str | None
    book: RuleBook
    problems: tuple[str, ...]
    foreign: str = ""


def learner_named(learner: str) -> str:
    """The name of a learner for display, with what it is if it is no model."""
    told = _NO_MODELS.get(learner)
    return learner if told is None else f"{learner} ({told})"


def gather_run(source: Path | Run) -> RunHistory:
    """Reads a run, even if it is damaged or still running.

    Args:
        source: Its folder, or its record.

    Raises:
        RunError: The folder has no readable `run.json`.
    """
    folder = source.folder if isinstance(source, Run) else source
    before, problems = at_work(folder), list[str]()
    run = source if isinstance(source, Run) else load_run(source)
    status = status_now(run, before=before)
    tried = tuple(_candidates(run, problems))
    reports = [one.report for one in tried if one.report is not None]
    sources = [one.source for one in tried if one.source is not None]
    report = verified_source = None
    if run.on_set and run.tau is not None:
        verified_source = read_text(folder, "controller.py")
    elif run.passed:
        report = _report(folder, "report.json", problems)
        verified_source = read_text(folder, "controller.py")
        if verified_source is None:
            problems.append("controller.py of the run is missing")
    return RunHistory(
        run,
        status,
        None if run.on_set else _try_to(problems, lambda: load_task(folder)),
        tried,
        report or (reports[-1] if reports else None),
        verified_source or (sources[-1] if sources else None),
        _try_to(problems, lambda: load_rules(folder)) or RuleBook(),
        tuple(dict.fromkeys(problems)),
        "" if before else remark_on(run).removeprefix(f"{folder} "),
    )


def run_folders(place: Path) -> list[Path]:
    """The run folders at or below a place, sorted by path.

    Raises:
        RunError: There is no such folder, or no run in it.
    """
    if not place.is_dir():
        raise RunError(f"there is no folder {place}")
    found = sorted(path.parent for path in place.rglob(RUN_FILE))
    if not found:
        raise RunError(f"there is no run at or below {place}: no file {RUN_FILE}")
    return found


def read_text(folder: Path, name: str, most: int = MOST_BYTES) -> str | None:
    """Reads text of a run leniently; None if it cannot be read or is too long."""
    try:
        return read_inside(folder, name, most).decode("utf-8", "replace")
    except OSError:
        return None


def _candidates(run: Run, problems: list[str]) -> Iterator[CandidateHistory]:
    """Yields the candidates on record, and those with a folder but no result."""
    learnt = rule_changes(read_records(run.folder / JOURNAL))
    judged = {(attempt.k, attempt.j): attempt for attempt in run.attempts}
    begun = {_numbers(path) for path in (run.folder / "iterations").glob("k*/j*")}
    for k, j in sorted({*judged, *begun} - {(0, 0)}):
        attempt = judged.get((k, j))
        at = candidate_at(k, j)
        folder = run.folder / at
        has_report = attempt is not None and attempt.valid and not attempt.unchanged
        has_report = has_report and not run.on_set
        yield CandidateHistory(
            k,
            j,
            folder,
            _state(attempt),
            attempt,
            _report(run.folder, f"{at}/report.json", problems) if has_report else None,
            read_text(run.folder, f"{at}/controller.py"),
            read_text(run.folder, f"{at}/controller.diff") or "",
            learnt.get((k, j), RuleChanges()),
            run.on_set,
            _varies(run, k),
            _author(run, k, j, attempt),
        )


def _numbers(folder: Path) -> tuple[int, int]:
    """(k, j) of a candidate's folder; (0, 0) for any other path."""
    k, j = folder.parent.name[1:], folder.name[1:]
    return (int(k), int(j)) if k.isdecimal() and j.isdecimal() else (0, 0)


def _varies(run: Run, k: int) -> bool:
    return run.improve > 0 and k > run.iterations


def _author(run: Run, k: int, j: int, attempt: Attempt | None) -> str:
    if _varies(run, k):
        return "a variation by the Optimizer"
    if run.learner == AGENT:
        return "submitted by the agent"
    if run.given_sha256 is not None and (k, j) == (1, 0):
        return "given at the start"
    if attempt is not None and attempt.parents:
        return "written by the Optimizer"
    return "edited by the Optimizer" if j else "written by the Learner"


def _state(attempt: Attempt | None) -> State:
    if attempt is None:
        return "unfinished"
    if not attempt.valid:
        return "no code"
    return "passed" if attempt.passed else "failed"


def _report(folder: Path, name: str, problems: list[str]) -> Report | None:
    try:
        return load_record(Report, folder, name)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "damaged"
        problems.append(f"{'/'.join((folder / name).parts[-4:])}: {reason}")
        return None


def _try_to(problems: list[str], read: Callable[[], T]) -> T | None:
    """The result of `read`, or None with its error added to `problems`."""
    try:
        return read()
    except (TdacError, OSError) as error:
        problems.append(str(error).partition("\n")[0])
        return None
