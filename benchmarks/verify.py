"""Measures the cost of a verification, and the share that is not the controller's.

    python -m benchmarks.verify [--task maze] [--runs N] [--json]

Three controllers are verified from the command line and, as in the loop, by a warm
judge: `builtin` as written by `tdac synth`; the privileged reference, which computes
next to nothing, so that its whole cost counts as our share; and one that stands still
until the time is up. For `builtin`, our share is the wall time minus the CPU time of
its processes, divided by the number of cores.

The bench prints the median and the range of the wall times, s. Before each run of the
loop the judge has time to prepare, as while a learner writes. Two figures measure the
speed of the machine: a step of CartPole-v1 through `gym.make`, and a bare interpreter
that imports numpy, the minimum start of a judge and its sandbox. On the machine for
which the limits were set these take 4.6 us and 58 ms. Our share is also scaled to that
machine, by the smaller of the two slowdowns, and compared with the limits. There are
limits for a controller that passes, `builtin`, and for one that is stuck, and none for
the reference. Byte code is on disk, as after the first use of the package.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.timing import WIDTH, duration, in_turn, whole_from_one
from tdac_agent import load_task, synthesize, verify
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite.privileged import (
    DO_NOTHING,
    REFERENCE,
    privileged_controller,
    reference_paths,
)
from tdac_envs import TdacError

READY_SECONDS = 2.0
CART_POLE_STEPS = 10_000
BARE = "import sys; sys.path.append(sys.argv[1]); import numpy"
LIMITS = {"command line": (2.0, 0.8), "loop": (1.0, 0.3)}
STUCK_LIMIT = 1.0


@dataclass(frozen=True, slots=True)
class Row:
    """Cost of one controller's verification.

    Attributes:
        controller: Name of the controller.
        way: `command line` or `loop`.
        passed: Whether it was verified.
        wall: Median of the wall times, s.
        fastest: Minimum wall time, s.
        slowest: Maximum wall time, s.
        computing: CPU time of the controller's processes, s.
        share: Wall time that is not the controller's, s.
        limit: Limit of the share, s; None for the reference.
    """

    controller: str
    way: str
    passed: bool
    wall: float
    fastest: float
    slowest: float
    computing: float
    share: float
    limit: float | None


def main() -> int:
    """Returns the exit code: 1 if a share or a wall time exceeds its limit."""
    options = _options()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    try:
        task = load_task(options.task)
    except TdacError as error:
        sys.exit(f"benchmarks.verify: {error}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        controllers = _controllers(task, folder)
        before = _machine()
        rows = []
        for controller, source in controllers.items():
            run = _run_folder(folder / controller, task, source)
            rows.append(_row(controller, "command line", _from_cli(run), options.runs))
        with WarmJudge(task=task) as judge:
            for controller, source in controllers.items():
                measure = _from_loop(task, source, judge)
                rows.append(_row(controller, "loop", measure, options.runs))
    machines = [before, _machine()]
    if options.json:
        facts = {"machine": machines, "rows": rows}
        print(json.dumps(facts, indent=1, default=asdict))
    else:
        _show(rows, options.task, machines)
    slower = _slower(machines)
    late = [row for row in rows if _too_slow(row, slower)]
    for row in late:
        times = f"wall {row.wall:.2f} s, our share {row.share:.2f} s"
        print(f"too slow: {row.controller}, {row.way}: {times}", file=sys.stderr)
    return 1 if late else 0


def _controllers(task: Task, folder: Path) -> dict[str, str]:
    run = synthesize(task, out=folder / "run", confirm=False)
    assert run.passed
    ways = reference_paths(task.nominal, 0)
    return {
        "builtin": run.controller.read_text(),
        REFERENCE: privileged_controller(task.nominal, ways),
        DO_NOTHING: privileged_controller(task.nominal, ways, DO_NOTHING),
    }


def _run_folder(folder: Path, task: Task, source: str) -> Path:
    lay_out(task, folder)
    (folder / "controller.py").write_text(source)
    return folder


@dataclass(frozen=True, slots=True)
class Machine:
    """Speed of a machine.

    Attributes:
        step: Median time of a step of CartPole-v1, s.
        start: Median time of a bare interpreter that imports numpy, s.
    """

    step: float
    start: float


OF_LIMITS = Machine(step=4.6e-6, start=58e-3)
"""The machine for which the limits were set."""


def _machine() -> Machine:
    packages = str(Path(np.__file__).parent.parent)
    start = [sys.executable, "-I", "-S", "-c", BARE, packages]
    calls = {
        "step": _cart_pole,
        "start": partial(subprocess.run, start, check=True),
    }
    times = {name: statistics.median(t) for name, t in in_turn(calls, 7).items()}
    return Machine(times["step"] / CART_POLE_STEPS, times["start"])


def _cart_pole() -> None:
    env = gym.make("CartPole-v1")
    env.reset(seed=0)
    for number in range(CART_POLE_STEPS):
        if env.step(number % 2)[2]:
            env.reset()


Measure = Callable[[], tuple[float, float, bool]]


def _from_cli(run: Path) -> Measure:
    """Measures the command: wall time, the controller's CPU time, verdict."""
    command = [sys.executable, "-m", "tdac_agent", "verify", str(run), "--json"]

    def measure() -> tuple[float, float, bool]:
        began = time.perf_counter()
        done = subprocess.run(command, capture_output=True, check=False)
        wall = time.perf_counter() - began
        report = json.loads(done.stdout)
        return wall, report["child_cpu_seconds"], report["verdict"]["passed"]

    return measure


