"""Measures the world reader on third-party Webots worlds.

    python benchmarks/real_worlds.py DIR [--json]

DIR contains `.wbt` files and an `expected.json`, an independent reading of them: robot
poses, arenas, footprints of obstacles (polygons or discs, one for each primitive),
`nonphysical` Solids, and `skipped`, the types that it does not model. Its lengths are
rounded to 0.1 mm.

A world fails if it does not load; a robot is off by more than 1 mm or 0.01 rad; an
arena differs; a footprint has an IoU below 0.98 (and an outline that is off by more
than 0.15 mm); a Rock is not in its bounding disc with the area of the true hull; one of
their items is not accounted for in our reading; or one of our solids is not in theirs.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from tdac_envs.core.errors import TdacError
from tdac_envs.worlds.footprint import Disc, Footprint, Polygon, Rectangle
from tdac_envs.worlds.wbt.reader import load_world
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, World

Points = NDArray[np.float64]
Record = dict[str, Any]

IOU = 0.98
ROUNDING = 1.5e-4
"""Tolerance for lengths that are rounded to 0.1 mm, m."""
ROCKS = {"regular": 0.505, "flat": 0.470}
"""Area of a rock's hull divided by the area of its bounding disc."""
PIXELS = 1500


@dataclass
class Row:
    """The results for one world."""

    name: str
    version: str = ""
    milliseconds: float = 0.0
    robots: int = 0
    arenas: int = 0
    footprints: int = 0
    matched: int = 0
    worst: float | None = None
    markers: int = 0
    unmodelled: int = 0
    problems: list[str] = field(default_factory=list)


def measure(path: Path, truth: Record | None) -> Row:
    """Reads one world and compares it with the expected reading."""
    row = Row(path.name)
    begin = time.perf_counter()
    try:
        world = load_world(path)
    except TdacError as error:
        row.problems.append(f"does not load: {error}")
        return row
    row.milliseconds = round(1000 * (time.perf_counter() - begin), 1)
    row.version, row.unmodelled = world.version, len(world.unmodelled)
    if truth is None:
        return row
    compare_robots(row, world.robots, truth["robots"])
    compare_arenas(row, world.arenas, truth["arena"])
    if abs(world.time_step - truth["basicTimeStep"]) > 1e-9:
        row.problems.append(f"time step {world.time_step:g} ms")
    extras = compare_footprints(row, world, truth["obstacles"])
    compare_markers(row, world, truth.get("nonphysical", []))
    account(row, world, truth.get("skipped", {}), extras)
    return row


def compare_robots(row: Row, ours: tuple[EPuck, ...], theirs: list[Record]) -> None:
    """Checks that their robots and ours correspond one to one."""
    left = list(ours)
    for robot in theirs:
        near = [mine for mine in left if _same_pose(mine, robot)]
        if near:
            left.remove(near[0])
            row.robots += 1
        else:
            row.problems.append(f"no robot at {robot['x']}, {robot['y']}")
    row.problems += [f"unexpected robot at {mine.pose}" for mine in left]


def _same_pose(mine: EPuck, theirs: Record) -> bool:
    off = math.hypot(mine.x - theirs["x"], mine.y - theirs["y"])
    turn = math.remainder(mine.heading - theirs["yaw"], 2 * math.pi)
    return off <= 1e-3 and abs(turn) <= 0.01


def compare_arenas(row: Row, ours: tuple[Arena, ...], theirs: list[Record]) -> None:
    """Checks that their arenas and ours correspond one to one."""
    left = list(ours)
    for arena in theirs:
        same = [mine for mine in left if _same_arena(mine, arena)]
        if same:
            left.remove(same[0])
            row.arenas += 1
        else:
            row.problems.append(f"no such arena: {arena}")
    row.problems += [f"unexpected arena: {mine}" for mine in left]


