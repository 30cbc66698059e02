"""Component logic (Table II): the controller's parser, grid, planner and wheels."""

import math

import numpy as np
import pytest

from tdac_agent.environments.epuck.oracle import occupied_at
from tdac_agent.storage.plain import shown
from tdac_agent.verification.suite.every_task import check_path

pytestmark = pytest.mark.paper

FREE, NEAR = 67.19, 2000.0
PLACES = [(0.0, 0.0, 0.0), (0.4, -0.3, 2.0), (-1.2, 0.7, -2.9), (0.1, 0.1, 3.1)]
INFLATIONS = (0.0, 0.04)


@pytest.fixture(scope="module")
def cases(oracle, task, generator):
    """This task's world, and copies of it that are not the same; one copy is drawn."""
    return oracle.world_cases(task.nominal.ground.world, generator("world"))


@pytest.fixture(scope="module")
def places(task, generator):
    """Poses: fixed ones, the start, and some in this world that are drawn."""
    x, y, yaw = task.nominal.start
    drawn = generator("places").uniform((-0.5, -0.5, -3.0), (0.5, 0.5, 3.0), (3, 3))
    others = [(x + dx, y + dy, turned) for dx, dy, turned in drawn.tolist()]
    return [*PLACES, (x, y, yaw), *others]


def numbers(value, count, name):
    """A tuple, list or array of so many finite numbers, as floats."""
    assert isinstance(value, list | tuple | np.ndarray), f"{name} is {shown(value)}"
    assert len(value) == count, f"{name} has {len(value)} numbers, not {count}"
    found = [float(v) for v in value]
    assert all(map(math.isfinite, found)), f"{name} is {shown(value)}: not finite"
    return found


def is_whole_pair(value):
    """Whether a value is a pair of whole numbers."""
    return (
        isinstance(value, tuple | list)
        and len(value) == 2
        and all(isinstance(v, int | np.integer) for v in value)
        and not any(isinstance(v, bool) for v in value)
    )


def test_robot_constants(controller, task):
    """The constants of robot and task equal params.json."""
    params = task.params
    expected = {
        "TIME_STEP": 1000 * params.dt,
        "MAX_WHEEL_SPEED": params.robot.max_wheel_speed,
        "SENSOR_RANGE": params.robot.sensor_range,
        "GOAL_TOLERANCE": params.goal_tolerance,
    }
    for name, value in expected.items():
        found = controller.constant(name)
        assert isinstance(found, int | float), f"{name} is {shown(found)}, not a number"
        assert math.isclose(found, value, rel_tol=1e-6), (
            f"{name} = {shown(found)}, not {value:g}"
        )


def test_file_constant(controller):
    """`WORLD_FILE` names the world of the working folder."""
    value = controller.constant("WORLD_FILE")
    assert isinstance(value, str), f"WORLD_FILE is {shown(value)}, not a file name"
    base = value.replace("\\", "/").rsplit("/", 1)[-1]
    assert base == "world.wbt", f"WORLD_FILE = {shown(value)}, expected 'world.wbt'"


def test_parse_world(controller, cases):
    """Start and goal of this world and of copies that were moved and turned."""
    for case in cases:
        world = controller.call("parse_world", case.text)
        assert isinstance(world, dict), f"{case.name}: {type(world).__name__}, no dict"
        missing = {"start", "goal", "arena", "obstacles"} - set(world)
        assert not missing, f"{case.name}: missing {', '.join(sorted(missing))}"
        x, y, yaw = numbers(world["start"], 3, f"{case.name}: start")
        off = math.dist((x, y), case.start[:2])
        assert off <= 1e-3, f"{case.name}: start ({x}, {y}), not {case.start[:2]}"
        turn = abs(math.remainder(yaw - case.start[2], math.tau))
        assert turn <= 1e-2, f"{case.name}: start yaw {yaw}, not {case.start[2]}"
        goal = numbers(world["goal"], 2, f"{case.name}: goal")
        off = math.dist(goal, case.goal)
        assert off <= 1e-3, f"{case.name}: goal {tuple(goal)}, not {case.goal}"


@pytest.mark.parametrize("inflation", INFLATIONS)
def test_build_grid(controller, cases, inflation):
    """At sampled points, clear of boundaries: occupied, or free."""
    for case in cases:
        check_grid(controller, case, case.resolution(), inflation)


def test_build_grid_of_this_world(controller, cases, generator):
    """The same with cells and inflations that are drawn."""
    random, case = generator("grids"), cases[0]
    for _ in range(2):
        size = case.resolution() * float(random.uniform(1.0, 1.5))
        check_grid(controller, case, size, float(random.uniform(0.03, 0.07)))