def _from_loop(task: Task, source: str, judge: WarmJudge) -> Measure:
    def measure() -> tuple[float, float, bool]:
        time.sleep(READY_SECONDS)
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as out:
            report = verify(source.encode(), task, seed=0, judge=judge, out=Path(out))
        wall = time.perf_counter() - began
        return wall, report.child_cpu_seconds, report.passed

    return measure


def _row(controller: str, way: str, measure: Measure, runs: int) -> Row:
    measure()
    results = [measure() for _ in range(runs)]
    walls = [wall for wall, _, _ in results]
    wall = statistics.median(walls)
    computing = statistics.median(cpu for _, cpu, _ in results)
    cores = min(os.cpu_count() or 1, 2)
    own = computing / cores if controller == "builtin" else 0.0
    return Row(
        controller=controller,
        way=way,
        passed=all(passed for _, _, passed in results),
        wall=round(wall, 3),
        fastest=round(min(walls), 3),
        slowest=round(max(walls), 3),
        computing=round(computing, 3),
        share=round(wall - own, 3),
        limit={"builtin": LIMITS[way][1], DO_NOTHING: STUCK_LIMIT}.get(controller),
    )


def _slower(machines: list[Machine]) -> float:
    """The smaller slowdown of the machine relative to that of the limits."""
    step = statistics.mean(m.step for m in machines) / OF_LIMITS.step
    start = statistics.mean(m.start for m in machines) / OF_LIMITS.start
    return min(step, start)


def _too_slow(row: Row, slower: float) -> bool:
    """Whether a row exceeds a limit, after scaling for the machine's speed."""
    long = row.controller == "builtin" and row.wall > LIMITS[row.way][0] * slower
    return long or (row.limit is not None and row.share > row.limit * slower)


def _show(rows: list[Row], task: str, machines: list[Machine]) -> None:
    slower = _slower(machines)
    load = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    table = Table(title=f"Verification on {task}, s ({load})", title_justify="left")
    for name in ("controller", "from", "verdict"):
        table.add_column(name)
    scaled = "our share, scaled"
    for name in ("wall", "range", "controller's CPU", "our share", scaled, "limit"):
        table.add_column(name, justify="right")
    for row in rows:
        colour = "red" if _too_slow(row, slower) else "green"
        table.add_row(
            row.controller,
            row.way,
            "verified" if row.passed else "not verified",
            f"{row.wall:.2f}",
            f"{row.fastest:.2f} to {row.slowest:.2f}",
            f"{row.computing:.2f}",
            f"{row.share:.2f}",
            f"[{colour}]{row.share / slower:.2f}[/]",
            "–" if row.limit is None else f"{row.limit:.1f}",
        )
    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(table)
    for when, machine in zip(("before", "after"), machines, strict=True):
        console.print(
            f"machine {when}: CartPole-v1 {duration(machine.step)} per step, "
            f"import numpy {duration(machine.start)} per start"
        )
    console.print(
        f"the limits are for {duration(OF_LIMITS.step)} and "
        f"{duration(OF_LIMITS.start)}; this machine counts as {slower:.1f} times slower"
    )


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(prog="benchmarks.verify", description=about)
    parser.add_argument("--task", default="maze", help="bundled name or task.yaml")
    parser.add_argument(
        "--runs", type=whole_from_one, default=5, help="runs of each kind"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