def _same_arena(mine: Arena, theirs: Record) -> bool:
    shape, kind = mine.inside, theirs["kind"]
    thickness = theirs.get("wallThickness", 0.0)
    same_wall = abs(mine.wall_thickness - thickness) <= ROUNDING
    if kind == "circle":
        return (
            isinstance(shape, Disc)
            and math.dist((shape.x, shape.y), theirs["center"]) <= ROUNDING
            and abs(shape.radius - theirs["radius"]) <= ROUNDING
            and same_wall
        )
    if isinstance(shape, Disc):
        return False
    if kind == "rect":
        corners = np.array(theirs["corners"], np.float64)
        return (
            mine.has_wall and same_wall and _apart(shape.vertices, corners) < ROUNDING
        )
    sides = sorted([shape.length, shape.width]), sorted(theirs["size"])
    return (
        not mine.has_wall
        and math.dist((shape.x, shape.y), theirs["center"]) <= ROUNDING
        and math.dist(*sides) <= ROUNDING
    )


@dataclass
class Candidate:
    """One or several of our pieces that may correspond to one of their records."""

    obstacle: Obstacle
    pieces: frozenset[int]
    shapes: list[Footprint]

    @property
    def bounds(self) -> tuple[float, ...]:
        """(left, low, right, high)."""
        edges = np.array([shape.bounds for shape in self.shapes])
        return (*edges[:, :2].min(axis=0), *edges[:, 2:].max(axis=0))


def candidates(world: World) -> Iterator[Candidate]:
    """Each single piece, and each obstacle as a whole."""
    count = 0
    for thing in world.obstacles:
        shapes = [part.shape for part in thing.solid]
        index = range(count, count + len(shapes))
        if len(shapes) > 1:
            yield Candidate(thing, frozenset(index), shapes)
        for k, shape in zip(index, shapes, strict=True):
            yield Candidate(thing, frozenset([k]), [shape])
        count += len(shapes)


def compare_footprints(row: Row, world: World, theirs: list[Record]) -> list[Obstacle]:
    """Pairs their footprints with ours, the best pairs first.

    Returns:
        Our obstacles without a counterpart.
    """
    offers = list(candidates(world))
    pairs = [
        (likeness(record, offer), k, offer)
        for k, record in enumerate(theirs)
        for offer in offers
        if _overlap(offer.bounds, _bounds(record))
    ]
    pairs.sort(key=lambda pair: -pair[0])
    done: dict[int, float] = {}
    used: set[int] = set()
    for value, k, offer in pairs:
        if k not in done and not offer.pieces & used:
            done[k] = value
            used |= offer.pieces
    row.footprints = len(theirs)
    for k, record in enumerate(theirs):
        value = done.get(k, 0.0)
        row.worst = value if row.worst is None else min(row.worst, value)
        if value >= IOU:
            row.matched += 1
        else:
            what = f"{record['kind']} {record['name']}".strip()
            row.problems.append(f"{what}: IoU {value:.3f}")
    row.worst = None if row.worst is None else round(row.worst, 4)
    known = {id(offer.obstacle) for offer in offers if offer.pieces & used}
    return [
        thing for thing in world.obstacles if thing.solid and id(thing) not in known
    ]


def likeness(record: Record, offer: Candidate) -> float:
    """Intersection over union, at least `IOU` for an outline within rounding.

    For a rock it is 1 if the rocks match, otherwise 0.
    """
    if record["kind"] == "Rock":
        return float(offer.obstacle.kind == "Rock" and _is_rock(record, offer))
    outlines = [_outline(shape) for shape in offer.shapes]
    theirs, hole = _record_outline(record), _hole(record)
    if hole is None and len(outlines) > 1 and "radius" in record:
        # Their disc stands for any round shape, with or without a hole.
        outlines = [_hull(np.vstack(outlines))]
    if hole is not None or len(outlines) > 1 or not _is_convex(theirs):
        return _raster_iou(theirs, hole, outlines)
    mine, theirs = outlines[0], _hull(theirs)
    common = _area(_clipped(mine, theirs))
    value = common / (_area(mine) + _area(theirs) - common)
    return max(value, IOU) if _apart(mine, theirs) <= ROUNDING else value


