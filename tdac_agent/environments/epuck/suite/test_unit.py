"""Component logic (Table II): the controller's parser, grid, planner and wheels."""

import math

import numpy as np
import pytest

from tdac_agent.environments.epuck.oracle import occupied_at
from tdac_agent.storage.plain import shown
from tdac_agent.verification.suite.every_task import check_constants, check_path
from tdac_agent.verification.suite.several import Several

pytestmark = pytest.mark.paper

FREE, NEAR = 67.19, 2000.0
PLACES = [(0.0, 0.0, 0.0), (0.4, -0.3, 2.0), (-1.2, 0.7, -2.9), (0.1, 0.1, 3.1)]
INFLATIONS = (0.0, 0.04)


@pytest.fixture(scope="module")
def cases(oracle, task, generator):
    """This task's world, and modified copies, one of which is random."""
    return oracle.world_cases(task.nominal.ground.world, generator("world"))


@pytest.fixture(scope="module")
def places(task, generator):
    """Fixed poses, the start, and random poses around it."""
    x, y, yaw = task.nominal.start
    drawn = generator("places").uniform((-0.5, -0.5, -3.0), (0.5, 0.5, 3.0), (3, 3))
    others = [(x + dx, y + dy, turned) for dx, dy, turned in drawn.tolist()]
    return [*PLACES, (x, y, yaw), *others]


def numbers(value, count, name):
    """Checks a tuple, list or array of `count` finite numbers; returns floats."""
    assert isinstance(value, list | tuple | np.ndarray), (
        f"{name} is {shown(value)}, not {count} numbers"
    )
    assert len(value) == count, f"{name} has {len(value)} numbers, not {count}"
    found = [float(v) for v in value]
    assert all(map(math.isfinite, found)), f"{name} is {shown(value)}, not finite"
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
    """The constants of robot and task equal those of params.json."""
    params = task.params
    expected = {
        "TIME_STEP": 1000 * params.dt,
        "MAX_WHEEL_SPEED": params.robot.max_wheel_speed,
        "SENSOR_RANGE": params.robot.sensor_range,
        "GOAL_TOLERANCE": params.goal_tolerance,
    }
    check_constants(controller, expected)


def test_file_constant(controller):
    """`WORLD_FILE` names the world file of the working folder."""
    value = controller.constant("WORLD_FILE")
    assert isinstance(value, str), f"WORLD_FILE is {shown(value)}, not a file name"
    base = value.replace("\\", "/").rsplit("/", 1)[-1]
    assert base == "world.wbt", f"WORLD_FILE = {shown(value)}, expected 'world.wbt'"


def test_parse_world(controller, cases):
    """`parse_world` finds start and goal, also in moved and turned copies."""
    several = Several()
    for case in cases:
        world = controller.call("parse_world", case.text)
        with several:
            check_world(several, case, world)
    several.settle()


def check_world(several, case, world):
    """Compares what the controller's parser found with the world."""
    assert isinstance(world, dict), (
        f"{case.name}: parse_world returned a {type(world).__name__}, not a dict"
    )
    missing = {"start", "goal", "arena", "obstacles"} - set(world)
    assert not missing, f"{case.name}: missing keys: {', '.join(sorted(missing))}"
    with several:
        x, y, yaw = numbers(world["start"], 3, f"{case.name}: start")
        off = math.dist((x, y), case.start[:2])
        assert off <= 1e-3, f"{case.name}: start ({x}, {y}), not {case.start[:2]}"
        turn = abs(math.remainder(yaw - case.start[2], math.tau))
        assert turn <= 1e-2, f"{case.name}: start yaw {yaw}, not {case.start[2]}"
    with several:
        goal = numbers(world["goal"], 2, f"{case.name}: goal")
        off = math.dist(goal, case.goal)
        assert off <= 1e-3, f"{case.name}: goal {tuple(goal)}, not {case.goal}"


@pytest.mark.parametrize("inflation", INFLATIONS)
def test_build_grid(controller, cases, inflation):
    """The grid is right at sample points that are not near boundaries."""
    several = Several()
    for case in cases:
        with several:
            check_grid(controller, case, case.resolution(), inflation)
    several.settle()


def test_build_grid_of_this_world(controller, cases, generator):
    """The grid of this world is right for random resolutions and inflations."""
    random, case = generator("grids"), cases[0]
    for _ in range(2):
        size = case.resolution() * float(random.uniform(1.0, 1.5))
        check_grid(controller, case, size, float(random.uniform(0.03, 0.07)))


def check_grid(controller, case, size, inflation):
    """Compares a grid with the oracle at sample points."""
    world = controller.call("parse_world", case.text)
    grid = controller.call("build_grid", world, size, inflation)
    occ, origin = checked_grid(grid, case.name)
    # The centre of a point's cell, which decides, may be half a diagonal away.
    margin = 0.75 * size + 1e-3
    wrong = [
        (point, occupied)
        for point, occupied in case.samples(inflation, margin)
        if occupied_at(occ, origin, size, point) != occupied
    ]
    assert not wrong, f"{case.name}: {described(wrong, size, inflation)}"


