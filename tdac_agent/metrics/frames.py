"""Run records as tidy frames: one row per run, per iteration, per candidate."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from tdac_agent.errors import RunError
from tdac_agent.runs.run_record import Attempt, Run, load_run

RUN_COLUMNS = {
    "run": "Run folder, or another unique name.",
    "task": "Name of the task.",
    "learner": "LLM1, as given to `--learner`.",
    "optimizer": "LLM2, as given to `--optimizer`.",
    "prompt": "Template of the first prompt.",
    "K": "Maximum number of iterations.",
    "J": "Maximum number of edits per iteration.",
    "setting": "Parts of the loop in use; see `tdac_agent.runs.run_record.Setting`.",
    "seed": "Seed of the jittered starts if one was given, else the run's number.",
    "status": "Status in `run.json`.",
    "tau": "Iteration of the first success; missing if there was none.",
    "done": "Number of completed iterations, successful or not.",
    "censored": "Whether budget, time or a fault ended the run before success or K.",
    "tokens": "Tokens of all prompts and answers; missing if not counted.",
    "cost": "Cost, USD; missing if a price is unknown.",
    "seconds": "Wall time, s.",
}
CANDIDATE_COLUMNS = {
    "run": "As in `RUN_COLUMNS`.",
    "k": "Iteration, from 1.",
    "j": "Edit, from 1; 0 is the Learner's own answer.",
    "valid": "Whether the answer had a controller (the paper's set of valid pairs).",
    "passed": "Whether all of its tests passed.",
    "failed": "Number of failed tests; missing without a controller.",
}
Row = dict[str, object]


@dataclass(frozen=True, slots=True)
class RunFrames:
    """Runs and their candidates.

    Attributes:
        runs: A row per run, with `RUN_COLUMNS`.
        candidates: A row per candidate (k, j), with `CANDIDATE_COLUMNS`.
    """

    runs: pd.DataFrame
    candidates: pd.DataFrame

    def only(self, **columns: object) -> RunFrames:
        """Selects the runs whose columns have these values, and their candidates."""
        chosen = self.runs
        for name, value in columns.items():
            same = chosen[name].isna() if pd.isna(value) else chosen[name] == value
            chosen = chosen[same]
        kept = self.candidates["run"].isin(chosen["run"])
        return RunFrames(chosen, self.candidates[kept])


def find_runs(folder: Path) -> Iterator[Run]:
    """Yields the runs at or below a folder, sorted by path.

    Raises:
        RunError: There is no run, or one cannot be read.
    """
    folders = sorted(path.parent for path in folder.rglob("run.json"))
    if not folders:
        raise RunError(f"there is no run at or below {folder}: no file run.json")
    yield from map(load_run, folders)


def load_frames(*folders: Path) -> RunFrames:
    """Loads the runs at or below some folders.

    Raises:
        RunError: A folder has no run, or a run cannot be read.
    """
    return frames_of(run for folder in folders for run in find_runs(folder))


def frames_of(runs: Iterable[Run]) -> RunFrames:
    """Builds frames from run records; those of runs on task sets are left out.

    `set_frame_of` has these.
    """
    rows: list[Row] = []
    candidates: list[Row] = []
    for run in runs:
        if run.on_set:
            continue
        rows.append(_row(run))
        candidates += [_candidate(run, attempt) for attempt in run.of_loop]
    return _frames(rows, candidates)


def join_frames(*frames: RunFrames) -> RunFrames:
    """Joins several frames into one.

    Raises:
        RunError: No frames are given, or a run is in two of them.
    """
    if not frames:
        raise RunError("there are no runs to join")
    runs = pd.concat([each.runs for each in frames], ignore_index=True)
    _check_unique(runs)
    tried = pd.concat([each.candidates for each in frames], ignore_index=True)
    return RunFrames(runs, tried)


def _candidate(run: Run, attempt: Attempt) -> Row:
    return {
        "run": str(run.folder),
        "k": attempt.k,
        "j": attempt.j,
        "valid": attempt.valid,
        "passed": attempt.passed,
        "failed": len(attempt.failed_tests) if attempt.valid else None,
    }


def labels_of(run: Run) -> Row:
    """The columns that say what a run is, but for its seed."""
    return {
        "run": str(run.folder),
        "task": run.task,
        "learner": run.learner,
        "optimizer": run.optimizer,
        "prompt": run.prompt,
        "K": run.iterations,
        "J": run.patience,
        "setting": run.setting,
    }


def _row(run: Run) -> Row:
    tokens = run.tokens_in + run.tokens_out
    return {
        **labels_of(run),
        "seed": run.index if run.seed is None else run.seed,
        "status": run.status,
        "tau": run.tau,
        "done": _done(run),
        "censored": not run.finished and run.tau is None,
        "tokens": tokens or None,
        "cost": run.cost,
        "seconds": run.seconds,
    }


def _done(run: Run) -> int:
    """Number of completed iterations; those that began side by side end together."""
    done = 0
    for _, group in itertools.groupby(
        sorted({a.k for a in run.of_loop}), lambda k: (k - 1) // run.candidates
    ):
        ks = set(group)
        tried = [a for a in run.of_loop if a.k in ks]
        first = min(ks)
        size = min(run.candidates, run.iterations - first + 1)
        complete = len(ks) == size and all(not a.valid for a in tried if a.j == 0)
        if run.patience == 0:
            complete |= len(ks) == size
        edited = any(a.j == run.patience or not a.valid for a in tried if a.j > 0)
        if complete or edited or any(a.passed for a in tried):
            done += len(ks)
    return done


def frames_from_tau(
    tau: Sequence[int | None],
    most: int,
    *,
    ended: Sequence[int] = (),
    invalid: int = 0,
    **labels: str,
) -> RunFrames:
    """Builds frames of runs known only by their first success, as in a paper.

    Args:
        tau: Iteration of the first success of each run; None if it had none.
        most: K, the maximum number of iterations.
        ended: Number of iterations of each further run that budget, time or a fault
            ended without success.
        invalid: Number of iterations without a controller. They are assigned to the
            first iterations of the longest runs; no metric depends on which.
        labels: Values of columns such as `learner` and `task`.
    """
    left = invalid
    rows: list[Row] = []
    candidates: list[Row] = []
    known = sorted(tau, key=lambda t: -(t or most + 1))
    ends = [(first, first or most, False) for first in known]
    for number, (first, done, cut) in enumerate(
        [*ends, *((None, n, True) for n in ended)]
    ):
        run = f"{' '.join(labels.values())} {number + 1}"
        status = "passed" if first else "interrupted" if cut else "not verified"
        facts = {"run": run, "K": most, "status": status, "tau": first, "done": done}
        rows.append(dict.fromkeys(RUN_COLUMNS) | facts | {"censored": cut, **labels})
        for k in range(1, done + 1):
            passed = k == first
            valid = passed or left == 0
            left -= not valid
            failed = None if not valid else 0 if passed else 1
            candidate = (run, k, 0, valid, passed, failed)
            candidates.append(dict(zip(CANDIDATE_COLUMNS, candidate, strict=True)))
    return _frames(rows, candidates)


def iterations_of(candidates: pd.DataFrame) -> pd.DataFrame:
    """Groups candidates by iteration, the unit that the paper counts.

    Returns:
        A row per iteration: run, k, valid (a controller was generated), passed (one of
        its candidates passed), failed (tests that its last valid candidate failed, the
        paper's f), candidates (their number).
    """
    ordered = candidates.sort_values(["run", "k", "j"])
    grouped = ordered.groupby(["run", "k"], sort=False)
    return grouped.agg(
        valid=("valid", "any"),
        passed=("passed", "any"),
        failed=("failed", "last"),
        candidates=("j", "size"),
    ).reset_index()


def _frames(rows: list[Row], candidates: list[Row]) -> RunFrames:
    runs = pd.DataFrame(rows, columns=list(RUN_COLUMNS))
    runs = runs.astype(
        {"tau": "Int64", "done": "Int64", "K": "Int64", "censored": bool}
        | {"cost": float, "seconds": float, "tokens": "Int64"}
    )
    _check_unique(runs)
    tried = pd.DataFrame(candidates, columns=list(CANDIDATE_COLUMNS))
    types = {"k": int, "j": int, "valid": bool, "passed": bool, "failed": "Int64"}
    return RunFrames(runs, tried.astype(types))


def _check_unique(runs: pd.DataFrame) -> None:
    if runs["run"].duplicated().any():
        duplicate = runs["run"][runs["run"].duplicated()].iloc[0]
        raise RunError(f"the run {duplicate} occurs twice")
