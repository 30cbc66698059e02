"""Generated worlds for the e-puck are the same everywhere, and feasible."""

import hashlib
import math

import numpy as np
import pytest
from pydantic import ValidationError

from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.paths import widest_body
from tdac_envs.ladder.generators.blocks import Box, Cylinder, raster
from tdac_envs.ladder.plate_worlds import PlatesSpec, make_plates
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.footprint import Rectangle
from tdac_envs.worlds.wbt.reader import read_world
from tdac_envs.worlds.wbt.writer import write_world

SPEC = PlatesSpec()
GOLDEN = [
    "dcda6ddc0fe02f4f",
    "6518cfe7f1ff21c0",
    "a1440c07a9328fe8",
    "a5f2b0c35c6c22ad",
]
"""First digits of the hashes of three worlds, and of those of fifty."""


def key(index):
    """The key of a world of the tests."""
    return world_key(b"tests", "0" * 64, "test", index, "world")


def digest(world):
    """Hash of the file of a world."""
    return hashlib.sha256(write_world(world.world).encode()).hexdigest()


@pytest.mark.slow
def test_golden_worlds():
    """The first three worlds, and the first fifty as one hash of hashes."""
    found = [digest(make_plates(SPEC, key(index))) for index in range(50)]
    whole = hashlib.sha256("".join(found).encode()).hexdigest()
    assert [text[:16] for text in (*found[:3], whole)] == GOLDEN
    assert digest(make_plates(SPEC, key(1))) == found[1]


@pytest.mark.parametrize("index", range(8))
def test_a_world_is_written_and_read_back_the_same(index):
    """The file that Webots opens is the world that was drawn."""
    world = make_plates(SPEC, key(100 + index)).world
    assert read_world(write_world(world)) == world


@pytest.mark.parametrize("index", range(8))
def test_worlds_fulfil_their_conditions(index):
    """Judged on the exact geometry, by the functions of TDAC-EPuck-v0."""
    made = make_plates(SPEC, key(200 + index))
    figures, world = made.difficulty, made.world
    start, goal = world.robot.pose[:2], world.goal
    env = EPuckEnv(world, goal_tolerance=SPEC.tolerance, dt=SPEC.dt)
    assert env.nominal.full_step == pytest.approx(SPEC.step)
    assert 60.0 <= figures.steps <= 40.0 / SPEC.dt
    assert figures.steps == pytest.approx((figures.length - 0.08) / 0.01256, abs=1e-3)
    assert figures.detour >= 1.3
    detour = figures.length / math.dist(start, goal)
    assert figures.detour == pytest.approx(detour, abs=1e-4)
    # Nothing is shorter than L, and no passage on the way narrower than the gap.
    corners = env.nominal.shortest_path(env.nominal.start)
    pulled = np.hypot(*np.diff(corners, axis=0).T).sum()
    assert figures.length <= pulled + 1e-6 <= 1.1 * figures.length + 0.05
    widest = widest_body(Ground.of(world), start, goal)
    assert widest >= SPEC.min_gap * BODY_RADIUS - 0.004
    assert figures.gap * BODY_RADIUS <= widest + 0.004
    assert np.allclose([made.path[0], made.path[-1]], [start, goal])


@pytest.mark.parametrize("index", range(8))
def test_sizes_are_as_asked(index):
    """Sides of the floor, and straight passages between the plates."""
    made = make_plates(SPEC.model_copy(), key(300 + index))
    floor = made.world.arena.inside
    assert 1.2 <= floor.width <= floor.length <= 2.0
    plates = [t.solid[0].shape for t in made.world.obstacles if "plate" in t.name]
    assert {plate.width for plate in plates} <= {0.01, 0.015, 0.02}
    left, low, right, high = floor.bounds
    for across, edges in ((0, {left, right}), (1, {low, high})):
        sides = [
            (plate.bounds[across], plate.bounds[across + 2])
            for plate in plates
            if plate.bounds[across + 2] - plate.bounds[across] < 0.021
        ]
        sides = sorted({tuple(round(float(x), 6) for x in pair) for pair in sides})
        ends = [min(edges), *(x for pair in sides for x in pair), max(edges)]
        gaps = [b - a for a, b in zip(ends[::2], ends[1::2], strict=True)]
        assert min(gaps) >= 0.22 - 1e-6
        if len(gaps) > 1 and max(gaps) > 0.3 + 1e-6:
            # Two passages and the plate that was left out between them.
            assert max(gaps) >= 0.44


@pytest.mark.parametrize(
    "block", [Box(50, -30, 61, 37, 33), Box(20, 10, 200, 20), Cylinder(-41, 7, 33)]
)
def test_the_rasters_enclose_a_block(block):
    """Checked at many points: within the one, the block, within the other."""
    inner, outer = (raster(80, 60, (block,), touched) for touched in (False, True))
    assert (inner <= outer).all()
    random = np.random.default_rng(0)
    for x, y in random.uniform((-0.19, -0.14), (0.19, 0.14), (4000, 2)):
        column, row = math.floor(x / 0.005 + 41), math.floor(y / 0.005 + 31)
        inside = block.shape.contains(x, y)
        assert inner[row, column] <= inside <= outer[row, column]
    area = np.mean([cells[1:-1, 1:-1].sum() for cells in (inner, outer)])
    true = block.shape.area
    assert area * 25e-6 == pytest.approx(true, rel=0.1)
    assert isinstance(block, Cylinder) or isinstance(block.shape, Rectangle)


def test_a_set_without_a_feasible_world_says_so():
    """After a bounded number of drafts, with the reasons."""
    spec = PlatesSpec(min_detour=500, tries=3)
    with pytest.raises(TaskError, match=r"3 drafts of 'plates' \(3 × no start is far"):
        make_plates(spec, key(0))
    spec = PlatesSpec(max_seconds=1, tries=3)
    with pytest.raises(TaskError, match="the shortest path is too long"):
        make_plates(spec, key(0))


@pytest.mark.parametrize(
    "wrong", [{"sides": [2.0, 1.2]}, {"thickness": [0.0, 0.01]}, {"side": [1, 2]}]
)
def test_wrong_parameters_are_refused(wrong):
    """Bands in the wrong order, plates that are too thin, unknown keys."""
    with pytest.raises(ValidationError):
        PlatesSpec.model_validate({"generator": wrong})