def checked_grid(grid, name):
    """Checks a controller's grid; returns an array of bool and its corner."""
    assert isinstance(grid, tuple | list), (
        f"{name}: build_grid returned a {type(grid).__name__}, not (occ, (x0, y0))"
    )
    assert len(grid) == 2, f"{name}: {len(grid)} values, not (occ, (x0, y0))"
    occ = np.asarray(grid[0])
    assert occ.ndim == 2, f"{name}: occ has {occ.ndim} dimensions, not 2"
    assert occ.dtype == bool, f"{name}: occ has the dtype {occ.dtype}, not bool"
    x0, y0 = numbers(grid[1], 2, f"{name}: the corner of the grid")
    return occ, (x0, y0)


def described(wrong, size, inflation):
    """Returns a message about the first wrong point of a grid."""
    (x, y), occupied = wrong[0]
    words = ("free", "occupied") if occupied else ("occupied", "free")
    return (
        f"build_grid is wrong at {len(wrong)} points with resolution {size:g} and "
        f"inflation {inflation:g}; the cell at ({x:.3f}, {y:.3f}) is {words[0]}, not "
        f"{words[1]}"
    )


def test_astar(controller, oracle):
    """Paths are complete, free, connected, cut no corners, <= 1.1 x optimum, or []."""
    several = Several()
    for case in oracle.plan_cases():
        path = controller.call("astar", case.occ, case.start, case.goal)
        if isinstance(path, list):
            path = [tuple(p) if isinstance(p, list) else p for p in path]
        with several:
            check_path(oracle, case, path, is_whole_pair, "cells")
    several.settle()


def test_astar_on_this_world(controller, oracle, cases, generator):
    """Paths on the controller's grid: from start to goal, and between random cells."""
    case, size = cases[0], 0.01
    world = controller.call("parse_world", case.text)
    grid = controller.call("build_grid", world, size, 0.04)
    occ, (x0, y0) = checked_grid(grid, case.name)
    ends = [
        (math.floor((x - x0) / size), math.floor((y - y0) / size))
        for x, y in (case.start[:2], case.goal)
    ]
    inside = all(0 <= x < occ.shape[1] and 0 <= y < occ.shape[0] for x, y in ends)
    assert inside, (
        f"start and goal are in the cells {ends}, outside the grid of shape [y, x] "
        f"{occ.shape}"
    )
    for start, goal in (ends, *oracle.walks(occ, 1, generator("walks"))):
        check_cells(controller, oracle, occ, start, goal)


def check_cells(controller, oracle, occ, start, goal):
    """Checks a path of free cells from start to goal, or [] if there is none."""
    best = oracle.shortest_length(occ, start, goal)
    path = controller.call("astar", occ, start, goal)
    about = f"astar from {start} to {goal}"
    assert isinstance(path, list), f"{about}: a {type(path).__name__}, not a list"
    if math.isinf(best):
        assert path == [], f"{about}: {len(path)} cells, but there is no path"
        return
    assert path, f"{about}: [], but there is a path of {best:.1f} cells"
    cells = [tuple(map(int, cell)) for cell in path]
    error = oracle.path_error(occ, cells)
    assert error is None, f"{about}: {error}"
    ends = cells[0], cells[-1]
    assert ends == (start, goal), f"{about}: the ends of the path are {ends}"
    length = oracle.path_length(cells)
    assert length <= 1.1 * best + 1e-6, (
        f"{about}: {length:.1f} cells long, more than 1.1 x the shortest ({best:.1f})"
    )


@pytest.fixture(scope="module")
def wheels(controller, task):
    """Calls `compute_wheel_speeds`, whose result must be two numbers in the limits."""
    limit = task.params.robot.max_wheel_speed

    def ask(pose, waypoint, prox=None):
        x, y, yaw = pose
        found = controller.call("compute_wheel_speeds", (x, y), yaw, waypoint, prox)
        left, right = numbers(found, 2, "compute_wheel_speeds")
        most = max(abs(left), abs(right))
        assert most <= limit + 1e-6, (
            f"compute_wheel_speeds: {most:.2f} rad/s, more than {limit:g}"
        )
        return left, right

    return ask


