"""Every row of the suite catches its wrong controllers, and nothing else does.

Each variant is the controller that passes with one thing spoiled; exactly the tests
that are meant for it must fail.
"""

import pytest

from tdac_agent.verification.suite.hygiene import HYGIENE
from tdac_agent.verification.verify import verify

STATIC, UNIT, END = "test_static.py::", "test_unit.py::", "test_end_to_end.py::"
INSIDE = UNIT + "test_is_occupied_inside"
OUTSIDE = UNIT + "test_is_occupied_outside"
BOOL = UNIT + "test_is_occupied_returns_bool"
RAISES = UNIT + "test_nearest_free_raises"
ROBOT = UNIT + "test_robot_constants"
ROBOT_IMG = UNIT + "test_file_constants[ROBOT_IMG]"
STOP_DIST = UNIT + "test_tuning_constants[STOP_DIST]"
NEAREST = UNIT + "test_nearest_free_is_nearest"
REACH = UNIT + "test_nearest_free_at_the_end_of_its_reach"
ITSELF = UNIT + "test_nearest_free_of_a_free_pixel"
PLAN = UNIT + "test_plan_path"
AGREES = END + "test_run_episode_agrees_with_the_judge"
SCHEMA = END + "test_run_episode_schema"
ARRIVES = END + "test_reaches_goal"

COMMAND = "    left, right = EPISODE[0].command(obs)\n"
HALF_WAY = "    if EPISODE[0].steps > 20:\n        return 0.0, 0.0\n"
FREE = "    if not map2d.is_occupied(i, j):\n        return i, j"
RAISE = 'raise ValueError(f"no free'
PUSH = "heapq.heappush(queue, (price + _octile(after, goal), after))\n"
POSITION = (
    'positions.append((float(obs["pose"][0]), float(obs["pose"][1])))\n        speeds'
)
FIRST = "positions = [(float"
BOUNDS = "0 <= i < self.width and 0 <= j < self.height"
RESET = "    EPISODE[:] = [Driver(obs)]\n"
GIVE_UP = """
    if abs(float(obs["pose"][2])) > 1e-6:
        EPISODE[0].command = lambda obs: (0.0, 0.0)
"""
RETURN = "return min(max(left, -1.0), 1.0), min(max(right, -1.0), 1.0)"
OCCUPIED = "return bool(self.occ[j, i])"
GUARD = "        if not (0 <= i < self.width and 0 <= j < self.height):\n"
TRUE, FALSE = "            return True", "            return False"
DISTANCE2 = "distance2 = (columns + x0 - i) ** 2 + (rows + y0 - j) ** 2"
MANHATTAN = "distance2 = (abs(columns + x0 - i) + abs(rows + y0 - j)) ** 2"
ENDS = "if map2d.is_occupied(*start) or map2d.is_occupied(*goal):\n        return []"
TRACE = "    return path[::-1]\n"
CORNER = "if dx and dy and (map2d.is_occupied(x + dx, y) or"
HEAPPOP = "    queue, cost, parent ="

