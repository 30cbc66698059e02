"""Measures `tdac webots run` on third-party Webots controllers.

    python -m benchmarks.real_controllers DIR [--only NAME] [--steps N] [--json FILE]

DIR contains a folder OWNER+NAME for each repository of `real_controllers.yaml`, at the
commit given there; the program downloads nothing. Every controller runs in the
sandbox, in the world file of its own repository, without a goal.

A controller *runs* if it raises no error and moves nothing as a supervisor, commands
the wheels, and the robot gets farther than its radius from the start. A world that is
refused because of unmodelled nodes is tried again with all of them ignored
(`--ignore`). The shares count the controllers whose `expected` is not `refused`: a
refused one cannot run in Webots either, is made for another robot, or does not drive.
One that is expected to fail should run, but needs what is not modelled. For both,
`reason` says why. `fuzzy-wall` needs the package scikit-fuzzy.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import yaml
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tdac_agent.webots.run import WebotsRun, run_controller
from tdac_envs.core.errors import TdacError
from tdac_envs.webots.stage import open_stage
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.wbt.reader import load_world

INDEX = Path(__file__).with_suffix(".yaml")
STEPS = 600
SECONDS = 300.0
"""Time that a controller may compute; Webots has no such limit."""
_UNSUPPORTED = ("tdac: ", 'Device "')

Result = Literal["runs", "ignore", "fails"]


@dataclass(frozen=True, slots=True)
class Entry:
    """A controller of the index.

    Attributes:
        name: Short name.
        repository: OWNER/NAME.
        commit: Commit that was measured.
        controller: Path of the controller in the repository.
        world: Path of its world in the repository.
        licence: Licence as stated by the repository.
        expected: `runs`, `ignore` (runs with `--ignore`), `fails` or `refused`.
        reason: Why it fails or is refused; otherwise empty.
        steps: Least number of steps, for a controller that drives very slowly.
    """

    name: str
    repository: str
    commit: str
    controller: str
    world: str
    licence: str
    expected: str
    reason: str = ""
    steps: int = 0


@dataclass(frozen=True, slots=True)
class Row:
    """The result for one controller.

    Attributes:
        name: Name in the index.
        result: `runs`, `ignore` (runs with `--ignore`) or `fails`.
        expected: As in the index.
        ignored: Types of nodes that were ignored.
        moved: Greatest distance from the start, m.
        steps: Simulation steps.
        contacts: Steps with a contact.
        unsupported: First unsupported call or device that the controller used.
        why: Why it fails.
    """

    name: str
    result: Result
    expected: str
    ignored: tuple[str, ...] = ()
    moved: float = 0.0
    steps: int = 0
    contacts: int = 0
    unsupported: str = ""
    why: str = ""


def read_index(path: Path = INDEX) -> list[Entry]:
    """The controllers of an index."""
    return [Entry(**record) for record in yaml.safe_load(path.read_text("utf-8"))]


def measure(entry: Entry, folder: Path, steps: int) -> Row:
    """Runs a controller, again with `--ignore` if its world is refused."""
    tree = folder / entry.repository.replace("/", "+")
    controller, world = tree / entry.controller, tree / entry.world
    ignored: tuple[str, ...] = ()
    for result in ("runs", "ignore"):
        try:
            done = _run(controller, world, ignored, max(steps, entry.steps))
        except TdacError as error:
            ignored = ignored or _unmodelled(world)
            if result == "ignore" or not ignored:
                return Row(entry.name, "fails", entry.expected, why=str(error))
            continue
        return _row(entry, result, ignored, done)
    raise AssertionError


def _run(
    controller: Path, world: Path, ignored: tuple[str, ...], steps: int
) -> WebotsRun:
    stage = open_stage(world, ignore=ignored, controller=controller.stem)
    env = stage.make_env(steps=steps)
    return run_controller(controller, stage, env, seconds=SECONDS)


def _unmodelled(world: Path) -> tuple[str, ...]:
    """Types of the nodes that `--ignore` may name; empty if the file is invalid."""
    try:
        nodes = load_world(world).unmodelled
    except TdacError:
        return ()
    return tuple(sorted({node.kind for node in nodes if node.may_be_solid}))


def _row(
    entry: Entry, result: Result, ignored: tuple[str, ...], done: WebotsRun
) -> Row:
    report, log = done.report, done.log
    x, y, _ = report.start
    moved = max(math.hypot(pose[0] - x, pose[1] - y) for pose in log.poses)
    why = report.error or report.teleport or ""
    if not why and not any(action.any() for action in log.actions):
        why = "it never commands the wheels"
    elif not why and moved <= BODY_RADIUS:
        why = f"it moves only {moved:.3f} m"
    return Row(
        name=entry.name,
        result="fails" if why else result,
        expected=entry.expected,
        ignored=ignored,
        moved=moved,
        steps=report.steps,
        contacts=report.collisions,
        unsupported=_first_unsupported(report.output),
        why=why,
    )


def _first_unsupported(output: str) -> str:
    lines = (line.strip() for line in output.splitlines())
    return next((line for line in lines if line.startswith(_UNSUPPORTED)), "")


def show(rows: Sequence[Row], console: Console) -> None:
    """Prints the table and the shares."""
    table = Table(title="Third-party controllers", title_justify="left")
    for heading in ("controller", "result", "moved", "steps", "contacts", "remarks"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        ignored = f"--ignore {' '.join(row.ignored)}" if row.ignored else ""
        remarks = "; ".join(filter(None, (ignored, row.why, row.unsupported)))
        wanted = row.result == row.expected or (row.result, row.expected) == (
            "fails", "refused",
        )  # fmt: skip
        result = row.result if wanted else f"{row.result} (expected {row.expected})"
        table.add_row(
            row.name, result, f"{row.moved:.2f} m", str(row.steps), str(row.contacts),
            escape(remarks),
        )  # fmt: skip
    console.print(table)
    counted = [row for row in rows if row.expected != "refused"]
    found = Counter(row.result for row in counted)
    total = max(len(counted), 1)
    as_is, all_ = found["runs"], found["runs"] + found["ignore"]
    console.print(
        f"{len(rows)} controllers, {len(counted)} should run: {as_is} run unchanged "
        f"({as_is / total:.0%}), {all_} with --ignore ({all_ / total:.0%})"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; returns 0 if every result is as expected, else 1."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--index", type=Path, default=INDEX)
    parser.add_argument("--only", action="append", metavar="NAME")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--json", type=Path, metavar="FILE")
    given = parser.parse_args(arguments)
    entries = read_index(given.index)
    if given.only:
        entries = [entry for entry in entries if entry.name in given.only]
    console, rows = Console(), list[Row]()
    for entry in entries:
        rows.append(measure(entry, given.folder, given.steps))
        print(f"{entry.name}: {rows[-1].result} {rows[-1].why}", file=sys.stderr)
    show(rows, console)
    if given.json is not None:
        record: list[dict[str, Any]] = [asdict(row) for row in rows]
        given.json.write_text(json.dumps(record, indent=1), encoding="utf-8")
    fits = all(
        row.result == row.expected or (row.result, row.expected) == ("fails", "refused")
        for row in rows
    )
    return 0 if fits else 1


if __name__ == "__main__":
    sys.exit(main())
