"""Unit API (Table I): the controller's own map, utility and planner functions."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tdac_agent.storage.plain import shown
from tdac_agent.verification.suite.every_task import check_constants, check_path
from tdac_agent.verification.suite.several import Several

pytestmark = pytest.mark.paper

REACH, MOST_PIXELS = 30, 20_000


@pytest.fixture
def small_map(controller, oracle):
    """The controller's map object over a grid that is not square."""
    occ = oracle.grid(seed=3, width=37, height=23)
    return occ, controller.call("OccMap2D", occ)


def is_int_pair(value):
    """Whether a value is a pair of Python ints."""
    return (
        isinstance(value, tuple)
        and len(value) == 2
        and all(type(item) is int for item in value)
    )


def test_robot_constants(controller, task):
    """The robot's constants equal params.json."""
    robot = task.params.robot
    expected = {
        "AXLE_LENGTH_PX": robot.axle_length,
        "SENSOR_RANGE_PX": robot.range_max,
        "SENSOR_FOV_DEG": robot.field_of_view_deg,
        "N_RAYS": robot.n_rays,
    }
    check_constants(controller, expected)


@pytest.mark.parametrize("name", ["LOOKAHEAD", "STOP_DIST", "SLOW_DIST"])
def test_tuning_constants(controller, name):
    """The tuning constants are finite numbers that are not negative."""
    value = controller.constant(name)
    good = isinstance(value, int | float) and math.isfinite(value) and value >= 0
    assert good, f"{name} is {shown(value)}, not a finite number >= 0"


@pytest.mark.parametrize("name", ["MAP_IMG", "PARAMS_JSON", "ROBOT_IMG"])
def test_file_constants(controller, name):
    """The file constants name files of the working folder."""
    known = {"occupancy.png", "occupancy.npy", "params.json", "robot.png"}
    value = controller.constant(name)
    assert isinstance(value, str), f"{name} is {shown(value)}, not a file name"
    base = value.replace("\\", "/").rsplit("/", 1)[-1]
    assert base in known, f"{name} = {shown(value)}, expected one of {', '.join(known)}"


@pytest.fixture
def this_map(controller, task):
    """The controller's map object over the map of the task."""
    occ = task.nominal.terrain.grid.cells
    return occ, controller.call("OccMap2D", occ)


def test_is_occupied_inside(small_map, this_map, generator):
    """`is_occupied` is right for every pixel of a small map, indexed [y, x].

    It is also right for random pixels, rows and columns of the task's map.
    """
    occ, own = small_map
    check_pixels(occ, own, [(x, y) for y, x in np.ndindex(occ.shape)])
    occ, own = this_map
    random, (height, width) = generator("pixels"), occ.shape
    pixels = random.integers((width, height), size=(200, 2)).tolist()
    for _ in range(2):
        row, column = int(random.integers(height)), int(random.integers(width))
        pixels += [(x, row) for x in range(width)]
        pixels += [(column, y) for y in range(height)]
    check_pixels(occ, own, [(x, y) for x, y in pixels])


def check_pixels(occ, own, pixels):
    """Compares the controller's map with the grid at pixels (x, y)."""
    answers = own.call_each("is_occupied", pixels)
    assert len(answers) == len(pixels), (
        f"is_occupied gave {len(answers)} answers for {len(pixels)} pixels"
    )
    pairs = zip(pixels, answers, strict=True)
    wrong = [(x, y, found) for (x, y), found in pairs if found != occ[y, x]]
    for x, y, found in wrong[:1]:
        pytest.fail(
            f"is_occupied({x}, {y}) is {shown(found)}, not {occ[y, x]}; it is wrong "
            f"for {len(wrong)} of {len(pixels)} pixels [y, x] of this map"
        )


def test_is_occupied_returns_bool(small_map):
    """`is_occupied` returns a Python bool, inside and outside the map."""
    _, own = small_map
    several = Several()
    for x, y in ((0, 0), (5, 4), (36, 22), (-1, 3), (999, 999)):
        found = own.call("is_occupied", x, y)
        kind = f"{type(found).__module__}.{type(found).__name__}"
        with several:
            assert type(found) is bool, f"is_occupied({x}, {y}) is a {kind}, not a bool"
    several.settle()