def _hole(record: Record) -> Points | None:
    """The inner circle of a ring."""
    inner = record.get("inner")
    if inner is None and "thickness" in record and "radius" in record:
        inner = record["radius"] - record["thickness"]
    return None if inner is None else _circle(record["center"], inner)


def _is_convex(outline: Points) -> bool:
    whole = _area(_hull(outline))
    return abs(whole - abs(_area(outline))) <= 1e-3 * whole


def _is_rock(record: Record, offer: Candidate) -> bool:
    outline, radius = _outline(offer.shapes[0]), record["radius"]
    reach = np.hypot(*(outline - record["center"]).T).max()
    share = _area(outline) / (math.pi * radius**2)
    inside = reach <= radius + ROUNDING
    return inside and any(abs(share - value) <= 0.01 for value in ROCKS.values())


def _record_outline(record: Record) -> Points:
    if "radius" in record:
        return _circle(record["center"], record["radius"])
    return np.array(record["poly"], np.float64)


def _outline(shape: Footprint) -> Points:
    if isinstance(shape, Disc):
        return _circle((shape.x, shape.y), shape.radius)
    return shape.vertices


def _circle(centre: Sequence[float], radius: float) -> Points:
    turns = 2 * np.pi * np.arange(720) / 720
    unit = np.column_stack([np.cos(turns), np.sin(turns)])
    return np.asarray(unit * radius + centre)


def _bounds(record: Record) -> tuple[float, ...]:
    outline = _record_outline(record)
    return (*outline.min(axis=0), *outline.max(axis=0))


