"""Times A* beside `skimage.graph.MCP_Geometric`, and checks published lengths.

    python -m benchmarks planning [--maps DIR]

DIR contains MovingAI maps with their `.scen` files. Without it, floor plans are drawn,
and the lengths are checked against a whole distance field. Maps with water or swamp
have special rules and are left out. scikit-image allows diagonal steps between
obstacles; for every scenario it allocates a search object, and ours its arrays.

The floor is one pass over the map that finds the pixels connected to the start, which
every search without a heuristic makes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from skimage.graph import MCP_Geometric

from benchmarks.preprocessing import floor_plan
from benchmarks.timing import Bench, Call, Effort, compared, in_turn
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.plan import distance_field, path_length, plan_path
from tdac_envs.mapping.map_files import read_movingai

Point = tuple[int, int]

TOLERANCE = 0.01
SCENARIOS = 1000
TIMED = 25
FLOOR, OURS, THEIRS = "connected pixels", "A*", "MCP_Geometric"


@dataclass(frozen=True, slots=True)
class Trip:
    """Start and goal pixels (x, y), and the length of the shortest path, px."""

    start: Point
    goal: Point
    length: float


def benches(effort: Effort, maps: Path | None = None) -> list[Bench]:
    """One bench per map."""
    rounds = effort.rounds_of(3)
    return [
        _on_map(name, free, trips, rounds)
        for name, free, trips in _maps(effort.quick, maps)
    ]


def _maps(
    quick: bool, folder: Path | None
) -> Iterator[tuple[str, BoolGrid, list[Trip]]]:
    if folder is None:
        for size in (0.1,) if quick else (0.25, 1.0):
            yield f"rooms, {size:g} MPix", *_drawn(size)
        return
    for file in sorted(folder.glob("*.map.scen")):
        map_file = file.with_suffix("")
        ground = set("".join(map_file.read_text().splitlines()[4:]))
        occupied = read_movingai(map_file).occupied
        if occupied is not None and not ground & set("WS"):
            yield map_file.name, ~occupied, list(scenarios(file))


def scenarios(file: Path, count: int = SCENARIOS) -> Iterator[Trip]:
    """Up to `count` of a file's scenarios, evenly spread."""
    rows = [line.split() for line in file.read_text().splitlines()[1:] if line.strip()]
    count = min(count, len(rows))
    for row in (rows[k * len(rows) // count] for k in range(count)):
        x, y, to_x, to_y = map(int, row[4:8])
        yield Trip((x, y), (to_x, to_y), float(row[8]))


def _drawn(megapixels: float) -> tuple[BoolGrid, list[Trip]]:
    picture, start, _ = floor_plan(megapixels)
    free = np.asarray(picture[..., 0] > 128)
    field = distance_field(free, start)
    rows, columns = np.nonzero(np.isfinite(field))
    chosen = np.random.default_rng(0).choice(rows.size, 200, replace=False)
    ends = zip(columns[chosen].tolist(), rows[chosen].tolist(), strict=True)
    return free, [Trip((x, y), start, float(field[y, x])) for x, y in ends]


def _on_map(name: str, free: BoolGrid, trips: list[Trip], rounds: int) -> Bench:
    wrong = sum(not _optimal(free, trip) for trip in trips)
    timed = trips[:: max(len(trips) // TIMED, 1)][:TIMED]
    taken: dict[str, list[float]] = {FLOOR: [], OURS: [], THEIRS: []}
    for trip in timed:
        for case, seconds in in_turn(_searches(free, trip), rounds).items():
            taken[case].append(min(seconds))
    notes = {OURS: f"{len(trips) - wrong} of {len(trips)} optimal"}
    return compared(f"Planning, {name}", taken, FLOOR, THEIRS, notes=notes)


def _optimal(free: BoolGrid, trip: Trip) -> bool:
    length = path_length(plan_path(free, trip.start, trip.goal))
    return math.isclose(length, trip.length, rel_tol=0.0, abs_tol=TOLERANCE)


def _searches(free: BoolGrid, trip: Trip) -> dict[str, Call]:
    start, goal = trip.start, trip.goal

    def theirs() -> None:
        search = MCP_Geometric(np.where(free, 1.0, -1.0))
        search.find_costs([start[::-1]], [goal[::-1]])
        search.traceback(goal[::-1])

    return {
        FLOOR: lambda: cv2.connectedComponents(free.astype(np.uint8), connectivity=4),
        OURS: lambda: plan_path(free, start, goal),
        THEIRS: theirs,
    }
