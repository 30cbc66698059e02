"""Trains with other people's reinforcement-learning libraries for a few minutes.

python3 tools/clients [NAME ...] [--work DIR] [--timeout SECONDS]

Each library gets a virtual environment of its own. Prints a Markdown table for
`docs/clients.md`. A library that cannot be installed is "not run", with the reason; one
that fails does not stop the others. Exit 0 if none of them failed.

`CLEANRL=PATH` names CleanRL's `ppo_continuous_action.py`, which is used as it is.
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
        if options.work is None:
            shutil.rmtree(folder, ignore_errors=True)
        print(f"\n{table(outcomes)}", flush=True)
    return 1 if any(outcome.result == FAILED for outcome in outcomes) else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="tools/clients",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(LIBRARIES))
    parser.add_argument(
        "--work", type=Path, help="folder of the virtual environments, which is kept"
    )
    parser.add_argument(
        "--timeout", type=float, default=1800.0, help="of each training, seconds"
    )
    return parser.parse_args()


if __name__ == "__main__":
    # Threads of one training would only wait for those of another.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
