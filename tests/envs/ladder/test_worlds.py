"""Generated worlds are the same everywhere, and their tasks are feasible."""

import hashlib
import math
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from brute_force import distance
from pydantic import ValidationError

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import Pose
from tdac_envs.ladder.admission import Admitted, Rejection, admit
from tdac_envs.ladder.dead_ends import RangeSensor, dead_ends
from tdac_envs.ladder.generators.draft import WorldDraft, as_places
from tdac_envs.ladder.generators.registry import GENERATORS
from tdac_envs.ladder.random_stream import RandomStream, world_key
from tdac_envs.ladder.worlds import LadderWorld, WorldSpec, make_world
from tdac_envs.map2d.task import make_task
from tdac_envs.mapping.params import RobotParams
from tdac_envs.mapping.ray_angles import fan

NAMES = sorted(GENERATORS)
GOLDEN = {
    "aisles": [
        "5395b1791de06bab",
        "9b02331a798439ff",
        "6b7ca25631191147",
        "604a1e8258e8852c",
    ],
    "caves": [
        "d37967f3e25ccff1",
        "8858d3444c57ca7b",
        "984b48265d8e0444",
        "98d98e55aab32009",
    ],
    "clutter": [
        "6a88d40fca923dc5",
        "848f8da5717290f4",
        "afa3dc6a41c27166",
        "037f7c57893982e6",
    ],
    "mazes": [
        "83ab5fcc9bdd5470",
        "47888bfb48e8c659",
        "582b3acf3495fc7a",
        "3e9594d6fac4a31a",
    ],
    "rooms": [
        "0b3581319932db9a",
        "6cd007c1cd3cef78",
        "0b70ed10a964b313",
        "c1daec1bac9698f9",
    ],
}
"""First digits of the hashes of three worlds, and of those of a hundred."""


def key(index):
    """The key of a world of the tests."""
    return world_key(b"tests", "0" * 64, "test", index, "world")


def spec_of(name, **more):
    """A specification with the default parameters."""
    return WorldSpec.model_validate({"generator": {"name": name}, **more})


def digest(world):
    """Hash of all that a task consists of."""
    task = (world.cells.shape, world.start, world.goal)
    text = repr((task, world.difficulty, world.rejected)).encode()
    return hashlib.sha256(np.packbits(world.cells).tobytes() + text).hexdigest()


def geometry(world):
    """Hash of what no library function with an inexact last bit has touched."""
    text = repr((world.cells.shape, world.start, world.goal)).encode()
    return hashlib.sha256(np.packbits(world.cells).tobytes() + text).hexdigest()


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", NAMES)
def test_golden_worlds(name):
    """The first three worlds, and the first hundred as one hash of hashes."""
    spec = spec_of(name)
    found = [geometry(make_world(spec, key(index))) for index in range(100)]
    whole = hashlib.sha256("".join(found).encode()).hexdigest()
    assert [text[:16] for text in (*found[:3], whole)] == GOLDEN[name]


SCRIPT = """
import sys
sys.path[:0] = sys.argv[1:3]
from test_worlds import NAMES, digest, key, make_world, spec_of
print(*(digest(make_world(spec_of(n), key(i))) for i in (2, 0, 1) for n in NAMES))
"""


@pytest.mark.slow
def test_worlds_are_equal_in_another_order_and_another_process():
    """No world depends on those made before it."""
    here = [
        digest(make_world(spec_of(name), key(index)))
        for index in (0, 1, 2)
        for name in reversed(NAMES)
    ]
    own = Path(__file__).parent
    folders = [str(own), str(own.parent)]
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, *folders],
        check=True,
        capture_output=True,
        text=True,
    )
    there = ran.stdout.split()
    n = len(NAMES)
    again = [there[order * n : (order + 1) * n][::-1] for order in (1, 2, 0)]
    assert here == [text for part in again for text in part]


@pytest.mark.slow_after(6)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("index", range(4))
def test_worlds_fulfil_their_conditions(name, index):
    """Judged by slow functions, and accepted as a task of TDAC-Map2D-v0."""
    spec = spec_of(name)
    world = make_world(spec, key(1000 + index))
    figures, (x, y) = world.difficulty, world.goal
    assert world.cells.shape == (220, 220)
    assert figures.gap >= spec.min_gap
    assert figures.detour >= GENERATORS[name].min_detour
    assert figures.steps >= spec.min_steps
    assert figures.steps == pytest.approx((figures.length - 4.0) / 3.0, abs=1e-4)
    straight = math.dist(world.start[:2], world.goal)
    assert figures.detour == pytest.approx(figures.length / straight, abs=1e-4)
    assert figures.density == pytest.approx(world.cells.mean(), abs=1e-4)
    assert 0.0 <= figures.in_sight <= 1.0
    # From all places near the goal where the body fits, it can drive straight to it.
    room = math.hypot(spec.radius, spec.tolerance)
    assert distance(world.cells, x, y) >= room - 1e-6
    # The straight drive touches something before it is within the tolerance.
    parts = np.linspace(0.0, 1.0 - spec.tolerance / straight, 500)
    line = world.start.x + parts * (x - world.start.x)
    across = world.start.y + parts * (y - world.start.y)
    assert distance(world.cells, line, across).min() < spec.radius
    robot = RobotParams(radius=spec.radius)
    task = make_task(world.terrain, world.start, world.goal, robot)
    np.testing.assert_array_equal(task.field, world.field)
    assert (distance(world.cells, *world.path[::5].T) >= spec.radius - 1e-5).all()


