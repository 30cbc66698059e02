"""Independent checks of the functions of a 2D controller, without our oracles."""

from __future__ import annotations

import ast
import heapq
import itertools
import math
import random
from collections.abc import Iterator
from typing import Any

import numpy as np
from skimage.measure import label

from tdac_agent.sandbox import Child, ControllerError
from tdac_agent.tasks.task import Task

Point = tuple[int, int]
Cells = list[list[bool]]
SEED = 20_240_717


def contract_violations(child: Child, task: Task, text: str) -> Iterator[str]:
    """Violations of the contract of profile `paper` by a file and its functions."""
    yield from guard_faults(ast.parse(text))
    yield from _constants(child, task)
    draw = random.Random(SEED)
    for _ in range(4):
        yield from _occupancy(child, random_map(draw))
    for _ in range(25):
        yield from _nearest(
            child, random_map(draw, draw.choice([0.5, 0.8, 0.97])), draw
        )
    for _ in range(40):
        cells = random_map(draw, draw.choice([0.0, 0.15, 0.3, 0.4]))
        yield from _planning(child, cells, draw, cell=1)
    for size in (2, 3):
        yield from _planning(child, random_map(draw, 0.02), draw, cell=size)


def guard_faults(tree: ast.Module) -> Iterator[str]:
    """Missing parts of `main()` and its guard."""
    last = ast.unparse(tree.body[-1])
    if not (last.startswith("if __name__") and "main()" in last):
        yield "no guard"
    main = next((n for n in tree.body if getattr(n, "name", "") == "main"), None)
    if main is None or "show(policy" not in ast.unparse(main):
        yield "main does not show the policy"


def _constants(child: Child, task: Task) -> Iterator[str]:
    robot = task.nominal.robot
    wanted = {
        "AXLE_LENGTH_PX": robot.axle_length,
        "SENSOR_RANGE_PX": robot.range_max,
        "SENSOR_FOV_DEG": robot.field_of_view_deg,
        "N_RAYS": robot.n_rays,
    }
    for name, value in wanted.items():
        found = child.get(name)
        if not isinstance(found, int | float) or abs(found - value) > 1e-6 * value:
            yield f"{name} is {found!r}"
    for name in ("LOOKAHEAD", "STOP_DIST", "SLOW_DIST"):
        found = child.get(name)
        if not isinstance(found, int | float) or not 0 <= found < math.inf:
            yield f"{name} is {found!r}"
    for name, files in (
        ("MAP_IMG", ("occupancy.png", "occupancy.npy")),
        ("PARAMS_JSON", ("params.json",)),
        ("ROBOT_IMG", ("robot.png",)),
    ):
        if not str(child.get(name)).endswith(files):
            yield f"{name} is {child.get(name)!r}"


def random_map(draw: random.Random, density: float = 0.3) -> Cells:
    """Rows of cells, True = occupied."""
    width, height = draw.randint(5, 34), draw.randint(5, 26)
    return [[draw.random() < density for _ in range(width)] for _ in range(height)]


def _solid(cells: Cells, x: int, y: int) -> bool:
    inside = 0 <= y < len(cells) and 0 <= x < len(cells[0])
    return not inside or cells[y][x]


def _occupancy(child: Child, cells: Cells) -> Iterator[str]:
    own = child.call("OccMap2D", (np.array(cells),))
    width, height = len(cells[0]), len(cells)
    points = list(itertools.product(range(-2, width + 2), range(-2, height + 2)))
    points += [(-width, -height), (-1, -1), (10**5, 1), (1, -(10**5))]
    for x, y in points:
        found = child.call((own, "is_occupied"), (x, y))
        if found is not _solid(cells, x, y):
            yield f"is_occupied({x}, {y}) is {found!r}"