# What is spoiled: (text in the good controller, text instead, tests that must fail).
WRONG = {
    "numpy bool": (OCCUPIED, OCCUPIED.replace("bool", "np.bool_"), [BOOL]),
    "integer for bool": (OCCUPIED, OCCUPIED.replace("bool", "int"), [BOOL]),
    "free outside": (f"{GUARD}{TRUE}", f"{GUARD}{FALSE}", [OUTSIDE, PLAN]),
    "nearest by Manhattan": (DISTANCE2, MANHATTAN, [NEAREST, REACH]),
    "nearest as NumPy": (
        "return int(columns[best]) + x0,",
        "return columns[best] + x0,",
        [NEAREST],
    ),
    "free pixel moved": (FREE, FREE + " + 1", [ITSELF]),
    "no free pixel, no error": (RAISE, f"return i, j\n        {RAISE}", [RAISES]),
    "another error": (RAISE, RAISE.replace("Value", "Key"), [RAISES]),
    "cut corners": (CORNER, CORNER.replace("if dx", "if False and dx"), [PLAN]),
    "no path": (HEAPPOP, "    return []\n" + HEAPPOP, [PLAN]),
    "start left out": (TRACE, "    return path[::-1][1:]\n", [PLAN]),
    "goal left out": (TRACE, "    return path[::-1][:-1]\n", [PLAN]),
    "path of lists": (TRACE, "    return [list(p) for p in path[::-1]]\n", [PLAN]),
    "path of floats": (
        TRACE,
        "    return [(float(x), y) for x, y in path[::-1]]\n",
        [PLAN],
    ),
    "None for no path": (PUSH + "    return []", PUSH + "    return None", [PLAN]),
    "greedy search": (
        "(price + _octile(after, goal), after)",
        "(_octile(after, goal), after)",
        [PLAN],
    ),
    "wrong axle": ("AXLE_LENGTH_PX = 12.0", "AXLE_LENGTH_PX = 12.5", [ROBOT]),
    "half angle": ("SENSOR_FOV_DEG = 110.0", "SENSOR_FOV_DEG = 55.0", [ROBOT]),
    "negative tuning": ("\nSTOP_DIST = 0.0", "\nSTOP_DIST = -1.0", [STOP_DIST]),
    "another robot": ('ROBOT_IMG = "robot.png"', 'ROBOT_IMG = "x.png"', [ROBOT_IMG]),
    "constant missing": (
        'ROBOT_IMG = "robot.png"',
        "",
        [STATIC + "test_constants", ROBOT_IMG],
    ),
    "no main": (
        "    sensors.show(policy, reset)",
        "    print(policy)",
        [STATIC + "test_main"],
    ),
    "no guard": ('if __name__ == "__main__":\n    main()', "", [STATIC + "test_main"]),
    "stops half way": (COMMAND, COMMAND + HALF_WAY, [ARRIVES]),
    "lying positions": (POSITION, POSITION.replace("[0])", "[0]) + 1"), [AGREES]),
    "lying speeds": (
        "speeds.append((left + right) / 2.0",
        "speeds.append((left + right) / 1.9",
        [AGREES],
    ),
    "lying collisions": (
        '        "collisions": collisions,',
        '        "collisions": collisions + 1,',
        [AGREES],
    ),
    "collisions as float": (
        '        "collisions": collisions,',
        '        "collisions": float(collisions),',
        [SCHEMA],
    ),
    "lying dt": ('        "dt": DT,', '        "dt": 2 * DT,', [AGREES]),
    "lying goal": (
        '        "goal": goal,',
        '        "goal": (goal[0] + 1, goal[1]),',
        [AGREES],
    ),
    "missing key": ('        "dt": DT,\n', "", [SCHEMA, AGREES]),
    "a position too few": (FIRST, FIRST.replace("[(", "[] and [("), [SCHEMA, AGREES]),
    "returns early": (
        "    for _ in range(max_steps):\n",
        "    for _ in range(3):\n",
        [SCHEMA, AGREES],
    ),
}

# Mistakes that show in several places: tests that must fail at least.
BROAD = {
    "no upper bound": (BOUNDS, "0 <= i and 0 <= j", [OUTSIDE, BOOL, PLAN]),
    "negative indices wrap": (
        BOUNDS,
        "i < self.width and j < self.height",
        [OUTSIDE, PLAN],
    ),
    "row and column swapped": (OCCUPIED, OCCUPIED.replace("j, i", "i, j"), [INSIDE]),
    "another map": (
        'MAP_IMG = "occupancy.npy"',
        'MAP_IMG = "/tmp/maze.png"',
        [UNIT + "test_file_constants[MAP_IMG]", ARRIVES],
    ),
    "two arguments": (
        "def policy(obs):",
        "def policy(obs, info):",
        [STATIC + "test_policy_is_defined", END + "test_short_rollout_is_stable[10]"],
    ),
    "swapped wheels": (
        RETURN,
        RETURN.replace("left", "x").replace("right", "left").replace("x", "right", 2),
        [ARRIVES, END + "test_progress"],
    ),
    "three wheels": (
        RETURN,
        f"{RETURN}, 0.0",
        [END + "test_short_rollout_is_stable[10]", SCHEMA],
    ),
    "drives into the wall": (
        RETURN,
        "return 1.0, 1.0",
        [END + "test_no_collisions", ARRIVES],
    ),
    "slow policy": (
        COMMAND,
        f"    __import__('time').sleep(0.06)\n{COMMAND}",
        [END + "test_policy_is_fast_enough"],
    ),
}

