"""What the campaign layer costs, and how runs scale with workers.

    python -m benchmarks.campaign [--runs N] [--many N] [--json]

The same short runs (`builtin` on a small map, verified at once) are made by one worker
and by two, in turns. Their speed-up is printed beside that of two bare loops, pinned as
the workers are, at the same moment: what the machine gives. Overhead is the time of one
worker that is in no run: starting, planning, handing out, the tables, of `--runs` runs.

With `--many`, that many scripted runs of one iteration are made with `keep: records`.
They are as short as runs can be: about one in ten has an answer that is tested in the
sandbox, and drives or imports what it may not; those of the others are no Python, and
are asked for three times. Memory of the driver on the way, its CPU time and the files
are printed, and what the same command takes when nothing is left to do.
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
"""Of a campaign's time, when the driver's memory is told."""
BROKEN = """def policy(obs)
    return 0.5, 0.5
"""
FORBIDDEN = """import socket


def policy(obs):
    return 0.5, 0.5
"""


@dataclass(frozen=True, slots=True)
class Made:
    """A campaign that was carried out.

    Attributes:
        runs: That were made.
        wall: Of the driver's process, s.
        in_runs: Sum over the runs, s.
        driver_cpu: CPU time of the driver's process, s.
        driver_mb: Its memory when parts of the time were over; in the end, the most.
        files: In its folder.
        megabytes: Of these.
    """

    runs: int
    wall: float
    in_runs: float
    driver_cpu: float
    driver_mb: dict[str, float]
    files: int
    megabytes: float


def main() -> None:
    """Measures and prints."""
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
        told = ", ".join(f"{key} {_told(value)}" for key, value in figures.items())
        print(f"{name}: {told}")


def _told(value: object) -> str:
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
    """Carries out the campaign; its driver is looked at meanwhile."""
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
    """Wall time of some bare loops at a time, each on a core of its own, s."""
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
    """A campaign of the shortest runs that are verified."""
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
    """A campaign on a room of 160 × 120 px with a wall in it."""
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
    parser.add_argument("--runs", type=int, default=200, help="of each campaign")
    parser.add_argument("--many", type=int, default=0, help="scripted runs instead")
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser.parse_args()


if __name__ == "__main__":
    main()
