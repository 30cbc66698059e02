"""Shortest paths and bottlenecks against slow and obvious answers."""

import heapq
import math

import numpy as np
import pytest
from brute_force import distance

from tdac_envs.grid.grid import body_free, clearance
from tdac_envs.grid.plan import distance_field
from tdac_envs.ladder.passages import bottleneck, touched_corners
from tdac_envs.ladder.shortest import shortest_path

SIDE, RADIUS = 34, 3.0


def boxes(seed, n=6):
    """A small map of boxes, with two places where the disc fits."""
    random = np.random.default_rng(seed)
    cells = np.zeros((SIDE, SIDE), bool)
    for _ in range(n):
        x, y = random.integers(0, SIDE, 2)
        w, h = random.integers(1, 13, 2)
        cells[y : y + h, x : x + w] = True
    free = np.argwhere(body_free(clearance(cells), RADIUS))[:, ::-1]
    pair = random.choice(len(free), 2, replace=False) if len(free) > 1 else [0, 0]
    start, goal = free[pair].tolist()
    return cells, tuple(start), tuple(goal)


def length(cells, start, goal, radius=RADIUS):
    """Of the shortest path; inf without one."""
    padded = np.pad(clearance(cells), 1)
    path = shortest_path(cells, padded, start, goal, radius)
    return math.inf if path is None else path.length


def visibility_graph(cells, start, goal, radius):
    """Dijkstra between points on circles around all corners of all squares.

    The points are 2 degrees apart, so arcs become chords that sink into the circle by
    1.5e-4 of the radius, which is allowed for.
    """
    slack = 2e-4 * radius + 1e-6
    j, i = np.nonzero(touched_corners(cells))
    angles = np.radians(np.arange(0, 360, 2))
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    around = np.stack([i - 0.5, j - 0.5], axis=1)[:, None] + ring
    around = around.reshape(-1, 2)
    room = distance(cells, around[:, 0], around[:, 1])
    around = around[room >= radius - slack]
    points = np.array([start, goal, *around], float)
    best, queue, done = np.full(len(points), np.inf), [(0.0, 0)], set()
    best[0] = 0.0
    while queue:
        g, at = heapq.heappop(queue)
        if at == 1:
            return g
        if at in done:
            continue
        done.add(at)
        lengths = np.hypot(*(points - points[at]).T)
        nearer = np.flatnonzero(g + lengths < best - 1e-12)
        for to in nearer[are_free(cells, points[at], points[nearer], radius - slack)]:
            best[to] = g + lengths[to]
            heapq.heappush(queue, (best[to], int(to)))
    return math.inf