def _overlap(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return (
        one[0] <= other[2]
        and other[0] <= one[2]
        and one[1] <= other[3]
        and other[1] <= one[3]
    )


def _hull(points: Points) -> Points:
    try:
        return Polygon.around(points).vertices
    except TdacError:
        x, y = points.mean(axis=0).tolist()
        return Rectangle(x, y, 0.0, 1e-6, 1e-6).vertices


def _area(points: Points) -> float:
    (x, y), (u, v) = points.T, np.roll(points, -1, axis=0).T
    return float((x * v - u * y).sum() / 2)


def _apart(one: Points, other: Points) -> float:
    """Largest distance from a corner of one outline to the other outline."""
    return max(_off(one, other), _off(other, one))


def _off(points: Points, outline: Points) -> float:
    edge = np.roll(outline, -1, axis=0) - outline
    length = np.maximum((edge**2).sum(axis=1), 1e-18)
    away = points[:, None] - outline
    along = np.clip((away * edge).sum(axis=2) / length, 0.0, 1.0)
    near = np.hypot(*np.moveaxis(away - along[..., None] * edge, 2, 0))
    return float(near.min(axis=1).max())


def _clipped(polygon: Points, window: Points) -> Points:
    """The part of a polygon in a convex window, both counter-clockwise."""
    for start, end in zip(window, np.roll(window, -1, axis=0), strict=True):
        edge = end - start
        side = edge[0] * (polygon[:, 1] - start[1]) - edge[1] * (
            polygon[:, 0] - start[0]
        )
        kept = []
        for k in range(len(polygon)):
            after = (k + 1) % len(polygon)
            if side[k] >= 0:
                kept.append(polygon[k])
            if side[k] * side[after] < 0:
                share = side[k] / (side[k] - side[after])
                kept.append(polygon[k] + share * (polygon[after] - polygon[k]))
        if len(kept) < 3:
            return np.zeros((3, 2))
        polygon = np.array(kept)
    return polygon


def _raster_iou(one: Points, hole: Points | None, others: list[Points]) -> float:
    points = np.vstack([one, *others])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = PIXELS / max(float((high - low).max()), 1e-9)
    size = np.ceil((high - low) * scale).astype(int) + 3

    def drawn(shapes: list[Points]) -> NDArray[np.bool_]:
        layer = np.zeros((size[1], size[0]), np.uint8)
        for shape in shapes:
            fixed = np.rint((shape - low) * scale * 16).astype(np.int32)
            cv2.fillPoly(layer, [fixed], 1, shift=4)
        return layer > 0

    theirs, ours = drawn([one]), drawn(others)
    if hole is not None:
        theirs &= ~drawn([hole])
    return float((theirs & ours).sum() / max((theirs | ours).sum(), 1))


def compare_markers(row: Row, world: World, theirs: list[Record]) -> None:
    """Checks that we read their Solids without a boundingObject as not solid."""
    ours = [thing for thing in world.obstacles if not thing.solid]
    for mark in theirs:
        near = [
            thing
            for thing in ours
            if math.hypot(thing.x - mark["x"], thing.y - mark["y"]) <= 1e-3
        ]
        if near:
            row.markers += 1
        else:
            row.problems.append(f"no marker {mark['name']}")


def account(
    row: Row, world: World, skipped: dict[str, int], extras: list[Obstacle]
) -> None:
    """Checks that we model or list what they skip, and that they skip our extras."""
    listed = Counter(node.kind for node in world.unmodelled)
    listed += Counter(
        word for node in world.unmodelled for word in set(node.why.split())
    )
    own = Counter(thing.kind for thing in extras)
    for name, count in skipped.items():
        kind = name.split()[0].split(":")[-1]
        missing = count - listed[kind]
        for ours in (kind, "Solid"):  # they may skip the geometry of a Solid
            explained = max(min(own[ours], missing), 0)
            own[ours] -= explained
            missing -= explained
        if missing > 0:
            row.problems.append(f"{name}: {count} skipped by them, not listed by us")
    row.problems += [f"{count} {kind} only in ours" for kind, count in (+own).items()]


def show(rows: list[Row]) -> None:
    """Prints the table with the problems below it."""
    table = Table()
    for name in ("world", "version", "ms", "robots", "arenas", "footprints"):
        table.add_column(name, justify="left" if name == "world" else "right")
    for name in ("worst IoU", "markers", "not modelled", ""):
        table.add_column(name, justify="right")
    for row in rows:
        worst = "–" if row.worst is None else f"{row.worst:.4f}"
        table.add_row(
            row.name,
            row.version,
            f"{row.milliseconds:.0f}",
            str(row.robots),
            str(row.arenas),
            f"{row.matched}/{row.footprints}",
            worst,
            str(row.markers),
            str(row.unmodelled),
            "[red]✘[/]" if row.problems else "[green]✔[/]",
        )
    console = Console(width=None if sys.stdout.isatty() else 150)
    console.print(table)
    for row in rows:
        for problem in row.problems:
            console.print(f"{row.name}: {problem}", markup=False, highlight=False)


def summary(rows: list[Row]) -> str:
    """A one-line summary."""
    good = sum(not row.problems for row in rows)
    matched, footprints = sum(r.matched for r in rows), sum(r.footprints for r in rows)
    return (
        f"{good} of {len(rows)} worlds as expected; {matched} of {footprints} "
        f"footprints with an IoU of {IOU} or more"
    )


def main() -> int:
    """Prints the table, or JSON; returns 1 if a world fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    file = args.folder / "expected.json"
    truths = json.loads(file.read_text()) if file.is_file() else {}
    names = sorted({path.name for path in args.folder.glob("*.wbt")} | truths.keys())
    if not names:
        parser.error(f"{args.folder}: no .wbt files in it")
    rows = [measure(args.folder / name, truths.get(name)) for name in names]
    if args.json:
        record = {"rows": [asdict(row) for row in rows], "summary": summary(rows)}
        print(json.dumps(record, indent=1))
    else:
        show(rows)
        print(summary(rows))
    return int(any(row.problems for row in rows))


if __name__ == "__main__":
    sys.exit(main())