def _nearest(child: Child, cells: Cells, draw: random.Random) -> Iterator[str]:
    own = child.call("OccMap2D", (np.array(cells),))
    free = [
        (x, y)
        for y, row in enumerate(cells)
        for x, solid in enumerate(row)
        if not solid
    ]
    for _ in range(6):
        x, y = draw.randrange(len(cells[0])), draw.randrange(len(cells))
        best = min((math.dist((x, y), point) for point in free), default=math.inf)
        limit = draw.choice([3, 50, *([] if math.isinf(best) else [math.ceil(best)])])
        try:
            found = child.call("nearest_free", (own, x, y, limit))
        except ControllerError as error:
            if best <= limit or error.type_name != "ValueError":
                yield f"nearest_free({x}, {y}, {limit}): {error.type_name}"
            continue
        good = _is_point(found) and found in free
        if not good or best > limit or math.dist((x, y), found) > best + 1e-9:
            yield f"nearest_free({x}, {y}, {limit}) is {found!r}"


def _is_point(value: Any) -> bool:
    return type(value) is tuple and [type(v) for v in value] == [int, int]


def _planning(
    child: Child, cells: Cells, draw: random.Random, cell: int
) -> Iterator[str]:
    own = child.call("OccMap2D", (np.array(cells),))
    width, height = len(cells[0]), len(cells)
    for _ in range(3):
        start = draw.randrange(width), draw.randrange(height)
        # With larger cells the goal must be on the lattice of the start.
        goal = (
            draw.randrange(start[0] % cell, width, cell),
            draw.randrange(start[1] % cell, height, cell),
        )
        path = child.call("plan_path", (own, start, goal, cell))
        best = octile_length(cells, start, goal, cell)
        if cell == 1 and math.isfinite(best) != _joined(cells, start, goal):
            raise AssertionError(f"the oracles differ on {cells}")
        reason = path_fault(cells, path, start, goal, cell, best)
        if reason:
            yield f"plan_path {start} -> {goal}, cell {cell}: {reason}"


def path_fault(
    cells: Cells, path: Any, start: Point, goal: Point, cell: int, best: float
) -> str | None:
    """The error in a planner's return value, or None."""
    if type(path) is not list or not all(map(_is_point, path)):
        return f"no list of (int, int): {path!r:.60}"
    return step_fault(cells, path, start, goal, best, cell)


def step_fault(
    cells: Cells,
    path: list[Point],
    start: Point,
    goal: Point,
    best: float,
    cell: int = 1,
) -> str | None:
    """The error in a list of points as a path, or None."""
    if math.isinf(best):
        return "a path where there is none" if path and cell == 1 else None
    if not path or path[0] != start or path[-1] != goal:
        return "does not join start and goal"
    for point, after in itertools.pairwise(path):
        if after not in dict(_steps(cells, point, cell)):
            return f"wrong step {point} -> {after}"
    length = sum(itertools.starmap(math.dist, itertools.pairwise(path)))
    limit = 1.1 if cell == 1 else math.inf
    return f"{length:.1f} px, not {best:.1f}" if length > limit * best + 1e-6 else None


def _steps(cells: Cells, point: Point, cell: int) -> Iterator[tuple[Point, float]]:
    """Neighbours `cell` px away to which every single pixel step is allowed."""
    for dx, dy in itertools.product((-1, 0, 1), repeat=2):
        x, y = point
        for _ in range(cell):
            sides = (x + dx, y + dy), (x + dx, y), (x, y + dy)
            if (dx, dy) == (0, 0) or any(_solid(cells, *side) for side in sides):
                break
            x, y = x + dx, y + dy
        else:
            yield (x, y), cell * math.hypot(dx, dy)


def octile_length(cells: Cells, start: Point, goal: Point, cell: int = 1) -> float:
    """Length of the shortest path by Dijkstra's algorithm; inf without a path."""
    if _solid(cells, *start) or _solid(cells, *goal):
        return math.inf
    best, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        length, point = heapq.heappop(queue)
        if point == goal:
            return length
        for after, step in _steps(cells, point, cell):
            if length + step < best.get(after, math.inf):
                best[after] = length + step
                heapq.heappush(queue, (length + step, after))
    return math.inf


def _joined(cells: Cells, start: Point, goal: Point) -> bool:
    """Whether a path exists; without cut corners, straight steps suffice."""
    parts = label(~np.array(cells), connectivity=1)
    first, last = parts[start[1], start[0]], parts[goal[1], goal[0]]
    return bool(first and first == last)
