"""Measures the overhead of the campaign layer, and how runs scale with workers.

    python -m benchmarks.campaign [--runs N] [--many N] [--json]

One worker and then two workers make the same short runs (`builtin` on a small map,
verified at once). Their speed-up is printed beside that of two bare loops, pinned like
the workers, which shows what the machine allows at that moment. The overhead is the
time of one worker outside its `--runs` runs: starting, planning, dispatching, tables.

With `--many N`, N scripted runs of one iteration are made with `keep: records`. They
are as short as possible: about one in ten has an answer that is tested in the sandbox,
a controller that drives or one with a forbidden import; the other answers are not
Python, and are requested three times. The bench prints the driver's memory over time,
its CPU time and the number of files, and the same for a second call of the command,
which has nothing to do.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import yaml

from tdac_agent.metrics import find_runs

LOOP = 20_000_000
LOOK_SECONDS = 0.2
PARTS = (0.1, 0.5, 0.9)
"""Fractions of a campaign's time at which the driver's memory is reported."""
BROKEN = """def policy(obs)
    return 0.5, 0.5
"""
FORBIDDEN = """import socket


def policy(obs):
    return 0.5, 0.5
"""


@dataclass(frozen=True, slots=True)
class Made:
    """Measurements of a finished campaign.

    Attributes:
        runs: Number of finished runs.
        wall: Wall time of the driver's process, s.
        in_runs: Sum of the wall times of the runs, s.
        driver_cpu: CPU time of the driver's process, s.
        driver_mb: Memory of the driver by fraction of the time, and the maximum, MB.
        files: Number of files in its folder.
        megabytes: Size of these files, MB.
    """

    runs: int
    wall: float
    in_runs: float
    driver_cpu: float
    driver_mb: dict[str, float]
    files: int
    megabytes: float


def main() -> None:
    """Prints the measurements."""
    options = _options()
    with _place() as folder:
        if options.many:
            _write_many(folder, options.many)
            found = {
                "all of them": asdict(_make(folder, 2, "many")),
                "once more": asdict(_make(folder, 2, "many")),
            }
        else:
            found = _scaling(folder, options.runs)
    if options.json:
        print(json.dumps(found, indent=1))
        return
    for name, figures in found.items():
        text = ", ".join(f"{key} {_formatted(value)}" for key, value in figures.items())
        print(f"{name}: {text}")


def _formatted(value: object) -> str:
    if isinstance(value, dict):
        return "/".join(f"{part:.0f}" for part in value.values())
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _scaling(folder: Path, runs: int) -> dict[str, dict[str, object]]:
    _write(folder, runs, ["builtin"])
    bare_one = _loops(1)
    one = _make(folder, 1, "one")
    two = _make(folder, 2, "two")
    bare_two = _loops(2)
    return {
        "one worker": asdict(one),
        "two workers": asdict(two),
        "speed-up": {
            "runs": one.wall / two.wall,
            "bare loops": 2 * bare_one / bare_two,
        },
        "overhead": {"of one worker": one.wall / one.in_runs - 1.0},
    }


def _make(folder: Path, workers: int, out: str) -> Made:
    """Runs the campaign and samples memory and CPU time of its driver."""
    words = ["campaign", "bench.yaml", "--workers", str(workers), "--out", out]
    began, memory, cpu = time.perf_counter(), [0.0], 0.0
    with subprocess.Popen(
        [sys.executable, "-m", "tdac_agent", *words],
        cwd=folder,
        stdout=subprocess.DEVNULL,
    ) as driver:
        while driver.poll() is None:
            memory.append(_resident(driver.pid))
            cpu = max(cpu, _cpu_seconds(driver.pid))
            time.sleep(LOOK_SECONDS)
    wall = time.perf_counter() - began
    made = [run for run in find_runs(folder / out) if run.finished]
    files = [path for path in (folder / out).rglob("*") if path.is_file()]
    size = sum(path.stat().st_size for path in files) / 1e6
    in_runs = sum(run.seconds for run in made)
    megabytes = {f"{part:.0%}": memory[int(part * len(memory))] for part in PARTS}
    megabytes["most"] = max(memory)
    return Made(len(made), wall, in_runs, cpu, megabytes, len(files), size)


def _resident(pid: int) -> float:
    """Resident memory of a process, MB."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _cpu_seconds(pid: int) -> float:
    """CPU time of a process without its children, s."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def _loops(count: int) -> float:
    """Wall time of concurrent bare loops, each on a separate core, s."""
    context = multiprocessing.get_context("fork")
    cores = sorted(os.sched_getaffinity(0))
    loops = [
        context.Process(target=_loop, args=(cores[n % len(cores)],))
        for n in range(count)
    ]
    began = time.perf_counter()
    for loop in loops:
        loop.start()
    for loop in loops:
        loop.join()
    return time.perf_counter() - began


def _loop(core: int) -> None:
    os.sched_setaffinity(0, {core})
    for _ in range(LOOP):
        pass


def _write_many(folder: Path, runs: int) -> None:
    """Writes a campaign of runs that are as short as possible."""
    (folder / "forbidden.py").write_text(FORBIDDEN)
    (folder / "broken.py").write_text(BROKEN)
    drawn = [
        {"weight": 1},
        {"weight": 1, "file": "forbidden.py"},
        {"weight": 58, "file": "broken.py"},
    ]
    script = {"schema": 1, "generate": drawn, "edit": drawn}
    (folder / "script.yaml").write_text(yaml.safe_dump(script))
    learner = f"scripted:{folder / 'script.yaml'}"
    _write(folder, runs, [learner], settings=["one shot"], keep="records")


def _write(folder: Path, runs: int, learners: list[str], **more: object) -> None:
    """Writes a campaign on a room of 160 × 120 px with a wall in it."""
    cells = np.zeros((120, 160), np.bool_)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = True
    cells[:80, 70:76] = True
    np.save(folder / "map.npy", cells)
    task = {
        "schema": 1,
        "map": "map.npy",
        "start": [30, 30],
        "goal": [130, 30],
        "robot": {"radius": 6},
        "name": "small",
        "horizon": 400,
        "profile": "policy",
    }
    (folder / "small.yaml").write_text(yaml.safe_dump(task))
    campaign = {
        "schema": 1,
        "name": "bench",
        "tasks": ["small.yaml"],
        "learners": learners,
        "runs": runs,
    }
    (folder / "bench.yaml").write_text(yaml.safe_dump(campaign | more))


@contextmanager
def _place() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="tdac-campaign-") as name:
        yield Path(name)


def _options() -> argparse.Namespace:
    about = (__doc__ or "").partition("\n")[0]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.campaign", description=about
    )
    parser.add_argument("--runs", type=int, default=200, help="runs per campaign")
    parser.add_argument(
        "--many", type=int, default=0, help="make scripted runs instead"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser.parse_args()


if __name__ == "__main__":
    main()
