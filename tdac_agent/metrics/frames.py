"""Run records as tidy frames: one row per run, per iteration, per candidate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from tdac_agent.errors import RunError
from tdac_agent.runs.records import Attempt, Run, load_run

RUN_COLUMNS = {
    "run": "Its folder, or another name that no other run has.",
    "task": "Name of the task.",
    "learner": "LLM1, as named for `--learner`.",
    "optimizer": "LLM2.",
    "prompt": "Template of the first question.",
    "K": "Most iterations.",
    "J": "Edits per iteration.",
    "setting": "What of the loop was in use, as in `tdac_agent.runs.records.Setting`.",
    "seed": "Of the jittered starts where it was given, else the number of the run.",
    "status": "As in `run.json`.",
    "tau": "Iteration of the first success; missing where there was none.",
    "done": "Iterations that were judged to their end, with success or without.",
    "censored": "Whether money, time or a fault ended it before success or K.",
    "tokens": "Of all questions and answers; missing where nobody counted.",
    "cost": "USD; missing where a price is unknown.",
    "seconds": "Wall time.",
}
CANDIDATE_COLUMNS = {
    "run": "As above.",
    "k": "Iteration, from 1.",
    "j": "Edit, 0 for what the Learner wrote.",
    "valid": "Whether there was a controller; the paper's set of valid pairs.",
    "passed": "Whether all of its tests passed.",
    "failed": "Number of failed tests; missing where there was no controller.",
}
Row = dict[str, object]


@dataclass(frozen=True, slots=True)
class Frames:
    """What is known of some runs.

    Attributes:
        runs: A row per run, with `RUN_COLUMNS`.
        candidates: A row per candidate (k, j), with `CANDIDATE_COLUMNS`.
    """

    runs: pd.DataFrame
    candidates: pd.DataFrame

    def only(self, **columns: object) -> Frames:
        """The runs whose columns have these values, and their candidates."""
        chosen = self.runs
        for name, value in columns.items():
            chosen = chosen[chosen[name] == value]
        kept = self.candidates["run"].isin(chosen["run"])
        return Frames(chosen, self.candidates[kept])


def find_runs(folder: Path) -> Iterator[Run]:
    """The runs at or below a folder, in the order of their names.

    Raises:
        RunError: There is none, or one cannot be read.
    """
    found = sorted(path.parent for path in folder.rglob("run.json"))
    if not found:
        raise RunError(f"there is no run at or below {folder}: no file run.json")
    yield from map(load_run, found)


def load_frames(*folders: Path) -> Frames:
    """The runs at or below some folders.

    Raises:
        RunError: There is none in one of them, or one cannot be read.
    """
    return frames_of(run for folder in folders for run in find_runs(folder))


def frames_of(runs: Iterable[Run]) -> Frames:
    """Frames of run records."""
    rows: list[Row] = []
    candidates: list[Row] = []
    for run in runs:
        rows.append(_row(run))
        candidates += [_candidate(run, attempt) for attempt in run.attempts]
    return _frames(rows, candidates)


def join_frames(*frames: Frames) -> Frames:
    """The runs of several frames in one.

    Raises:
        RunError: There are none, or a run is in two of them.
    """
    if not frames:
        raise RunError("there are no runs to join")
    runs = pd.concat([each.runs for each in frames], ignore_index=True)
    _check_unique(runs)
    tried = pd.concat([each.candidates for each in frames], ignore_index=True)
    return Frames(runs, tried)


def _candidate(run: Run, attempt: Attempt) -> Row:
    return {
        "run": str(run.folder),
        "k": attempt.k,
        "j": attempt.j,
        "valid": attempt.valid,
        "passed": attempt.passed,
        "failed": len(attempt.failed_tests) if attempt.valid else None,
    }


def _row(run: Run) -> Row:
    last: dict[int, tuple[int, bool, bool]] = {
        a.k: (a.j, a.valid, a.passed) for a in run.attempts
    }
    done = sum(
        passed or not valid or j == run.patience for j, valid, passed in last.values()
    )
    tokens = run.tokens_in + run.tokens_out
    return {
        "run": str(run.folder),
        "task": run.task,
        "learner": run.learner,
        "optimizer": run.optimizer,
        "prompt": run.prompt,
        "K": run.iterations,
        "J": run.patience,
        "setting": run.setting,
        "seed": run.index if run.seed is None else run.seed,
        "status": run.status,
        "tau": run.tau,
        "done": done,
        "censored": not run.finished,
        "tokens": tokens or None,
        "cost": run.cost,
        "seconds": run.seconds,
    }


def frames_from_tau(
    tau: Sequence[int | None],
    most: int,
    *,
    ended: Sequence[int] = (),
    invalid: int = 0,
    **labels: str,
) -> Frames:
    """Frames of runs of which only the first successes are known, as in a paper.

    Args:
        tau: Iteration of the first success of each run, None where there was none.
        most: K.
        ended: Iterations of further runs that money, time or a fault ended without
            success.
        invalid: How many of the iterations gave no controller; they are taken to be
            the first ones of the longest runs, which no metric depends on.
        labels: Columns such as `learner` and `task`.
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
        status = "verified" if first else "interrupted" if cut else "not verified"
        about = {"run": run, "K": most, "status": status, "tau": first, "done": done}
        rows.append(dict.fromkeys(RUN_COLUMNS) | about | {"censored": cut, **labels})
        for k in range(1, done + 1):
            passed = k == first
            valid = passed or left == 0
            left -= not valid
            failed = None if not valid else 0 if passed else 1
            candidate = (run, k, 0, valid, passed, failed)
            candidates.append(dict(zip(CANDIDATE_COLUMNS, candidate, strict=True)))
    return _frames(rows, candidates)


def iterations_of(candidates: pd.DataFrame) -> pd.DataFrame:
    """A row per iteration: what the paper counts, edits being part of it.

    Returns:
        Columns run, k, valid (a controller was generated), passed (one of its
        candidates passed), failed (tests that its last valid candidate failed, the
        paper's f), candidates (how many there were).
    """
    ordered = candidates.sort_values(["run", "k", "j"])
    grouped = ordered.groupby(["run", "k"], sort=False)
    return grouped.agg(
        valid=("valid", "any"),
        passed=("passed", "any"),
        failed=("failed", "last"),
        candidates=("j", "size"),
    ).reset_index()


def _frames(rows: list[Row], candidates: list[Row]) -> Frames:
    runs = pd.DataFrame(rows, columns=list(RUN_COLUMNS))
    runs = runs.astype(
        {"tau": "Int64", "done": "Int64", "K": "Int64", "censored": bool}
        | {"cost": float, "seconds": float, "tokens": "Int64"}
    )
    _check_unique(runs)
    tried = pd.DataFrame(candidates, columns=list(CANDIDATE_COLUMNS))
    types = {"k": int, "j": int, "valid": bool, "passed": bool, "failed": "Int64"}
    return Frames(runs, tried.astype(types))


def _check_unique(runs: pd.DataFrame) -> None:
    if runs["run"].duplicated().any():
        again = runs["run"][runs["run"].duplicated()].iloc[0]
        raise RunError(f"the run {again} is there twice")
