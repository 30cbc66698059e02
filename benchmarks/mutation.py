"""Mutation score of the shipped suite: the share of harmful mutants that it kills.

    python -m benchmarks.mutation [--kind map2d|epuck] [--sample N] [--seed S] [--json]
                                  [--resume FILE]

A mutant is a good controller with one change: a domain-specific mistake
(`domain_mutations`, `lies`) or an operator of cosmic-ray (`pip install ".[bench]"`).
*Killed*: `tdac_agent.verify` does not pass it. *Harmful*: an independent judge, with
separate oracles and starts, finds that it violates the contract, or that it succeeds on
less than 90 % of 50 jittered starts (e-puck: 20), all of which the original passes.

By default both kinds of task are measured. The whole run writes `results/mutation.csv`
and `.md`, and `results/mutation_epuck.csv` and `.md`; a sample only prints. Exit 1 if a
harmful mutant survives.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

from benchmarks.ground import GROUNDS, Ground
from benchmarks.independent_judge import IndependentJudge
from benchmarks.journal import Journal
from benchmarks.mutants import Mutant, Original, choose
from benchmarks.mutation_tables import write_csv, write_markdown
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import verify

LIMITS = Limits(import_seconds=4.0, reset_seconds=4.0, call_seconds=4.0, cpu_seconds=40)
RESULTS = Path(__file__).parent.parent / "results"


@dataclass(frozen=True, slots=True)
class Row:
    """The result for one mutant.

    Attributes:
        mutation: Name of the change.
        controller: Name of the original.
        profile: `policy` or `paper`.
        line: Number of the changed line.
        change: New text of the line.
        killed: Whether the suite failed it.
        killed_by: The first test that failed.
        harmful: Whether the independent judge finds it harmful.
        reason: Why it is harmful.
    """

    mutation: str
    controller: str
    profile: str
    line: int
    change: str
    killed: bool
    killed_by: str
    harmful: bool
    reason: str

    def __str__(self) -> str:
        fate = "killed" if self.killed else "SURVIVED" if self.harmful else "survived"
        by = f" by {self.killed_by}" if self.killed else ""
        harm = f"harmful: {self.reason[:90]}" if self.harmful else "harmless"
        place = f"{self.controller}:{self.line}"
        return f"{fate}{by} | {harm} | {self.mutation} | {place} | {self.change}"


@cache
def _task(kind: str) -> Task:
    return GROUNDS[kind].task()


@cache
def _warm_judge() -> WarmJudge:
    """The judge of this process; it ends with the process."""
    judge = WarmJudge()
    Finalize(None, judge.close, exitpriority=1)
    return judge


def _report(original: Original, text: str) -> Report:
    task, profile = _task(original.kind), original.profile
    return verify(
        text.encode(),
        task,
        profile=profile,
        seed=0,
        limits=LIMITS,
        judge=_warm_judge(),
    )


def _independent(kind: str) -> IndependentJudge:
    return IndependentJudge(GROUNDS[kind], _task(kind), LIMITS)


def examine(mutant: Mutant) -> dict[str, Any]:
    """Judges a mutant by the suite and the independent judge; a `Row` as a dict."""
    text, original = mutant.text, mutant.original
    report = _report(original, text)
    found = _independent(original.kind).judge(text, original.profile)
    line, change = mutant.change()
    row = Row(
        mutation=mutant.mutation,
        controller=original.name,
        profile=original.profile,
        line=line,
        change=change[:160],
        killed=not report.passed,
        killed_by=report.failures[0].test.partition("::")[2] if report.failures else "",
        harmful=bool(found.reason),
        reason=" ".join(found.reason.split())[:160],
    )
    return asdict(row)


def fault_of(original: Original) -> str:
    """Why a controller is not good on its task; empty if it passes everything."""
    report = _report(original, original.text)
    if not report.passed:
        failure = report.failures[0]
        return f"fails {failure.test}: {' '.join(failure.message.split())[:160]}"
    judge = _independent(original.kind)
    found = judge.judge(original.text, original.profile, all_seeds=True)
    failed = f"fails {found.failed} of {found.tried} starts"
    return found.reason or (failed if found.failed else "")


def main() -> int:
    """Returns the exit code."""
    options = _options()
    kinds = [options.kind] if options.kind else list(GROUNDS)
    with ProcessPoolExecutor(options.workers) as pool:
        survivors = sum(measure(kind, options, pool) for kind in kinds)
    return 1 if survivors else 0


def measure(kind: str, options: argparse.Namespace, pool: ProcessPoolExecutor) -> int:
    """Examines a kind of task's mutants; returns how many harmful ones survive."""
    ground, task, began = GROUNDS[kind], _task(kind), time.monotonic()
    journal = Journal(options.resume, task.dynamics())
    candidates = ground.originals(task)
    faults = list(journal.answers(pool, fault_of, candidates))
    left_out = {c.name: f for c, f in zip(candidates, faults, strict=True) if f}
    originals = [item for item in candidates if item.name not in left_out]
    for name, fault in left_out.items():
        print(f"left out: {name}: {fault}", file=sys.stderr)
    rows = []
    mutants = choose(originals, *_shares(ground, options.sample), options.seed)
    for answer in journal.answers(pool, examine, mutants):
        rows.append(Row(**answer))
        if not options.json:
            print(f"{len(rows):4} {rows[-1]}", flush=True)
    if options.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
    survivors = [row for row in rows if row.harmful and not row.killed]
    for row in survivors:
        print(row, file=sys.stderr)
    harmful = sum(row.harmful for row in rows)
    print(
        f"{kind}: {len(rows)} mutants of {len(originals)} controllers: {harmful} "
        f"harmful, {harmful - len(survivors)} of these killed, {len(survivors)} "
        f"survived; {time.monotonic() - began:.0f} s",
        file=sys.stderr,
    )
    if options.sample is None:
        RESULTS.mkdir(exist_ok=True)
        names, file = [item.name for item in originals], RESULTS / ground.results
        write_csv(file.with_suffix(".csv"), rows)
        table = file.with_suffix(".md")
        write_markdown(table, kind, rows, names, left_out, ground.seeds)
    return len(survivors)


def _shares(ground: Ground, sample: int | None) -> tuple[int, int]:
    """Numbers of domain-specific mutants and of cosmic-ray's."""
    whole = ground.domain + ground.syntactic
    count = whole if sample is None else sample
    syntactic = count * ground.syntactic // whole
    return count - syntactic, syntactic


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="benchmarks.mutation", description=about)
    parser.add_argument("--kind", choices=GROUNDS, help="only this kind of task")
    parser.add_argument("--sample", type=int, help="number of mutants")
    parser.add_argument("--seed", type=int, default=1, help="seed of the sample")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument(
        "--resume", type=Path, help="journal; recorded results are not computed again"
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
