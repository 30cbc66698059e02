"""The first `tdac synth` on a machine: CPU time with an empty cache, and per kernel.

Part of `python -m benchmarks start_up`. Each round copies both packages, so that
nothing is compiled, and runs the command twice. As a program, this module runs `tdac`
with its arguments and writes what was compiled: `python -m benchmarks.first_run FILE
synth`.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.timing import Bench, Effort, compared

ROOT = Path(__file__).parents[1]
FIRST, SECOND = "tdac synth, empty cache", "tdac synth, cached"
COMPILING = "all kernels"
LIMITS = {FIRST: 40.0}


def first_runs(effort: Effort) -> list[Bench]:
    """One bench; none if the effort is quick, since there is no smaller first run."""
    if effort.quick:
        return []
    times: dict[str, list[float]] = {}
    for _ in range(effort.rounds_of(3)):
        for case, seconds in _round().items():
            times.setdefault(case, []).append(seconds)
    title = "First run, CPU time of all processes; kernels with what they call first"
    notes = {SECOND: "a process of its own compiles nothing"}
    return [compared(title, times, SECOND, FIRST, LIMITS, notes)]


def _round() -> dict[str, float]:
    """CPU seconds of two runs with an empty cache, and of each kernel in the first."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for package in ("tdac_envs", "tdac_agent"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / package, folder / package, ignore=ignored)
        first, second = (_cpu_seconds(folder, f"{n}.json") for n in (1, 2))
        kernels = json.loads((folder / "1.json").read_text(encoding="utf-8"))
        again = json.loads((folder / "2.json").read_text(encoding="utf-8"))
    assert not again, f"compiled for the second time: {', '.join(again)}"
    total = sum(kernels.values())
    slowest = sorted(kernels.items(), key=lambda item: -item[1])
    return {FIRST: first, SECOND: second, COMPILING: total, **dict(slowest)}


def _cpu_seconds(folder: Path, report: str) -> float:
    """CPU time of `tdac synth` and its processes, with the packages of a folder."""
    path = os.pathsep.join(map(str, (folder, ROOT)))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-P", "-m", "benchmarks.first_run", report, "synth"],
        check=True,
        capture_output=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path, "XDG_CACHE_HOME": str(folder)},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _run(report: Path, words: list[str]) -> int:
    """Runs `tdac`; writes the CPU seconds that each kernel took to compile."""
    from numba.core import event

    from tdac_agent.__main__ import main

    taken: dict[str, float] = {}
    begun: list[float] = []

    class Listener(event.Listener):  # type: ignore[misc]
        """Times the kernels; what they call is compiled in between."""

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            begun.append(time.process_time())

        def on_end(self, event: Any) -> None:
            seconds = time.process_time() - begun.pop()
            if not begun:
                function = event.data["dispatcher"].py_func
                name = f"{function.__module__}.{function.__name__}"
                name = name.removeprefix("tdac_envs.")
                taken[name] = taken.get(name, 0.0) + seconds

    event.register("numba:compile", Listener())
    sys.argv[1:] = words
    try:
        main()
        return 0
    finally:
        report.write_text(json.dumps(taken), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(_run(Path(sys.argv[1]), sys.argv[2:]))
