"""Runs the benches at their real sizes.

    python -m benchmarks [NAME …] [--rounds N] [--maps DIR] [--json] [--profile]

Without names, all of them. Every bench times its floor and what it is compared with
in the same run, in turns; only the ratios carry over to another machine. `--quick`
shows that all of it works, on sizes that say nothing. `--profile` prints instead
where the CPU time of each bench goes, that of its threads, too.
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

NAMES = ("env_step", "epuck_step", "peers", "preprocessing", "planning", "start_up")
PROFILED = 25
"""Lines of a profile."""


def main() -> int:
    """Returns the exit code: 1 where something takes longer than it should."""
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
        told = f"{duration(row.fastest)}, limit {duration(row.limit or 0.0)}"
        print(f"too slow: {row.case}: {told}", file=sys.stderr)
    return 1 if late else 0


def _bench(name: str, options: argparse.Namespace) -> Callable[[], Sequence[Bench]]:
    benches = import_module(f"benchmarks.{name}").benches
    effort = Effort(options.quick, options.rounds)
    if name == "planning":
        return partial(benches, effort, options.maps)
    return partial(benches, effort)


def _profile(name: str, run: Callable[[], object]) -> None:
    import yappi

    # The standard library's profiler sees one thread alone.
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
    """Where a function is; one that is not Python's has no line."""
    file = Path(call.module).name
    return escape(f"{file}:{call.lineno} {call.name}" if call.lineno else call.name)


def _late(bench: Bench) -> list[Row]:
    """The rows that take longer than they should even at best."""
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
        "names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}"
    )
    parser.add_argument("--maps", type=Path, help="folder of MovingAI maps and .scen")
    parser.add_argument(
        "--rounds", type=whole_from_one, help="turns that the cases take"
    )
    parser.add_argument("--quick", action="store_true", help="toy sizes, one round")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--profile", action="store_true", help="print profiles")
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