def ahead(pose, forward, left):
    """Returns a point in front of and to the left of a pose, m."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x + forward * cos - left * sin, y + forward * sin + left * cos


@pytest.mark.parametrize("prox", [None, [FREE] * 8], ids=["blind", "nothing near"])
def test_drives_forward(wheels, places, prox):
    """To a waypoint straight ahead, both wheels turn forwards at about equal speeds."""
    for pose in places:
        left, right = wheels(pose, ahead(pose, 0.3, 0.0), prox)
        speeds = f"wheel speeds ({left:.2f}, {right:.2f}) at yaw {pose[2]}, waypoint"
        assert min(left, right) > 0.0, f"{speeds} straight ahead: not both above 0"
        assert abs(left - right) <= 0.05 * max(left, right), (
            f"{speeds} straight ahead: they differ by more than 5 %"
        )


def test_turns_to_the_side(wheels, places, generator):
    """To a waypoint on the left, the right wheel is faster, and vice versa."""
    drawn = generator("side").uniform(0.35, 2.4, 4)
    for pose, angle in with_angles(places, (0.35, 0.8, 1.6, 2.4), drawn):
        forward, side = 0.3 * math.cos(angle), 0.3 * math.sin(angle)
        left, right = wheels(pose, ahead(pose, forward, side))
        speeds = f"wheel speeds ({left:.2f}, {right:.2f})"
        assert right > left, f"{speeds}, waypoint {angle} rad to the left"
        left, right = wheels(pose, ahead(pose, forward, -side))
        speeds = f"wheel speeds ({left:.2f}, {right:.2f})"
        assert left > right, f"{speeds}, waypoint {angle} rad to the right"


def with_angles(places, usual, drawn):
    """Combines the usual places with usual angles, and the others with random ones.

    A controller may change its rule at a round angle; the result then depends on
    rounding errors, and so on the place.
    """
    known = [(pose, angle) for pose in PLACES for angle in usual]
    others = places[len(PLACES) :]
    return known + [(pose, angle) for pose in others for angle in drawn.tolist()]


def test_mirrored_waypoint(wheels, places, generator):
    """A waypoint mirrored at the heading swaps the wheel speeds."""
    drawn = generator("mirror").uniform(0.1, 2.2, 4)
    for pose, angle in with_angles(places, (0.1, 0.5, 1.3, 2.2), drawn):
        forward, side = 0.25 * math.cos(angle), 0.25 * math.sin(angle)
        one = wheels(pose, ahead(pose, forward, side), [FREE] * 8)
        other = wheels(pose, ahead(pose, forward, -side), [FREE] * 8)
        assert np.allclose(one, other[::-1], atol=1e-2), (
            f"wheel speeds {one}, waypoint {angle} rad to the left; {other} for the "
            "mirrored waypoint, not the same speeds swapped"
        )


def test_turns_around(wheels, places):
    """To a waypoint behind it, the robot turns."""
    for pose in places:
        left, right = wheels(pose, ahead(pose, -0.3, 0.001))
        assert abs(left - right) >= 0.5, (
            f"wheel speeds ({left:.2f}, {right:.2f}), waypoint right behind: they "
            "differ by less than 0.5 rad/s"
        )


def test_same_wherever_it_is(wheels, places):
    """The speeds stay the same if robot and waypoint are moved and turned together."""
    for forward, side in ((0.3, 0.02), (0.2, 0.1), (0.05, -0.2)):
        pairs = [wheels(pose, ahead(pose, forward, side)) for pose in places]
        for pose, found in zip(places[1:], pairs[1:], strict=True):
            assert np.allclose(found, pairs[0], atol=1e-2), (
                f"wheel speeds {found} at {pose}, but {pairs[0]} at {places[0]} for "
                "the same waypoint relative to the robot"
            )


def test_blocked(wheels, places, task):
    """With an obstacle right ahead it stops, creeps, reverses or turns."""
    limit = task.params.robot.max_wheel_speed
    prox = [NEAR, *[FREE] * 6, NEAR]
    for pose in places:
        left, right = wheels(pose, ahead(pose, 0.3, 0.0), prox)
        forward, turn = (left + right) / 2, abs(right - left) / 2
        assert forward <= 0.15 * limit or turn >= forward, (
            f"wheel speeds ({left:.2f}, {right:.2f}) with ps0 and ps7 at {NEAR:g}: it "
            "drives on"
        )


@pytest.mark.parametrize("angle", [0.0, 0.6, -1.5, 3.0, "drawn"])
def test_tracks_a_waypoint(wheels, places, task, generator, angle):
    """With exact unicycle motion its speeds lead to the waypoint."""
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
        f"waypoint {far:g} m away, {angle:g} rad off the heading: the robot gets no "
        f"nearer than {nearest:.3f} m in {steps} steps of {task.nominal.dt:g} s"
    )


def unicycle(pose, left, right, task):
    """Returns the pose after a step of constant wheel speeds."""
    robot, dt = task.params.robot, task.nominal.dt
    x, y, yaw = pose
    arc = (left + right) / 2 * robot.wheel_radius * dt
    turn = (right - left) * robot.wheel_radius / robot.axle_length * dt
    chord = arc * np.sinc(turn / math.tau)
    middle = yaw + turn / 2
    return x + chord * math.cos(middle), y + chord * math.sin(middle), yaw + turn
