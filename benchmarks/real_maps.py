"""Measures preprocessing on third-party maps against their truth masks.

    python benchmarks/real_maps.py DIR [--radius 12|fit] [--negate] [--no-verify]

DIR contains an `index.json`: a list of tasks with file, polarity, start, goal,
`max_robot_radius_px`, a reference length and a `truth/` mask (black = obstacle).
Only the image is used, never a yaml beside it.

Columns: polarity with the task, and without start and goal; solvable; route: the
shortest path on the chosen grid keeps half the radius from every truth obstacle and is
within 10 % of the reference length; iou90: the free space connected to the start has
an IoU of at least 0.9 with the truth's; verified: the builtin learner's controller is
verified; refused: number of refused tasks among those that the index calls infeasible
and copies that are closed by walls in the obstacles' colour.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TdacError
from tdac_envs.grid.grid import BoolGrid, body_free, clearance
from tdac_envs.grid.plan import path_length, plan_path
from tdac_envs.mapping.binarize import disc, otsu
from tdac_envs.mapping.image import ColourImage, luminance
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.preprocessing import preprocess, rank_candidates

Point = tuple[int, int]
Entry = dict[str, Any]

WALL = 5
"""Thickness of the wall that closes a copy, px."""
MAX_WALLS = 12
"""Number of walls after which a map counts as too open to be closed."""


@dataclass
class Row:
    """The results for one task; None if a column does not apply."""

    name: str
    radius: int
    mixed: bool
    polarity: bool | None = None
    polarity_no_task: bool | None = None
    solvable: bool | None = None
    route: bool | None = None
    iou90: bool | None = None
    verified: bool | None = None
    closed: bool = False
    refused: bool | None = None
    method: str = ""
    iou: float | None = None
    reason: str = ""

    def note(self, text: str) -> None:
        """Appends a reason."""
        self.reason = f"{self.reason}; {text}" if self.reason else text


def verify_builtin(image: ColourImage, start: Point, goal: Point, radius: int) -> bool:
    """Whether the builtin learner's controller passes its tests on the map."""
    from tdac_agent import load_task, synthesize
    from tdac_agent.tasks.task_file import RobotSpec, TaskFile

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "map.png"
        cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
        spec = TaskFile(
            map=str(path), start=start, goal=goal, robot=RobotSpec(radius=radius)
        )
        task, out = load_task(spec), Path(name) / "run"
        run = synthesize(task, "builtin", out=out, confirm=False)
    return run.passed


def select(entries: list[Entry], radius: str) -> list[tuple[Entry, int]]:
    """The tasks to measure, each with its robot radius, px."""
    chosen = []
    for entry in entries:
        largest = entry["max_robot_radius_px"]
        infeasible = entry["expected"] != "feasible"
        if infeasible or (radius == "12" and largest >= 13):
            chosen.append((entry, 12))
        elif radius == "fit" and largest >= 3:
            chosen.append((entry, min(12, largest - 1)))
    return chosen


def picture(folder: Path, entry: Entry, negate: bool) -> ColourImage:
    """The task's image, with alpha on white; optionally inverted."""
    name = entry["file"]
    if name.endswith(".map"):
        name = entry["png"]
    colour = load_image(folder / name).colour
    return 255 - colour if negate else colour


def measure(folder: Path, negate: bool, verify: bool, task: tuple[Entry, int]) -> Row:
    """Computes all columns of one task."""
    entry, radius = task
    row = Row(entry["name"], radius, entry["polarity"] == "mixed")
    image = picture(folder, entry, negate)
    start, goal = tuple(entry["start"]), tuple(entry["goal"])
    if entry["expected"] != "feasible":
        row.closed, row.refused = True, refuses(image, start, goal, radius)
        if not row.refused:
            row.note("infeasible task accepted")
        return row
    truth = luminance(load_image(folder / entry["truth"]).colour) < 128
    _polarity_columns(row, entry, negate, image, start, goal)
    _grid_columns(row, entry, image, truth)
    if verify and row.solvable:
        row.verified = verify_builtin(image, start, goal, radius)
    copy = closed_copy(image, truth, start, goal, entry["polarity"], negate)
    if copy is not None:
        row.closed, row.refused = True, refuses(copy, start, goal, radius)
        if not row.refused:
            row.note("closed copy accepted")
    return row


def refuses(image: ColourImage, start: Point, goal: Point, radius: int) -> bool:
    """Whether preprocessing refuses the task."""
    try:
        preprocess(image, start, goal, radius)
    except TdacError:
        return True
    return False