def test_is_occupied_outside(small_map):
    """Everything outside the map is occupied; nothing wraps around."""
    _, own = small_map
    several = Several()
    for x, y in ((-1, 0), (0, -1), (37, 0), (0, 23), (-37, -23), (22, 36), (10**6, 3)):
        found = own.call("is_occupied", x, y)
        with several:
            assert found, (
                f"is_occupied({x}, {y}) is {shown(found)}, but the pixel is outside a "
                "map of 37 x 23 px"
            )
    several.settle()


def test_nearest_free_of_a_free_pixel(controller, small_map, this_map, generator):
    """The nearest free pixel of a free pixel is itself, as Python ints.

    Tested on a small map, and at random pixels of the task's map.
    """
    occ, own = small_map
    check_free_pixels(controller, own, np.argwhere(~occ)[::40].tolist())
    occ, own = this_map
    drawn = generator("free").integers(occ.shape, size=(24, 2))
    free = drawn[~occ[drawn[:, 0], drawn[:, 1]]]
    check_free_pixels(controller, own, free.tolist())


def check_free_pixels(controller, own, pixels):
    """Checks that free pixels [y, x] are their own nearest free pixels."""
    for y, x in pixels:
        for reach in (10, 0):
            found = controller.call("nearest_free", own, x, y, reach)
            assert is_int_pair(found), f"nearest_free is {shown(found)}, not (int, int)"
            assert found == (x, y), (
                f"nearest_free({x}, {y}, {reach}) is {found}, but ({x}, {y}) is free"
            )


def test_nearest_free_is_nearest(controller, oracle, this_map, generator):
    """From an occupied pixel, the result is the nearest free one, up to max_rad away.

    Tested on a small map, and at random pixels of the task's map.
    """
    occ = oracle.grid(seed=11, width=40, height=30, density=0.85)
    own = controller.call("OccMap2D", occ)
    for y, x in np.argwhere(occ)[::60].tolist():
        best = oracle.nearest_free_distance(occ, x, y)
        check_nearest_free(controller, occ, own, (x, y), best)
    occ, own = this_map
    height, width = occ.shape
    for x, y in generator("nearest").integers((width, height), size=(24, 2)).tolist():
        left, low = max(0, x - REACH), max(0, y - REACH)
        around = occ[low : y + REACH + 1, left : x + REACH + 1]
        best = oracle.nearest_free_distance(around, x - left, y - low)
        if 0 < best <= REACH:
            check_nearest_free(controller, occ, own, (x, y), best)


def check_nearest_free(controller, occ, own, pixel, best):
    """Checks that the result is free and `best` px away."""
    asked = f"nearest_free({pixel[0]}, {pixel[1]})"
    found = controller.call("nearest_free", own, *pixel, math.ceil(best))
    assert is_int_pair(found), f"{asked} is {shown(found)}, not (int, int)"
    x, y = found
    height, width = occ.shape
    inside = 0 <= x < width and 0 <= y < height
    assert inside, f"{asked} is {found}, which is outside the map"
    assert not occ[y, x], f"{asked} is {found}, which is occupied"
    got = math.dist(pixel, found)
    assert got <= best + 1e-9, (
        f"{asked} is {found}, {got:.2f} px away; the nearest is {best:.2f} px away"
    )


def test_nearest_free_at_the_end_of_its_reach(controller):
    """The only free pixel is found in any direction, exactly max_rad away."""
    several = Several()
    for dx, dy in ((5, 0), (-5, 0), (0, 5), (0, -5), (3, -4), (-4, 3)):
        occ = np.ones((21, 31), np.bool_)
        occ[10 + dy, 15 + dx] = False
        own = controller.call("OccMap2D", occ)
        found = controller.call("nearest_free", own, 15, 10, 5)
        only = (15 + dx, 10 + dy)
        with several:
            assert found == only, (
                f"nearest_free(15, 10, 5) is {shown(found)}, not {only}"
            )
    several.settle()


