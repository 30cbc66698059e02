"""Runs a short training with each of several reinforcement-learning libraries.

python3 tools/clients [NAME ...] [--work DIR] [--timeout SECONDS]

Each library is installed in its own virtual environment. The program prints a Markdown
table. A library that cannot be installed is "not run", with the reason; the others
still run if one fails. The exit code is 0 if none of them failed.

The environment variable `CLEANRL=PATH` names CleanRL's `ppo_continuous_action.py`,
which is used unmodified.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

from attempt import FAILED, attempt
from libraries import LIBRARIES
from table import table


def main() -> int:
    """Tries the selected libraries; returns 1 if one of them failed."""
    options = _options()
    unknown = set(options.names) - LIBRARIES.keys()
    if unknown:
        known = ", ".join(LIBRARIES)
        sys.exit(f"unknown library {min(unknown)!r}; expected some of {known}")
    folder = options.work or Path(tempfile.mkdtemp(prefix="tdac-clients-"))
    folder.mkdir(parents=True, exist_ok=True)
    outcomes = []
    try:
        for name in options.names or LIBRARIES:
            print(f"== {name}", flush=True)
            library = LIBRARIES[name]
            found = attempt(name, library, folder.resolve(), options.timeout)
            outcomes.append(found)
            print(f"{found.result}: {found.said}", flush=True)
    finally:
        print(f"\n{table(outcomes)}", flush=True)
        if options.work is None:
            shutil.rmtree(folder, ignore_errors=True)
    return 1 if any(outcome.result == FAILED for outcome in outcomes) else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="tools/clients",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(LIBRARIES))
    parser.add_argument(
        "--work", type=Path, help="folder for the virtual environments; it is kept"
    )
    parser.add_argument(
        "--timeout", type=float, default=1800.0, help="time limit of each training, s"
    )
    return parser.parse_args()


if __name__ == "__main__":
    # One thread is faster for small networks.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