def _polarity_columns(
    row: Row, entry: Entry, negate: bool, image: ColourImage, start: Point, goal: Point
) -> None:
    wanted = entry["polarity"].removesuffix("_obstacle")
    if negate:
        wanted = {"dark": "light", "light": "dark"}.get(wanted, wanted)
    best = rank_candidates(image, start, goal, row.radius)[0].reading
    row.polarity, row.method = best.polarity == wanted, best.method
    alone = preprocess(image, robot_radius=row.radius)[1].polarity
    row.polarity_no_task = alone == wanted
    if not row.polarity:
        row.note(f"polarity {best.polarity}, not {wanted}")
    if not row.polarity_no_task:
        row.note(f"polarity without task {alone}, not {wanted}")


def _grid_columns(row: Row, entry: Entry, image: ColourImage, truth: BoolGrid) -> None:
    start, goal = tuple(entry["start"]), tuple(entry["goal"])
    row.solvable = row.route = row.iou90 = False
    try:
        grid, _ = preprocess(image, start, goal, row.radius)
    except TdacError as error:
        row.note(str(error))
        return
    row.solvable = True
    path = plan_path(body_free(clearance(grid.cells), row.radius), start, goal)
    wanted = reference_length(entry, truth, row.radius)
    columns, rows = path.astype(int).T
    gap, length = clearance(truth)[rows, columns].min(), path_length(path)
    row.route = bool(gap >= row.radius / 2 and abs(length / wanted - 1) <= 0.1)
    row.iou = round(iou(reachable(grid.cells, start), reachable(truth, start)), 3)
    row.iou90 = row.iou >= 0.9
    if not row.route:
        row.note(f"route {length:.0f} px of {wanted:.0f}, {gap:.1f} px from the truth")
    if not row.iou90:
        row.note(f"IoU {row.iou:.2f}")


def reference_length(entry: Entry, truth: BoolGrid, radius: int) -> float:
    """Length of the shortest path in px, from the index or planned on the truth."""
    if entry.get("ref_len_px"):
        return float(entry["ref_len_px"])
    free = body_free(clearance(truth), radius)
    return path_length(plan_path(free, tuple(entry["start"]), tuple(entry["goal"])))


def reachable(cells: BoolGrid, start: Point) -> BoolGrid:
    """Free pixels connected to the start."""
    labels = cv2.connectedComponents((~cells).astype(np.uint8), connectivity=4)[1]
    label = labels[start[::-1]]
    return np.asarray((labels == label) & (label > 0))


def iou(one: BoolGrid, other: BoolGrid) -> float:
    """Intersection over union."""
    return float((one & other).sum() / max((one | other).sum(), 1))


def closed_copy(
    image: ColourImage,
    truth: BoolGrid,
    start: Point,
    goal: Point,
    polarity: str,
    negate: bool,
) -> ColourImage | None:
    """The image with walls added until the truth is disconnected, or None.

    Each wall crosses the current shortest path at its narrowest place, away from
    start and goal, from obstacle to obstacle.
    """
    copy, cells = image.copy(), truth.copy()
    ink = obstacle_ink(image, truth, polarity, negate)
    near_ends = disc(cells.shape, *start, 20) | disc(cells.shape, *goal, 20)
    for _ in range(MAX_WALLS):
        clear = clearance(cells)
        path = plan_path(~cells, start, goal)
        if len(path) == 0:
            return copy
        wall = crossing(cells, clear, path, near_ends)
        if wall is None:
            return None
        colour = wall_colour(image, ink, wall)
        cv2.line(copy, *wall, colour, WALL)
        drawn = np.zeros(cells.shape, np.uint8)
        cv2.line(drawn, *wall, 1, WALL)
        cells = cells | (drawn > 0)
    return None


def obstacle_ink(
    image: ColourImage, truth: BoolGrid, polarity: str, negate: bool
) -> BoolGrid:
    """Truth obstacles that are drawn in the image, unlike the paper around a plan."""
    if polarity == "mixed":
        return truth
    grey = luminance(image)
    dark = grey <= otsu(grey)
    drawn = dark if (polarity == "dark_obstacle") != negate else ~dark
    return np.asarray(truth & drawn)


