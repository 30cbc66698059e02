"""Every row of the e-puck's suite catches its wrong controllers, and no other does.

Each variant is the builtin controller with one of its functions wrapped: exactly the
unit tests that are meant for it must fail. What is wrong may also show when it drives.
"""

import shutil
from functools import partial

import pytest

from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.verification.verify import verify

PARSE = ["test_parse_world"]
GRIDS = ["test_build_grid[0.0]", "test_build_grid[0.04]"]
HERE = "test_build_grid_of_this_world"
ALL_GRIDS = [*GRIDS, HERE]
THIS = "test_astar_on_this_world"
FORWARD = ["test_drives_forward[blind]", "test_drives_forward[nothing near]"]
SIDES, MIRROR = "test_turns_to_the_side", "test_mirrored_waypoint"
AROUND, SAME, BLOCKED = "test_turns_around", "test_same_wherever_it_is", "test_blocked"
ANGLES = (0.0, 0.6, -1.5, 3.0, "drawn")
TRACKS = [f"test_tracks_a_waypoint[{angle}]" for angle in ANGLES]
WHEELS = [*FORWARD, SIDES, MIRROR, AROUND, SAME, BLOCKED, *TRACKS]
ROBOT, FILE = "test_robot_constants", "test_file_constant"


def parsing(body):
    """`parse_world` with its text, or what it found, changed."""
    return f"""
_parse = parse_world
SEEN = []
def parse_world(text):
{body}
"""


def unread(pattern, instead):
    """`parse_world` that does not understand a part of the file."""
    return parsing(
        f"    return _parse(re.sub({pattern!r}, {instead!r}, text, flags=re.M))"
    )


def found(statement):
    """`parse_world` with what it found changed."""
    return parsing(f"    world = _parse(text)\n    {statement}\n    return world")


def grid(body):
    """`build_grid` with its result changed."""
    return f"""
_build = build_grid
def build_grid(world, resolution, inflation):
    occ, (x0, y0) = _build(world, resolution, inflation)
    {body}
"""


def path(body):
    """`astar` with its result changed."""
    return f"""
_astar = astar
def astar(occ, start, goal):
    path = _astar(occ, start, goal)
    {body}
"""


def wheels(body):
    """`compute_wheel_speeds` with its result changed."""
    return f"""
_wheels = compute_wheel_speeds
def compute_wheel_speeds(pose_xy, yaw, waypoint_xy, prox):
    left, right = _wheels(pose_xy, yaw, waypoint_xy, prox)
    {body}
"""


FIRST_SEEN = 'SEEN.append(dict(world)); world["{0}"] = SEEN[0]["{0}"]'
FOUR = """steps = []
    for a, b in zip(path, path[1:]):
        if a[0] != b[0] and a[1] != b[1]:
            steps.append((b[0], a[1]))
        steps.append(b)
    return path[:1] + steps"""
UNWRAPPED = """dx, dy = waypoint_xy[0] - pose_xy[0], waypoint_xy[1] - pose_xy[1]
    error = math.atan2(dy, dx) - yaw
    if abs(error) > 0.3:
        return (-3.0, 3.0) if error > 0 else (3.0, -3.0)
    return 3.0 - 5.0 * error, 3.0 + 5.0 * error"""