def test_nearest_free_raises(controller):
    """ValueError if there is no free pixel within max_rad."""
    occ = np.ones((21, 31), np.bool_)
    occ[2, 2] = False
    own = controller.call("OccMap2D", occ)
    message = "nearest_free without a free pixel within max_rad"
    # The free pixel of the second case is 5 px away, but at most 4 px in x and in y.
    for x, y, max_rad in ((25, 15, 5), (5, 6, 4)):
        error = controller.error_of("nearest_free", own, x, y, max_rad)
        assert error is not None, f"{message} returned instead of raising ValueError"
        assert error.type_name == "ValueError", f"{message} raised {error.type_name}"


def test_plan_path(controller, oracle, task, this_map, generator):
    """Paths are ints, complete, free, connected; with cell 1 <= 1.1 x optimum, or [].

    Tested on fixed and random grids, and between random pixels of the task's map.
    """
    several = Several()
    for case in oracle.plan_cases():
        own = controller.call("OccMap2D", case.occ)
        path = controller.call("plan_path", own, case.start, case.goal, 1)
        with several:
            check_path(oracle, case, path, is_int_pair)
    for cell in (2, 3):
        with several:
            check_larger_steps(controller, oracle, cell)
    with several:
        check_walks(controller, oracle, task, this_map, generator("walks"))
    several.settle()


def check_larger_steps(controller, oracle, cell):
    """Checks steps of `cell` px to a goal that is a whole number of steps away."""
    occ = np.zeros((40, 60), np.bool_)
    occ[12:, 28:32] = True
    occ[6:9, 20] = occ[13, 40:44] = True
    own = controller.call("OccMap2D", occ)
    check_steps(controller, oracle, (occ, own), (4, 17), (52, 23), cell)


def check_walks(controller, oracle, task, this_map, random):
    """Checks paths between random pixels of the task's map."""
    occ, _ = this_map
    # A search over all pixels of a large map may exceed the time limit of a call, so
    # larger steps are used; these must only be found where there is more room.
    room = task.nominal.terrain.clear
    cell = math.ceil(math.sqrt(occ.size / MOST_PIXELS))
    while cell > 1 and room.max() <= 2 * cell:
        cell //= 2
    tight = occ if cell == 1 else room <= 2 * cell
    for start, goal in oracle.walks(tight, cell, random):
        path = check_steps(controller, oracle, this_map, start, goal, cell)
        best = oracle.shortest_length(occ, start, goal) if cell == 1 else math.inf
        length = oracle.path_length(path)
        assert length <= 1.1 * best + 1e-6, (
            f"the path from {start} to {goal} has {length:.1f} px, more than 1.1 x the "
            f"shortest ({best:.1f} px)"
        )


def check_steps(controller, oracle, map_and_own, start, goal, cell):
    """Checks a path from start to goal in steps of `cell` px, and returns it."""
    occ, own = map_and_own
    path = controller.call("plan_path", own, start, goal, cell)
    about = f"plan_path with cell {cell}"
    assert isinstance(path, list), f"{about}: a {type(path).__name__}, not a list"
    assert path, f"{about}: [], but there is a path from {start} to {goal}"
    assert all(map(is_int_pair, path)), f"{about}: points must be (int, int)"
    ends = (path[0], path[-1])
    assert ends == (start, goal), f"{about}: ends {ends}, not {(start, goal)}"
    for (x0, y0), (x1, y1) in pairwise(path):
        step = f"{about}: ({x0}, {y0}) -> ({x1}, {y1})"
        sizes = {abs(x1 - x0), abs(y1 - y0)}
        assert sizes in ({cell}, {0, cell}), f"{step} is not one step of {cell} px"
        dx, dy = (x1 - x0) // cell, (y1 - y0) // cell
        passed = [(x0 + k * dx, y0 + k * dy) for k in range(cell + 1)]
        error = oracle.path_error(occ, passed)
        assert error is None, f"{step}: {error}"
    return path
