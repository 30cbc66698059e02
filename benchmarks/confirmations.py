"""How many controllers of a known success rate the judge calls verified.

    python -m benchmarks.confirmations [--each 20] [--number 0] [--first 0]

The built-in controller of a small room fails on purpose in a share of its drives, which
the start decides; so its success rate is known, up to its own failures, which the row
of 0 % shows. All drives are real ones in the sandbox. Only the blind drives are judged:
the six drives of a suite would let 97 % of those at 99.5 % pass.

Wanted of 200 controllers: at most 5 % verified of those below 95 %, at least 80 % of
those at 99.5 %, and in each row a count that the exact probability explains. Most
controllers are close to the two limits (94 % and 99.5 %), where a fault would show.
About 11,000 drives, which take less than 30 minutes on two cores. `--first 1000` has
other controllers than `--first 0`.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import binomtest

from tdac_agent import load_task
from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.metrics.exact import exact_interval
from tdac_agent.tasks.task import Task
from tdac_agent.verification.confirmation import confirm
from tdac_agent.verification.judge.confirming import LEAST, confirming_test
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verdict import is_verified

SHARES = {0.0: 1, 0.005: 3, 0.03: 1, 0.06: 3, 0.1: 1, 0.4: 1}
"""Shares of drives in which a controller fails on purpose, with their weights."""
MOST_WRONG, LEAST_RIGHT = 0.05, 0.8
"""Share verified of those below 95 % at most, of those at 99.5 % at least."""
UNLIKELY = 0.001
"""Probability below which a count contradicts the exact one."""
RUN = 40
"""Confirmations of a run whose errors are summed; further ones add nothing."""
ON_PURPOSE = """

import hashlib

_drive, _begun = policy, []


def policy(obs):
    if not _begun:
        _begun.append(True)
        start = hashlib.sha256(obs["pose"].tobytes() + b"{salt}").digest()
        if int.from_bytes(start[:4], "big") < {share} * 2**32:
            raise ValueError("on purpose")
    return _drive(obs)
"""


@dataclass(slots=True)
class Row:
    """What became of controllers that fail on purpose in a share of their drives."""

    share: float
    controllers: int
    drives: int = 0
    failed: int = 0
    verified: int = 0

    def told(self, expected: float) -> tuple[str, ...]:
        """The cells of its row of the table."""
        low, high = exact_interval(self.verified, self.controllers)
        counts = self.controllers, self.drives, self.failed, self.verified
        between = f"{low:.3f} to {high:.3f}"
        return f"{100 * self.share:g} %", *map(str, counts), between, f"{expected:.3f}"


def main() -> int:
    """Returns 1 if too many or too few are called verified."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=20, help="controllers per weight")
    parser.add_argument("--number", type=int, default=0, help="of the confirmation")
    parser.add_argument("--first", type=int, default=0, help="the first controller")
    options = parser.parse_args()
    columns = "fails on purpose", "controllers", "drives", "failed", "verified"
    table = Table(*columns, "95 % interval of its share", "exact")
    test = confirming_test(options.number)
    rows = [Row(share, options.each * weight) for share, weight in SHARES.items()]
    with tempfile.TemporaryDirectory() as folder, WarmJudge() as judge:
        task = small_room(Path(folder))
        for row in rows:
            drive(row, task, options.number, judge, options.first)
            table.add_row(*row.told(test.characteristics(1.0 - row.share).accepted))
    console = Console()
    console.print(table)
    tests = map(confirming_test, range(1, RUN))
    error = sum(each.characteristics(LEAST).accepted for each in tests)
    console.print(f"all confirmations of a run accept 95 % with at most {error:.4f}")
    wrong = problems(rows, options.number)
    console.print("\n".join(wrong) or "as wanted")
    return int(bool(wrong))


def drive(row: Row, task: Task, number: int, judge: WarmJudge, first: int) -> None:
    """Has the controllers of a row, from `first` on, drive blind, and counts."""
    for salt in range(first, first + row.controllers):
        source = failing(task, row.share, salt)
        found = confirm(source, task, number, judge=judge)
        row.drives += found.count
        row.failed += found.count - found.successes
        row.verified += is_verified(found)


def problems(rows: list[Row], number: int) -> list[str]:
    """What is not as wanted."""
    found, test = [], confirming_test(number)
    low = [row for row in rows if 1.0 - row.share < LEAST]
    wrong, tried = sum(e.verified for e in low), sum(e.controllers for e in low)
    if wrong > MOST_WRONG * tried:
        found.append(f"{wrong} of {tried} below 95 % are called verified")
    for row in rows:
        if row.share <= 0.005 and row.verified < LEAST_RIGHT * row.controllers:
            found.append(f"only {row.verified} at {1.0 - row.share:.3f} are verified")
        expected = test.characteristics(1.0 - row.share).accepted
        chance = binomtest(row.verified, row.controllers, expected).pvalue
        if row.share and chance < UNLIKELY:
            told = f"{row.verified} of {row.controllers} at {1.0 - row.share:.3f}"
            found.append(f"{told}, expected a share of {expected:.3f}")
    return found


def small_room(folder: Path) -> Task:
    """A task of few steps: a room of 160 x 120 px with a wall in it."""
    cells = np.zeros((120, 160), np.bool_)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = True
    cells[:80, 70:76] = True
    np.save(folder / "map.npy", cells)
    (folder / "task.yaml").write_text(
        "schema: 1\nname: room\nmap: map.npy\nrobot: {radius: 6}\nhorizon: 400\n"
        "start: [30, 30]\ngoal: [60, 90]\nprofile: policy\n"
    )
    return load_task(folder)


def failing(task: Task, share: float, salt: int) -> str:
    """The built-in controller, which fails on purpose in a share of its drives."""
    source = template_for(task.params.robot, task.nominal.dt).render(MapParameters())
    return source + ON_PURPOSE.format(share=share, salt=salt)


if __name__ == "__main__":
    raise SystemExit(main())