def check_grid(controller, case, size, inflation):
    """A grid at the points of a world, of which it is known what is there."""
    world = controller.call("parse_world", case.text)
    grid = controller.call("build_grid", world, size, inflation)
    occ, origin = checked_grid(grid, case.name)
    # What counts is a cell's centre, which may be half a diagonal away.
    margin = 0.75 * size + 1e-3
    wrong = [
        (point, occupied)
        for point, occupied in case.samples(inflation, margin)
        if occupied_at(occ, origin, size, point) != occupied
    ]
    assert not wrong, f"{case.name}: {told(wrong, size, inflation)}"


def checked_grid(grid, name):
    """A grid as an array of bool, and its corner."""
    assert isinstance(grid, tuple | list), f"{name}: a {type(grid).__name__}"
    assert len(grid) == 2, f"{name}: {len(grid)} values, not (occ, (x0, y0))"
    occ = np.asarray(grid[0])
    assert occ.ndim == 2, f"{name}: occ has {occ.ndim} dimensions"
    assert occ.dtype == bool, f"{name}: occ is of {occ.dtype}, not bool"
    x0, y0 = numbers(grid[1], 2, f"{name}: the corner of the grid")
    return occ, (x0, y0)


def told(wrong, size, inflation):
    """What is wrong with a grid, by its first point."""
    (x, y), occupied = wrong[0]
    words = ("free", "occupied") if occupied else ("occupied", "free")
    return (
        f"{len(wrong)} points are wrong with resolution {size:g} and inflation "
        f"{inflation:g}; the cell at ({x:.3f}, {y:.3f}) is {words[0]}, not {words[1]}"
    )


def test_astar(controller, oracle):
    """Both ends, free, connected, no cut corners, <= 1.1 x optimum, or []."""
    for case in oracle.plan_cases():
        path = controller.call("astar", case.occ, case.start, case.goal)
        if isinstance(path, list):
            path = [tuple(p) if isinstance(p, list) else p for p in path]
        check_path(oracle, case, path, is_whole_pair)


def test_astar_on_this_world(controller, oracle, cases, generator):
    """On its grid: from start to goal, and between cells that are drawn."""
    case, size = cases[0], 0.01
    world = controller.call("parse_world", case.text)
    grid = controller.call("build_grid", world, size, 0.04)
    occ, (x0, y0) = checked_grid(grid, case.name)
    ends = [
        (math.floor((x - x0) / size), math.floor((y - y0) / size))
        for x, y in (case.start[:2], case.goal)
    ]
    inside = all(0 <= x < occ.shape[1] and 0 <= y < occ.shape[0] for x, y in ends)
    assert inside, f"start and goal are cells {ends} of {occ.shape[::-1]}"
    for start, goal in (ends, *oracle.walks(occ, 1, generator("walks"))):
        check_cells(controller, oracle, occ, start, goal)


def check_cells(controller, oracle, occ, start, goal):
    """A path of free cells from start to goal, or [] where there is none."""
    best = oracle.shortest_length(occ, start, goal)
    path = controller.call("astar", occ, start, goal)
    assert isinstance(path, list), f"a {type(path).__name__}, not a list"
    if math.isinf(best):
        assert path == [], f"{len(path)} cells, but there is no path"
        return
    assert path, f"[], but a path of {best:.1f} cells exists"
    cells = [tuple(map(int, cell)) for cell in path]
    error = oracle.path_error(occ, cells)
    assert error is None, error
    runs = cells[0], cells[-1]
    assert runs == (start, goal), f"runs {runs}, not {start} to {goal}"
    length = oracle.path_length(cells)
    assert length <= 1.1 * best + 1e-6, (
        f"{length:.1f} cells long, the shortest from {start} to {goal} is {best:.1f}"
    )


@pytest.fixture(scope="module")
def wheels(controller, task):
    """`compute_wheel_speeds`, its result checked: two numbers within the limit."""
    limit = task.params.robot.max_wheel_speed

    def ask(pose, waypoint, prox=None):
        x, y, yaw = pose
        found = controller.call("compute_wheel_speeds", (x, y), yaw, waypoint, prox)
        left, right = numbers(found, 2, "compute_wheel_speeds")
        most = max(abs(left), abs(right))
        assert most <= limit + 1e-6, f"{most:.2f} rad/s, more than {limit:g}"
        return left, right

    return ask