def drawn(cells, places, **conditions):
    """The result of admission for a draft by hand."""
    usual = {"radius": 4, "min_steps": 10, "min_detour": 1.1}
    spec = spec_of("clutter", **{**usual, **conditions})
    draft = WorldDraft(np.array(cells, bool), as_places(places))
    return admit(draft, RandomStream(bytes(32)), spec.conditions)


def walled(opening):
    """A wall across a floor of 80 x 60 px, with an opening at its lower end."""
    cells = np.zeros((60, 80), bool)
    cells[: 60 - opening, 38:42] = True
    return cells


def test_each_condition_rejects():
    """A draft for each, by hand."""
    ends = [(10, 10), (70, 10)]
    assert isinstance(drawn(walled(20), ends), Admitted)
    assert drawn(walled(20), [(2, 2), (77, 3)]) is Rejection.CROWDED
    assert drawn(walled(20), []) is Rejection.CROWDED
    assert drawn(walled(0), ends) is Rejection.NEAR
    assert drawn(walled(20), [(10, 10), (10, 12)]) is Rejection.NEAR
    assert drawn(walled(9), ends, min_gap=1.2) is Rejection.NARROW
    # The disc fits through the slit, but no path of pixels does.
    slit = walled(20)
    slit[6:14] = False
    through = drawn(slit, [(10, 9), (70, 10)], radius=3.95)
    assert through is Rejection.STRAIGHT


def test_a_set_without_a_feasible_world_says_so():
    """After a bounded number of drafts, with the reasons."""
    spec = spec_of("mazes", min_steps=5000, tries=7)
    with pytest.raises(TaskError, match=r"7 drafts of 'mazes' \(7 × no start is far"):
        make_world(spec, key(0))


def test_small_maps_do_not_break_a_generator():
    """They have no feasible world, which is an error that says so."""
    for name in NAMES:
        small = {"name": name, "width": 16, "height": 40}
        spec = WorldSpec.model_validate({"generator": small, "tries": 5})
        with pytest.raises(TaskError, match=f"5 drafts of '{name}'"):
            make_world(spec, key(0))


@pytest.mark.parametrize("name", NAMES)
def test_maps_need_not_be_square(name):
    """Also turned ones have the width and height that were asked for."""
    size = {"name": name, "width": 260, "height": 180}
    spec = WorldSpec.model_validate({"generator": size, "min_detour": 1.05})
    shapes = {make_world(spec, key(index)).cells.shape for index in range(4)}
    assert shapes == {(180, 260)}


@pytest.mark.parametrize(
    "wrong",
    [
        {"generator": {"name": "maze"}},
        {"generator": {"name": "mazes", "loop": 0.1}},
        {"generator": {"name": "mazes", "corridors": [2.0, 1.5]}},
        {"generator": {"name": "mazes"}, "radius": 0},
    ],
)
def test_wrong_parameters_are_refused(wrong):
    """Unknown names, unknown keys, bands in the wrong order, sizes of nothing."""
    with pytest.raises(ValidationError):
        WorldSpec.model_validate(wrong)


def test_a_draft_is_turned_with_its_places():
    """The same pixels are marked afterwards, for all eight positions."""
    cells = np.zeros((3, 5), bool)
    cells[0, 1] = cells[2, 4] = cells[1, 0] = True
    draft = WorldDraft(cells, as_places([(1, 0), (4, 2), (0, 1)]))
    seen = set()
    for quarters in range(4):
        for mirrored in (False, True):
            turned = draft.turned(quarters, mirrored)
            x, y = turned.places.T
            assert turned.cells[y, x].all()
            assert turned.cells.sum() == 3
            seen.add((turned.cells.shape, turned.cells.tobytes()))
    assert len(seen) == 8


def test_a_world_is_pickled():
    """A pool of worlds is kept by other code."""
    world = make_world(spec_of("aisles"), key(3))
    assert digest(pickle.loads(pickle.dumps(world))) == digest(world)


SENSOR = RangeSensor(fan(110.0, 18), 60.0)


def test_a_blind_alley_is_a_dead_end():
    """A pocket that opens towards the start costs a robot its depth, twice."""
    cells = np.zeros((120, 200), bool)
    cells[30:34, 60:150] = cells[86:90, 60:150] = True
    cells[30:90, 146:150] = True
    spec = spec_of("clutter", radius=6, tolerance=5, min_steps=1, min_detour=1.0)
    found = None
    for seed in range(20):
        draft = WorldDraft(cells, as_places([(20, 60), (180, 60)]))
        found = admit(draft, RandomStream(bytes([seed] * 32)), spec.conditions)
        if isinstance(found, Admitted) and found.start == (20, 60):
            break
    start, goal = Pose(20.0, 60.0, 0.0), (180.0, 60.0)
    rest = (found.field, found.path, found.difficulty, ())
    world = LadderWorld(found.terrain, start, goal, *rest)
    lured = dead_ends(world, spec.radius, SENSOR)
    assert 0.1 < lured.depth < 0.5
    assert lured.excess > lured.depth
    all_seeing = dead_ends(world, spec.radius, RangeSensor(fan(360.0, 720), 400.0))
    assert all_seeing.depth < lured.depth
