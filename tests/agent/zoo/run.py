"""Judges the whole zoo and prints a table; exit 1 where a verdict is not as expected.

python tests/agent/zoo/run.py [NAME ...]
"""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from queue import SimpleQueue

from enclosure import (
    ATTACKS,
    GOOD,
    Case,
    Enclosure,
    Result,
    differences,
    load_case,
    tiers_of,
    zoo_task,
)

WORKERS = 2


def main() -> int:
    """Returns the exit code."""
    chosen = set(sys.argv[1:])
    paths = [path for path in (*GOOD, *ATTACKS) if not chosen or path.stem in chosen]
    cases = [load_case(path) for path in paths]
    jobs = [(case, tier) for case in cases for tier in tiers_of(case)]
    zoo_task()
    began, wrong = time.monotonic(), 0
    with ExitStack() as stack, ThreadPoolExecutor(WORKERS) as pool:
        free: SimpleQueue[Enclosure] = SimpleQueue()
        for _ in range(WORKERS):
            free.put(stack.enter_context(Enclosure()))
        results = pool.map(lambda job: judge(free, *job), jobs)
        for (case, _), result in zip(jobs, results, strict=True):
            problems = differences(case, result)
            wrong += bool(problems)
            print(row(case, result, problems), flush=True)
            for problem in problems:
                print(f"    {problem[:600]}")
    seconds = time.monotonic() - began
    print(f"{len(cases)} controllers, {len(jobs)} verdicts, {wrong} not as expected")
    print(f"{seconds:.0f} s")
    return 1 if wrong else 0


def judge(free: SimpleQueue[Enclosure], case: Case, tier: str) -> Result:
    """Judges a case in an enclosure that is not in use."""
    enclosure = free.get()
    try:
        return enclosure.judge(case, tier)
    finally:
        free.put(enclosure)


def row(case: Case, result: Result, problems: list[str]) -> str:
    """One line of the table: file, tier, expected, got, seconds."""
    expected = "passed" if case.passes else "failed"
    got = "passed" if result.passed else "failed"
    mark = "  <-- not as expected" if problems else ""
    harm = f" harm: {', '.join(result.harm)}" if result.harm else ""
    kind = "good" if case.good else "attacks"
    return (
        f"{kind + '/' + case.name:40} {result.tier:11} {expected:7} {got:7} "
        f"{result.seconds:5.1f} s{harm}{mark}"
    )


if __name__ == "__main__":
    sys.exit(main())