# What is appended to the good controller, and the unit tests that must fail.
WRONG = {
    "start by heart": (found(FIRST_SEEN.format("start")), PARSE),
    "goal by heart": (found(FIRST_SEEN.format("goal")), PARSE),
    "obstacles by heart": (found(FIRST_SEEN.format("obstacles")), GRIDS),
    "arena by heart": (found(FIRST_SEEN.format("arena")), GRIDS),
    "yaw turned round": (
        found('x, y, yaw = world["start"]; world["start"] = (x, y, yaw + 0.1)'),
        PARSE,
    ),
    "boxes not turned": (
        unread(r"(Solid \{\n.*\n  rotation 0 0 1) .*", r"\1 0"),
        ALL_GRIDS,
    ),
    "arena not turned": (
        unread(r"(RectangleArena \{\n.*\n  rotation 0 0 1) .*", r"\1 0"),
        GRIDS,
    ),
    "no rocks": (unread("boundingObject Indexed", "unknown Indexed"), GRIDS),
    "no barrels": (unread("boundingObject Cyl", "unknown Cyl"), ALL_GRIDS),
    "no pipes": (unread("boundingObject Group", "unknown Group"), GRIDS),
    "no things with a DEF": (
        unread(r"^DEF THING_[0-9]+ Solid \{(.|\n)*?^\}", ""),
        GRIDS,
    ),
    "a wider than it is deep": (unread(r"size (\S+) (\S+)", r"size \2 \1"), GRIDS),
    "grid as [x, y]": (grid("return occ.T.copy(), (x0, y0)"), [*ALL_GRIDS, THIS]),
    "grid upside down": (grid("return occ[::-1].copy(), (x0, y0)"), ALL_GRIDS),
    "no inflation": (grid("return _build(world, resolution, 0.0)"), ALL_GRIDS[1:]),
    "always inflated": (
        grid("return _build(world, resolution, inflation + 0.04)"),
        ALL_GRIDS,
    ),
    "grid beside its corner": (
        grid("return occ, (x0 + 3 * resolution, y0)"),
        ALL_GRIDS,
    ),
    "free outside": (
        grid(
            "occ = np.pad(occ, 20, constant_values=False)\n"
            "    return occ, (x0 - 20 * resolution, y0 - 20 * resolution)"
        ),
        ALL_GRIDS,
    ),
    "grid of int": (grid("return occ.astype(int), (x0, y0)"), [*ALL_GRIDS, THIS]),
    "path without start": (path("return path[1:]"), ["test_astar", THIS]),
    "None for no path": (path("return path or None"), ["test_astar"]),
    "four directions": (path(FOUR), ["test_astar", THIS]),
    "wheels swapped": (
        wheels("return right, left"),
        [SIDES, *TRACKS[1:]],
    ),
    "both forward": (
        wheels("return 3.0, 3.0"),
        [SIDES, AROUND, BLOCKED, *TRACKS[1:]],
    ),
    "too fast": (
        wheels("return 9 * left, 9 * right"),
        WHEELS,
    ),
    "pulls to the left": (
        wheels("return 0.8 * left, right"),
        [*FORWARD, MIRROR],
    ),
    "not a number": (wheels("return math.nan, right"), WHEELS),
    "angle not wrapped": (wheels(UNWRAPPED), [SIDES, MIRROR, SAME, BLOCKED]),
    "blind": (
        wheels("return _wheels(pose_xy, yaw, waypoint_xy, None)"),
        [BLOCKED],
    ),
    "never turns": (
        wheels("return (0.0, 0.0) if left * right < 0 else (left, right)"),
        [SIDES, AROUND, *TRACKS[1:]],
    ),
    "another time step": ("\nTIME_STEP = 64\n", [ROBOT]),
    "the goal from afar": ("\nGOAL_TOLERANCE = 0.1\n", [ROBOT]),
    "a longer range": ("\nSENSOR_RANGE = 0.08\n", [ROBOT]),
    "a text for a number": ("\nGOAL_TOLERANCE = '0.02'\n", [ROBOT]),
    "another file": ("\nWORLD_FILE = 'params.json'\n", [FILE]),
}


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """The shipped suite but for its episodes, which say nothing about the rows."""
    folder = tmp_path_factory.mktemp("rows")
    for name in ("test_static.py", "test_unit.py"):
        shutil.copy(EPUCK.suite / name, folder)
    return folder


@pytest.fixture
def checked(crates, rows, warm):
    """Checks a source against the rows."""
    return partial(verify, task=crates, profile="paper", shipped=rows, judge=warm)


def failed(report, group):
    return {
        failure.test.partition("::")[2]
        for failure in report.failures
        if failure.group == group
    }


def test_the_good_one_passes(crates, crates_source, warm):
    """What the variants are made of is verified, in both profiles."""
    for profile, tests in (("paper", 46), ("policy", 21)):
        report = verify(crates_source, crates, profile=profile, judge=warm)
        assert report.failures == ()
        assert report.verdict.expected == tests
        assert report.provenance.suite == "epuck"
        assert report.provenance.unit == "m"


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_one_fails_where_it_is_wrong(checked, crates_source, name):
    """Exactly the unit tests that are about it fail."""
    wrapper, tests = WRONG[name]
    report = checked(crates_source + wrapper)
    assert failed(report, "unit") == set(tests)
    assert failed(report, "static") == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["parse_world", "build_grid", "astar", "compute_wheel_speeds", "run_episode"],
)
def test_a_missing_function_is_named(checked, crates_source, name):
    """The static contract names each function that is not there."""
    report = checked(crates_source.replace(f"def {name}(", f"def other_{name}("))
    message = next(f.message for f in report.failures if "entry_points" in f.test)
    assert name in message


@pytest.mark.slow
def test_speeds_are_metres_a_second(crates, crates_source, warm):
    """`run_episode` that reports rad/s disagrees with the judge's record."""
    spoiled = crates_source + (
        "\n_run = run_episode\ndef run_episode(env, max_steps):\n"
        "    told = _run(env, max_steps)\n"
        "    told['speeds'] = [50.0 * v for v in told['speeds']]\n    return told\n"
    )
    report = verify(spoiled, crates, profile="paper", paper=True, judge=warm)
    assert failed(report, "end to end") == {"test_run_episode_agrees_with_the_judge"}