def crossing(
    cells: BoolGrid,
    clear: NDArray[np.float32],
    path: NDArray[np.float64],
    near_ends: BoolGrid,
) -> tuple[Point, Point] | None:
    """The shortest straight wall across the path, from obstacle to obstacle."""
    height, width = cells.shape
    steps = path.astype(int)
    allowed = [i for i, (x, y) in enumerate(steps) if not near_ends[y, x]]
    allowed.sort(key=lambda i: clear[steps[i][1], steps[i][0]])
    best: tuple[float, tuple[Point, Point]] | None = None
    for i in allowed[:40]:
        for angle in np.arange(16) * np.pi / 16:
            across = np.array([np.cos(angle), np.sin(angle)])
            ends = [_hit(cells, steps[i], sign * across) for sign in (1, -1)]
            length = float(np.hypot(*(ends[0] - ends[1])))
            on_ends = disc_hit(near_ends, ends[0], ends[1])
            if not on_ends and (best is None or length < best[0]):
                clipped = [
                    tuple(int(v) for v in np.clip(end, 0, (width - 1, height - 1)))
                    for end in ends
                ]
                best = length, (clipped[0], clipped[1])  # type: ignore[assignment]
    return None if best is None else best[1]


def disc_hit(near_ends: BoolGrid, one: Any, other: Any) -> bool:
    """Whether the segment touches the surroundings of start or goal."""
    count = int(np.hypot(*(one - other))) + 2
    points = np.rint(np.linspace(one, other, count)).astype(int)
    height, width = near_ends.shape
    points = np.clip(points, 0, (width - 1, height - 1))
    return bool(near_ends[points[:, 1], points[:, 0]].any())


def _hit(cells: BoolGrid, origin: Any, step: Any) -> Any:
    """A point one step inside the first obstacle from `origin` along `step`."""
    height, width = cells.shape
    point = origin.astype(float)
    while True:
        x, y = np.rint(point).astype(int)
        if not (0 <= x < width and 0 <= y < height) or cells[y, x]:
            return np.rint(point + step).astype(int)
        point = point + step


def wall_colour(
    image: ColourImage, ink: BoolGrid, wall: tuple[Point, Point]
) -> tuple[int, ...]:
    """Median colour of the obstacle pixels near the wall's ends."""
    near = disc(ink.shape, *wall[0], 6) | disc(ink.shape, *wall[1], 6)
    chosen = ink & near if (ink & near).any() else ink
    return tuple(int(c) for c in np.median(image[chosen], axis=0))


COLUMNS = (
    "polarity",
    "polarity_no_task",
    "solvable",
    "route",
    "iou90",
    "verified",
    "closed",
    "refused",
)


def count(rows: list[Row]) -> dict[str, int]:
    """Number of tasks, and of correct results in each column."""
    feasible = [row for row in rows if row.solvable is not None]
    sums = {name: sum(bool(getattr(row, name)) for row in rows) for name in COLUMNS}
    return {"tasks": len(feasible), **sums}


def main() -> int:
    """Prints the table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--radius", choices=["12", "fit"], default="12")
    parser.add_argument("--negate", action="store_true")
    parser.add_argument("--no-verify", action="store_true")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    entries = json.loads((args.folder / "index.json").read_text())
    tasks = select(entries, args.radius)
    work = partial(measure, args.folder, args.negate, not args.no_verify)
    with ProcessPoolExecutor(max_workers=2) as pool:
        rows = list(pool.map(work, tasks))
    plain = [row for row in rows if not row.mixed]
    mixed = [row for row in rows if row.mixed]
    if args.json:
        report = {**count(plain), "mixed": count(mixed)}
        print(json.dumps({**report, "rows": [asdict(row) for row in rows]}, indent=1))
    else:
        print_table(plain, mixed, not args.no_verify)
    return 0


def print_table(plain: list[Row], mixed: list[Row], verified: bool) -> None:
    """Prints one line per failure, then the counts."""
    for row in [*plain, *mixed]:
        if row.reason:
            print(f"{row.name} (radius {row.radius}): {row.reason} [{row.method}]")
    for title, rows in (("one polarity", plain), ("mixed polarity", mixed)):
        counts = count(rows)
        if not rows:
            continue
        print(f"\n{title}: {counts['tasks']} tasks")
        for name in COLUMNS[:-2]:
            if name != "verified" or verified:
                share = counts[name] / max(counts["tasks"], 1)
                print(f"  {name:<18}{counts[name]:>4} {share:>7.1%}")
        share = counts["refused"] / max(counts["closed"], 1)
        print(f"  refused {counts['refused']} of {counts['closed']}, {share:.1%}")


if __name__ == "__main__":
    sys.exit(main())