# Patterns that no test of behaviour notices, spoiled all at once.
PATTERNS = """

def unused(screen, path):
    import bisect
    import scipy
    time.sleep(1)
    eval("1")
    open(path, "w")
    random.random()
    screen[0]
    try:
        unused(screen, path)
    except:
        raise RuntimeError("no")
"""
WORDS = '''
# eval("1"); exec(x); import os; time.sleep(3); except: pass; raise RuntimeError
WORDS = """import os
eval("1")
except:
open("a", "w")
random.random()
screen[0]
"""
'''


# Second examples of a row: each row keeps one in the normal run.
SECOND = frozenset(
    [
        *("integer for bool", "nearest as NumPy", "another error", "half angle"),
        *("no path", "goal left out", "path of lists", "path of floats"),
        *("None for no path", "no guard", "lying dt", "lying goal"),
        *("a position too few", "another robot"),
    ]
)


def _marked(name):
    return pytest.param(name, marks=pytest.mark.slow if name in SECOND else ())


@pytest.fixture
def failed(small_task, warm):
    """Verifies a source; gives the tests that failed."""

    def failed(source):
        report = verify(source, small_task, paper=True, judge=warm)
        return {failure.test for failure in report.failures}

    return failed


def spoiled(source, old, new):
    assert source.count(old) == 1, "the template has changed"
    return source.replace(old, new)


@pytest.mark.slow_after(3)
@pytest.mark.parametrize("name", [_marked(name) for name in WRONG])
def test_a_wrong_controller_fails_its_test(failed, good_source, name):
    """Exactly the tests meant for it fail."""
    old, new, expected = WRONG[name]
    assert failed(spoiled(good_source, old, new)) == set(expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", BROAD)
def test_a_broadly_wrong_controller_fails(failed, good_source, name):
    """Its own test fails, whatever else does."""
    old, new, expected = BROAD[name]
    assert failed(spoiled(good_source, old, new)) >= set(expected)


@pytest.mark.slow
def test_each_unstable_pattern_fails_its_test(failed, good_source):
    """Import in a function, SciPy, eval, writing, sleeping, swallowing, randomness."""
    source = spoiled(good_source, "import heapq\n", "import heapq\nimport random\n")
    expected = {f"{STATIC}test_hygiene[{pattern}]" for pattern in HYGIENE}
    assert failed(source + PATTERNS) == {*expected, STATIC + "test_imports"}


@pytest.mark.slow
def test_words_in_strings_and_comments_are_harmless(failed, good_source):
    """What merely mentions a forbidden pattern passes."""
    assert failed(good_source + WORDS) == set()


@pytest.mark.slow
def test_a_controller_for_the_nominal_start_only_fails(small_task, good_source, warm):
    """The jittered starts catch what the nominal one does not."""
    source = spoiled(good_source, RESET, RESET + GIVE_UP)
    report = verify(source, small_task, profile="policy", judge=warm)
    failed = {failure.test for failure in report.failures}
    assert failed == {f"{END}test_jittered_start[{n}]" for n in range(1, 6)}
    held_out = [f for f in report.failures if f.test[-2] in "345"]
    assert {failure.message for failure in held_out} == {"failed"}
    assert {failure.diagnosis.cause for failure in held_out} == {"held out"}
