"""Mutation score of the shipped suite: of the harmful mutants, how many it kills.

    python -m benchmarks.mutation [--sample N] [--seed S] [--json] [--resume FILE]

Mutants of good controllers get one change each: a mistake of the domain
(`domain_mutations`, `lies`) or an operator of cosmic-ray (`pip install "tdac[bench]"`).
*Killed*: `tdac_agent.verify` does not pass it. *Harmful*: an independent judge, with
oracles and starts of its own, finds that it violates the contract, or that it succeeds
on less than 90 % of 50 jittered starts, where the original succeeds on all of them.

The whole run writes `results/mutation.csv` and `results/mutation.md`; a sample only
prints. Exit 1 where a harmful mutant survives.
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

from benchmarks.ground import good_controllers, small_task
from benchmarks.independent_judge import SEEDS, IndependentJudge
from benchmarks.journal import Journal
from benchmarks.mutants import Mutant, Original, choose
from benchmarks.mutation_tables import write_csv, write_markdown
from tdac_agent.report import Report
from tdac_agent.sandbox import Limits
from tdac_agent.task import Task
from tdac_agent.task_file import Profile
from tdac_agent.verification import verify
from tdac_agent.warm import WarmJudge

DOMAIN_MUTANTS, SYNTACTIC_MUTANTS = 205, 105
LIMITS = Limits(import_seconds=4.0, reset_seconds=4.0, call_seconds=4.0, cpu_seconds=40)
RESULTS = Path(__file__).parent.parent / "results"


@dataclass(frozen=True, slots=True)
class Row:
    """What became of one mutant.

    Attributes:
        mutation: Name of the change.
        controller: What was changed.
        profile: `policy` or `paper`.
        line: Number of the changed line.
        change: What the line became.
        killed: Whether the suite failed it.
        killed_by: The first test that failed.
        harmful: Whether the independent judge objects.
        reason: Why it does.
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
def _task() -> Task:
    return small_task()


@cache
def _warm_judge() -> WarmJudge:
    """One for each process of the pool; it ends with the process."""
    judge = WarmJudge()
    Finalize(None, judge.close, exitpriority=1)
    return judge


def _report(text: str, profile: Profile) -> Report:
    source, judge = text.encode(), _warm_judge()
    return verify(source, _task(), profile=profile, limits=LIMITS, judge=judge)


def examine(mutant: Mutant) -> dict[str, Any]:
    """Asks the suite and the independent judge about a mutant; a `Row` as a dict."""
    text, profile = mutant.text, mutant.original.profile
    report = _report(text, profile)
    found = IndependentJudge(_task(), LIMITS).judge(text, profile)
    line, change = mutant.change()
    row = Row(
        mutation=mutant.mutation,
        controller=mutant.original.name,
        profile=profile,
        line=line,
        change=change[:160],
        killed=not report.passed,
        killed_by=report.failures[0].test.partition("::")[2] if report.failures else "",
        harmful=bool(found.reason),
        reason=" ".join(found.reason.split())[:160],
    )
    return asdict(row)


def fault_of(original: Original) -> str:
    """Why a controller is not good on this task; empty where it passes everything."""
    text, profile = original.text, original.profile
    report = _report(text, profile)
    if not report.passed:
        failure = report.failures[0]
        return f"fails {failure.test}: {' '.join(failure.message.split())[:160]}"
    found = IndependentJudge(_task(), LIMITS).judge(text, profile, all_seeds=True)
    failed = f"fails {found.failed} of {found.tried} starts"
    return found.reason or (failed if found.failed else "")


def main() -> int:
    """Returns the exit code."""
    options = _options()
    began = time.monotonic()
    whole = DOMAIN_MUTANTS + SYNTACTIC_MUTANTS
    count = whole if options.sample is None else options.sample
    syntactic = count * SYNTACTIC_MUTANTS // whole
    journal = Journal(options.resume, _task().sha256())
    with ProcessPoolExecutor(options.workers) as pool:
        candidates = good_controllers(_task())
        faults = list(journal.answers(pool, fault_of, candidates))
        left_out = {c.name: f for c, f in zip(candidates, faults, strict=True) if f}
        originals = [item for item in candidates if item.name not in left_out]
        for name, fault in left_out.items():
            print(f"left out: {name}: {fault}", file=sys.stderr)
        mutants = choose(originals, count - syntactic, syntactic, options.seed)
        rows = []
        for answer in journal.answers(pool, examine, mutants):
            rows.append(Row(**answer))
            if not options.json:
                print(f"{len(rows):4} {rows[-1]}", flush=True)
    if options.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
    harmful = [row for row in rows if row.harmful]
    survivors = [row for row in harmful if not row.killed]
    for row in survivors:
        print(row, file=sys.stderr)
    print(
        f"{len(rows)} mutants of {len(originals)} controllers: {len(harmful)} harmful, "
        f"{len(harmful) - len(survivors)} of these killed, {len(survivors)} survived; "
        f"{time.monotonic() - began:.0f} s",
        file=sys.stderr,
    )
    if options.sample is None:
        RESULTS.mkdir(exist_ok=True)
        write_csv(RESULTS / "mutation.csv", rows)
        names = [item.name for item in originals]
        write_markdown(RESULTS / "mutation.md", rows, names, left_out, len(SEEDS))
    return 1 if survivors else 0


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="benchmarks.mutation", description=about)
    parser.add_argument("--sample", type=int, help="only so many mutants")
    parser.add_argument("--seed", type=int, default=1, help="of the choice of mutants")
    parser.add_argument("--json", action="store_true", help="print rows as JSON")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument(
        "--resume", type=Path, help="journal; what it answers is not asked again"
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