def are_free(cells, begin, ends, body):
    """Whether a disc can drive on each of the lines: distances to all squares."""
    j, i = np.nonzero(np.pad(cells, 1, constant_values=True))
    corners = np.stack([i - 1, j - 1], 1)[:, None] + np.array(
        [[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]]
    )
    corners, squares = np.unique(corners.reshape(-1, 2), axis=0, return_counts=True)
    # A line meets others only after these: they are inside of a wall.
    off = corners[squares < 4] - begin
    along = ends - begin
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    free = np.ones(len(ends), bool)
    for few in np.array_split(np.arange(len(ends)), len(ends) // 64 + 1):
        part = np.clip(off @ along[few].T / square[few], 0.0, 1.0)
        x, y = (off[:, axis, None] - part * along[few, axis] for axis in (0, 1))
        free[few] = (x * x + y * y >= body * body).all(axis=0)
    return free


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_the_shortest_path_is_that_of_a_visibility_graph(seed):
    """It is neither longer nor shorter; so nothing drives faster than OT."""
    cells, start, goal = boxes(seed)
    exact = visibility_graph(cells, start, goal, RADIUS)
    assert length(cells, start, goal) == pytest.approx(exact, abs=0.03)


@pytest.mark.parametrize("seed", range(100, 160))
def test_bounds_of_the_shortest_path(seed):
    """It is as long backwards, at least straight, and at most a path on the grid."""
    cells, start, goal = boxes(seed, n=9)
    field = distance_field(body_free(clearance(cells), RADIUS), goal)
    found = length(cells, start, goal)
    if found == math.inf:
        assert field[start[::-1]] == math.inf
        return
    assert found == pytest.approx(length(cells, goal, start), abs=1e-5)
    assert math.dist(start, goal) - 1e-9 <= found <= field[start[::-1]] + 1e-9


@pytest.mark.parametrize("seed", range(200, 230))
def test_the_points_of_the_path_are_free_and_as_long(seed):
    """Arcs are drawn by points, so they are a little shorter."""
    cells, start, goal = boxes(seed, n=8)
    padded = np.pad(clearance(cells), 1)
    path = shortest_path(cells, padded, start, goal, RADIUS)
    if path is None:
        return
    assert (distance(cells, *path.points.T) >= RADIUS - 2e-6).all()
    drawn = np.hypot(*np.diff(path.points, axis=0).T).sum()
    assert path.length * (1 - 1e-3) <= drawn <= path.length + 1e-9
    assert tuple(path.points[0]) == start
    assert tuple(path.points[-1]) == goal


def test_a_path_around_one_wall_by_hand():
    """Two tangents and two quarter circles around the end of a thin wall."""
    cells = np.zeros((60, 60), bool)
    cells[:40, 30] = True
    # The corners are (29.5, 39.5) and (30.5, 39.5). Each end is 9 px beside its corner
    # and 12 px above, so 15 px away.
    start, goal, r = (20.5, 27.5), (39.5, 27.5), 5.0
    tangent = math.sqrt(15.0**2 - r**2)
    # The arc spans what is left of the angle between the line from corner to end and
    # the line straight down, after the angle at the corner of the tangent's triangle.
    turn = math.pi / 2 + math.atan2(12.0, 9.0) - math.acos(r / 15.0)
    expected = 2 * tangent + 2 * r * turn + 1.0
    assert length(cells, start, goal, r) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("width", [5, 6, 7, 8])
def test_the_bottleneck_of_a_corridor_is_half_its_width(width):
    """Of an odd or even number of pixels, along both axes."""
    cells = np.ones((30, 60), bool)
    cells[5:25, 2:20] = cells[5:25, 40:58] = False
    cells[10 : 10 + width, 20:40] = False
    found = bottleneck(cells, clearance(cells), (10, 15), (50, 15))
    assert found == pytest.approx(width / 2)
    turned = np.ascontiguousarray(cells.T)
    found = bottleneck(turned, clearance(turned), (15, 10), (15, 50))
    assert found == pytest.approx(width / 2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_the_bottleneck_is_that_of_a_fine_lattice(seed):
    """Less than half a px below; 0 where nothing gets through."""
    cells, start, goal = boxes(300 + seed, n=8)
    fine = 8
    ticks = np.arange(fine * SIDE) / fine - 0.5 + 0.5 / fine
    x, y = np.meshgrid(ticks, ticks)
    rooms = np.concatenate([distance(cells, a, b) for a, b in zip(x, y, strict=True)])
    rooms = rooms.reshape(x.shape)
    at = [tuple(int((v + 0.5) * fine) for v in point[::-1]) for point in (start, goal)]
    exact = widest(rooms, *at)
    found = bottleneck(cells, clearance(cells), start, goal)
    if exact == 0.0:
        assert found == 0.0
    assert exact - 0.5 <= found <= exact + 0.2


def widest(rooms, start, goal):
    """The greatest of the smallest values on paths, by a heap."""
    queue, seen = [(-rooms[start], start)], {start}
    while queue:
        room, (j, i) = heapq.heappop(queue)
        if (j, i) == goal:
            return -room
        for to in ((j + 1, i), (j - 1, i), (j, i + 1), (j, i - 1)):
            inside = 0 <= to[0] < rooms.shape[0] and 0 <= to[1] < rooms.shape[1]
            if inside and to not in seen and rooms[to] > 0:
                seen.add(to)
                heapq.heappush(queue, (max(room, -rooms[to]), to))
    return 0.0
