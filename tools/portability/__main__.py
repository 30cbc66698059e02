"""Runs the checks on simulated other machines, and prints a table of the results.

python3 tools/portability [ROW ...] [--work DIR] [--command COMMAND]

Without rows it runs all of them. Exit 0 if every row that could run passed.
"""

from __future__ import annotations

import argparse
import shlex
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

from place import ROOT, Place
from rows import ROWS, drawn
from table import FAILED, attempt, told

DRAWN = "drawn"


def main() -> int:
    """Runs the selected rows; returns 1 if one of them failed."""
    options = _options()
    commit = _last_commit() if DRAWN in options.rows else ""
    names = _names(options.rows, commit)
    folder = options.work or Path(tempfile.mkdtemp(prefix="tdac-portability-"))
    folder.mkdir(parents=True, exist_ok=True)
    place = Place(folder.resolve(), shlex.split(options.command), commit)
    outcomes = []
    try:
        for name in names:
            row = ROWS[name]
            print(f"\n== {name}: {row.what}", flush=True)
            outcomes.append(attempt(name, row.what, partial(row.run, place)))
    finally:
        if options.work is None:
            shutil.rmtree(folder, ignore_errors=True)
        print(f"\n{told(outcomes)}", flush=True)
    return 1 if any(outcome.result == FAILED for outcome in outcomes) else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/portability", description=__doc__)
    parser.add_argument(
        "rows", nargs="*", metavar="ROW", help=f"{', '.join(ROWS)}, {DRAWN}"
    )
    parser.add_argument(
        "--work",
        type=Path,
        help="working folder, which is kept; its contents are reused",
    )
    parser.add_argument("--command", default="make test", help="for temporary and busy")
    return parser.parse_args()


def _names(wanted: list[str], commit: str) -> list[str]:
    """The rows to run; exits if one is unknown."""
    names = [_drawn(commit) if name == DRAWN else name for name in wanted or ROWS]
    if unknown := [name for name in names if name not in ROWS]:
        sys.exit(f"no row {unknown[0]!r}; there are {', '.join(ROWS)}")
    return names


def _last_commit() -> str:
    command = ["git", "rev-parse", "HEAD"]
    return subprocess.check_output(command, cwd=ROOT, text=True).strip()


def _drawn(commit: str) -> str:
    """The row selected by the hash of the last commit."""
    name = drawn(commit)
    out = ", ".join(other for other in ROWS if not ROWS[other].drawn)
    print(f"drawn by {commit[:12]}: {name} (not in the draw: {out})", flush=True)
    return name


if __name__ == "__main__":
    sys.exit(main())
