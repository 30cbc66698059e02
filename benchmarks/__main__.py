"""Runs the benches at their real sizes.

    python -m benchmarks [NAME …] [--rounds N] [--maps DIR] [--json] [--profile]

Without names it runs all of them. Every bench times its floor and its reference in the
same run, in turns; only the ratios carry over to other machines. `--quick` only checks
that the benches work, on toy sizes. `--profile` prints where the CPU time of each bench
goes, including that of its threads, instead.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from benchmarks.timing import Bench, Effort, Row, duration, show, whole_from_one

NAMES = (
    "env_step",
    "epuck_step",
    "movers",
    "peers",
    "preprocessing",
    "planning",
    "start_up",
    "set_judge",
)
PROFILED = 25
"""Number of lines in a profile."""


def main() -> int:
    """Returns the exit code: 1 if a case exceeds its time limit."""
    options = _options()
    chosen = {name: _bench(name, options) for name in options.names or NAMES}
    if options.profile:
        for name, run in chosen.items():
            _profile(name, run)
        return 0
    found: dict[str, Sequence[Bench]] = {}
    if not options.json:
        print(_machine())
    for name, run in chosen.items():
        found[name] = run()
        if not options.json:
            for bench in found[name]:
                show(bench)
    if options.json:
        every = {name: [asdict(b) for b in benches] for name, benches in found.items()}
        print(json.dumps({"machine": _machine(), **every}, indent=1))
    late = [row for benches in found.values() for b in benches for row in _late(b)]
    for row in late:
        times = f"{duration(row.fastest)}, limit {duration(row.limit or 0.0)}"
        print(f"too slow: {row.case}: {times}", file=sys.stderr)
    return 1 if late else 0


def _bench(name: str, options: argparse.Namespace) -> Callable[[], Sequence[Bench]]:
    benches = import_module(f"benchmarks.{name}").benches
    effort = Effort(options.quick, options.rounds)
    if name == "planning":
        return partial(benches, effort, options.maps)
    return partial(benches, effort)


def _profile(name: str, run: Callable[[], object]) -> None:
    import yappi

    # The standard library's profiler covers only one thread.
    yappi.set_clock_type("cpu")
    with yappi.run(builtins=True):
        run()
    calls = sorted(yappi.get_func_stats(), key=lambda call: -call.tsub)[:PROFILED]
    yappi.clear_stats()
    table = Table("function", title=name, title_justify="left", box=SIMPLE)
    for heading in ("calls", "own, s", "with calls, s"):
        table.add_column(heading, justify="right")
    for call in calls:
        own, whole = f"{call.tsub:.3f}", f"{call.ttot:.3f}"
        table.add_row(_place(call), str(call.ncall), own, whole)
    Console().print(table)


def _place(call: Any) -> str:
    """File, line and name of a function; functions outside Python have no line."""
    file = Path(call.module).name
    return escape(f"{file}:{call.lineno} {call.name}" if call.lineno else call.name)


def _late(bench: Bench) -> list[Row]:
    """The rows whose fastest time exceeds their limit."""
    return [row for row in bench.rows if row.limit and row.fastest > row.limit]


def _machine() -> str:
    load = os.getloadavg()[0]
    return (
        f"{os.cpu_count()} cores, load {load:.1f}, {platform.machine()}, "
        f"Python {platform.python_version()}"
    )


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=about)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"one of {', '.join(NAMES)}"
    )
    parser.add_argument("--maps", type=Path, help="folder of MovingAI maps with .scen")
    parser.add_argument("--rounds", type=whole_from_one, help="rounds for every case")
    parser.add_argument("--quick", action="store_true", help="toy sizes, one round")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--profile", action="store_true", help="profile the benches")
    options = parser.parse_args()
    wrong = sorted(set(options.names) - set(NAMES))
    if wrong:
        parser.error(f"no bench {wrong[0]!r}; there are {', '.join(NAMES)}")
    if options.maps is not None and not any(options.maps.glob("*.map.scen")):
        parser.error(f"{options.maps}: no *.map.scen in it")
    for package in ("skimage", "yappi"):
        if find_spec(package) is None:
            parser.error(f'{package} is missing: pip install ".[bench]"')
    return options


if __name__ == "__main__":
    sys.exit(main())
