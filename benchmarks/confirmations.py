"""How many controllers of a known success rate the judge calls verified.

    python -m benchmarks.confirmations [--each 40] [--number 0]

The built-in controller of a small room fails on purpose in a share of its drives, which
the start decides; so its success rate is known, up to its own failures, which are
counted first. All drives are real ones in the sandbox. Wanted: at most 5 % verified of
those below 95 %, at least 80 % of those at 99.5 %.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from tdac_agent import load_task
from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.metrics.exact import exact_interval
from tdac_agent.tasks.task import Task
from tdac_agent.verification.confirmation import confirm
from tdac_agent.verification.judge.confirming import confirming_test
from tdac_agent.verification.judge.warm import WarmJudge

SHARES = (0.0, 0.005, 0.03, 0.1, 0.4)
"""Shares of drives in which a controller fails on purpose."""
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


def main() -> int:
    """Returns 1 if too many or too few are called verified."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=40, help="controllers per share")
    parser.add_argument("--number", type=int, default=0, help="of the confirmation")
    options = parser.parse_args()
    table = Table("fails on purpose", "drives", "failed", "verified", "95 % interval")
    table.add_column("theory")
    wrong = False
    with tempfile.TemporaryDirectory() as folder, WarmJudge() as judge:
        task, test = small_room(Path(folder)), confirming_test(options.number)
        for share in SHARES:
            drives = failed = verified = 0
            for salt in range(options.each):
                source = failing(task, share, salt)
                found = confirm(source, task, options.number, judge=judge)
                drives, failed = drives + found.count, failed + found.count
                failed -= found.successes
                verified += found.passed
            low, high = exact_interval(verified, options.each)
            theory = test.characteristics(1.0 - share).accepted
            wrong |= share > 0.05 and verified > 0.05 * options.each
            wrong |= share <= 0.005 and verified < 0.8 * options.each
            row = f"{100 * share:g} %", f"{drives}", f"{failed}", f"{verified}"
            table.add_row(*row, f"{low:.3f} to {high:.3f}", f"{theory:.3f}")
    Console().print(table)
    return int(wrong)


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