def ahead(pose, forward, left):
    """A point in front of, and to the left of, a pose."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x + forward * cos - left * sin, y + forward * sin + left * cos


@pytest.mark.parametrize("prox", [None, [FREE] * 8], ids=["blind", "nothing near"])
def test_drives_forward(wheels, places, prox):
    """Straight ahead: both wheels forward, and about equally fast."""
    for pose in places:
        left, right = wheels(pose, ahead(pose, 0.3, 0.0), prox)
        assert min(left, right) > 0.0, f"({left:.2f}, {right:.2f}) straight ahead"
        assert abs(left - right) <= 0.05 * max(left, right), (
            f"({left:.2f}, {right:.2f}) straight ahead at yaw {pose[2]}"
        )


def test_turns_to_the_side(wheels, places, generator):
    """Left of the heading: the right wheel is faster; on the right, the left one."""
    drawn = generator("side").uniform(0.35, 2.4, 4)
    for pose, angle in with_angles(places, (0.35, 0.8, 1.6, 2.4), drawn):
        forward, side = 0.3 * math.cos(angle), 0.3 * math.sin(angle)
        left, right = wheels(pose, ahead(pose, forward, side))
        assert right > left, f"({left:.2f}, {right:.2f}), {angle} rad to the left"
        left, right = wheels(pose, ahead(pose, forward, -side))
        assert left > right, f"({left:.2f}, {right:.2f}), {angle} rad to the right"


def with_angles(places, usual, drawn):
    """The usual angles at the usual places, and at all others those that are drawn.

    A round angle may be where a controller's rule changes: there the place matters.
    """
    known = [(pose, angle) for pose in PLACES for angle in usual]
    others = places[len(PLACES) :]
    return known + [(pose, angle) for pose in others for angle in drawn.tolist()]


def test_mirrored_waypoint(wheels, places, generator):
    """A waypoint mirrored at the heading swaps the wheels."""
    drawn = generator("mirror").uniform(0.1, 2.2, 4)
    for pose, angle in with_angles(places, (0.1, 0.5, 1.3, 2.2), drawn):
        forward, side = 0.25 * math.cos(angle), 0.25 * math.sin(angle)
        one = wheels(pose, ahead(pose, forward, side), [FREE] * 8)
        other = wheels(pose, ahead(pose, forward, -side), [FREE] * 8)
        assert np.allclose(one, other[::-1], atol=1e-2), (
            f"{one} and {other}, {angle} rad to the left and to the right"
        )


def test_turns_around(wheels, places):
    """Behind: it turns."""
    for pose in places:
        left, right = wheels(pose, ahead(pose, -0.3, 0.001))
        assert abs(left - right) >= 0.5, f"({left:.2f}, {right:.2f}), right behind"


def test_same_wherever_it_is(wheels, places):
    """Moved and turned together, robot and waypoint give the same speeds."""
    for forward, side in ((0.3, 0.02), (0.2, 0.1), (0.05, -0.2)):
        pairs = [wheels(pose, ahead(pose, forward, side)) for pose in places]
        for pose, found in zip(places[1:], pairs[1:], strict=True):
            assert np.allclose(found, pairs[0], atol=1e-2), (
                f"{found} at {pose}, {pairs[0]} at {places[0]}"
            )


def test_blocked(wheels, places, task):
    """With something right ahead it stands, creeps, backs or turns."""
    limit = task.params.robot.max_wheel_speed
    prox = [NEAR, *[FREE] * 6, NEAR]
    for pose in places:
        left, right = wheels(pose, ahead(pose, 0.3, 0.0), prox)
        forward, turn = (left + right) / 2, abs(right - left) / 2
        assert forward <= 0.15 * limit or turn >= forward, (
            f"({left:.2f}, {right:.2f}) with ps0 and ps7 at {NEAR:g}"
        )


@pytest.mark.parametrize("angle", [0.0, 0.6, -1.5, 3.0, "drawn"])
def test_tracks_a_waypoint(wheels, places, task, generator, angle):
    """On the exact unicycle its speeds lead to the waypoint."""
    pose, far = (0.3, -0.2, 2.8), 0.3
    if angle == "drawn":
        pose, angle = places[-1], float(generator("track").uniform(-3.0, 3.0))
    target = ahead(pose, far * math.cos(angle), far * math.sin(angle))
    nearest, steps = far, round(20.0 / task.nominal.dt)
    for _ in range(steps):
        pose = unicycle(pose, *wheels(pose, target), task)
        nearest = min(nearest, math.dist(pose[:2], target))
        if nearest <= task.params.goal_tolerance:
            return
    pytest.fail(
        f"a waypoint {far:g} m away, {angle:g} rad off the heading: {nearest:.3f} m "
        f"from it at best, after {steps} steps of {task.nominal.dt:g} s"
    )


def unicycle(pose, left, right, task):
    """The pose after a step of constant wheel speeds."""
    robot, dt = task.params.robot, task.nominal.dt
    x, y, yaw = pose
    way = (left + right) / 2 * robot.wheel_radius * dt
    turn = (right - left) * robot.wheel_radius / robot.axle_length * dt
    chord = way * np.sinc(turn / math.tau)
    middle = yaw + turn / 2
    return x + chord * math.cos(middle), y + chord * math.sin(middle), yaw + turn
