"""Promises of the smallest gap of an episode; dense samples are the oracle."""

import math
from importlib.resources import files

import brute_force
import gymnasium as gym
import numpy as np
import pytest

import tdac_envs
from tdac_envs.drive.gap_search import SLACK
from tdac_envs.drive.smallest_gap import required_gap
from tdac_envs.drive.stepping import FORWARD, TURN
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.map2d.env import Map2DEnv

EXACT = 1e-6
SAMPLES, DIPS = 41, 4


def least(gap_at, arc_length, best):
    """Least gap for parts in [0, 1], by samples that get denser around each dip.

    Dips that cannot be below `best` are left out.
    """
    spans = [(0.0, 1.0)]
    for _ in range(5):
        found = []
        for low, high in spans:
            parts = np.linspace(low, high, SAMPLES)
            gaps, step = gap_at(parts), (high - low) / (SAMPLES - 1)
            best = min(best, float(gaps.min()))
            # A gap changes by at most the way.
            near = np.flatnonzero(gaps - 2.0 * step * arc_length <= best)
            found += [(gaps[k], parts[k], step) for k in near]
        found.sort()
        spans = [(max(p - s, 0.0), min(p + s, 1.0)) for _, p, s in found[:DIPS]]
    return best


def crowded_map(random):
    """A map with blocks, some of one pixel."""
    cells = np.zeros((40, 56), np.bool_)
    for _ in range(9):
        x, y = random.integers(2, 52), random.integers(2, 36)
        wide, high = random.choice([1, 1, 4, 7], 2)
        cells[y : y + high, x : x + wide] = True
    return cells


def map_env(seed, **options):
    random = np.random.default_rng(seed)
    while True:
        try:
            return Map2DEnv(
                map=crowded_map(random),
                start=tuple(random.uniform(4, 36, 2).tolist()),
                goal=tuple(random.uniform(4, 36, 2).tolist()),
                robot_radius=float(random.choice([0.6, 1.5, 2.5])),
                axle_length=4.0,
                max_wheel_speed=float(random.choice([20.0, 75.0, 200.0])),
                goal_tolerance=0.5,
                **options,
            )
        except tdac_envs.TdacError:
            continue


def steps_of(env, seed, count=40):
    """Drives smoothly at random; yields the pose before each step, and `info`."""
    random = np.random.default_rng(seed)
    env.reset(seed=seed)
    yield env.pose(), None
    action = random.uniform(-1, 1, 2)
    for _ in range(count):
        action = np.clip(action + random.normal(0, 0.5, 2), -1.0, 1.0)
        before = env.pose()
        *_, terminated, truncated, info = env.step(action.astype(np.float32))
        yield before, info
        if terminated or truncated:
            return


def piece_places(pieces, parts):
    """Places of a mover after parts of a step, by its pieces, shape (n, 2)."""
    rows = pieces[: int(np.flatnonzero(pieces[:, 0] >= 1.0)[0])]
    row = np.maximum(np.searchsorted(rows[:, 0], parts, side="right") - 1, 0)
    since = (parts - rows[row, 0])[:, None]
    return rows[row, 1:3] + since * rows[row, 3:5]


def map_oracle(env, before, best):
    """Least gap in the last step of an environment on a map, if it is below `best`."""
    cells, state = env.nominal.terrain.grid.cells, env.robot.state
    forward, turn = float(state[FORWARD]), float(state[TURN])
    radius, movers = env.nominal.robot.radius, env.movers
    speed = movers.traits[:, 2].max(initial=0.0) * env.nominal.dt

    def gap_at(parts):
        x, y = brute_force.arc(*before, forward, turn, parts)
        gaps = brute_force.distance(cells, x, y)
        for pieces, traits in zip(movers.pieces, movers.traits, strict=True):
            places = piece_places(pieces, parts)
            off = np.hypot(x - places[:, 0], y - places[:, 1]) - traits[1]
            gaps = np.minimum(gaps, off)
        return gaps - radius

    return least(gap_at, abs(forward) + speed, best)


def end_oracle(env):
    """Gap on a map where the robot is now."""
    x, y, _ = env.pose()
    gap = float(brute_force.distance(env.nominal.terrain.grid.cells, x, y))
    discs = env.discs()
    off = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2]
    return min(gap, off.min(initial=math.inf)) - env.nominal.robot.radius


def world_oracle(env, before, best):
    """Least gap in the last step of an e-puck, if it is below `best`."""
    solid, state = env.nominal.ground.solid, env.robot.state
    forward, turn = float(state[FORWARD]), float(state[TURN])

    def gap_at(parts):
        x, y = brute_force.arc(*before, forward, turn, parts)
        return prism_distance(solid, x, y) - env.nominal.body_radius

    return least(gap_at, abs(forward), best)


def prism_distance(solid, x, y):
    """Distance of points outside of all parts to the nearest part."""
    best = np.full(np.shape(x), np.inf)
    for part in range(len(solid.extent)):
        outline = solid.outline(part)
        if len(outline) == 1:
            off = np.hypot(x - outline[0, 0], y - outline[0, 1])
            best = np.minimum(best, off - solid.extent[part, 3])
            continue
        for (ax, ay), (bx, by) in zip(outline, np.roll(outline, -1, 0), strict=True):
            along = (x - ax) * (bx - ax) + (y - ay) * (by - ay)
            share = np.clip(along / ((bx - ax) ** 2 + (by - ay) ** 2), 0.0, 1.0)
            off = np.hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay))
            best = np.minimum(best, off)
    return best


def check_episode(env, seed, at_end, in_step):
    """The watch agrees with the oracle after each step, also with what is too close.

    The required gap is a radius, so that many gaps are smaller.
    """
    radius = env.nominal.body_radius
    watch, expected, close, most = None, math.inf, math.inf, -math.inf
    for before, info in steps_of(env, seed):
        if info is None:
            watch = env.watch_gap(required=radius)
            expected = at_end(env)
        else:
            limit = min(radius, most - SLACK * radius)
            best = max(expected, min(close, limit))
            gap = 0.0 if info["collision"] else in_step(env, before, best)
            expected = min(expected, gap)
            close = min(close, gap) if gap < limit else close
        most = max(most, at_end(env))
        watch.note()
        assert watch.smallest().gap == pytest.approx(expected, abs=EXACT)
        found = watch.too_close()
        assert (found is None) == (close == math.inf)
        assert found is None or found.gap == pytest.approx(close, abs=EXACT)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_the_gap_to_walls_is_that_of_dense_samples(seed):
    """On random maps, along the arcs, to 1e-6 px; 0 with a contact."""
    check_episode(map_env(seed), seed, end_oracle, map_oracle)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_the_gap_to_movers_is_that_of_dense_samples(seed):
    """The movers' motion within a step counts, with all their turns."""
    movers = [{"kind": "bounce", "count": 3, "speed": 60.0, "radius": 1.5}]
    env = map_env(100 + seed, movers=movers)
    check_episode(env, seed, end_oracle, map_oracle)


@pytest.mark.slow
@pytest.mark.parametrize("world", ["maze", "crates"])
@pytest.mark.parametrize("seed", range(2))
def test_the_gap_in_worlds_is_that_of_dense_samples(world, seed):
    """To all solid parts of an e-puck's world, to 1e-6 m."""
    env = EPuckEnv(world, variation="random", max_wheel_speed=40.0)

    def at_end(env):
        x, y, _ = env.pose()
        solid = env.nominal.ground.solid
        return float(prism_distance(solid, x, y)) - env.nominal.body_radius

    check_episode(env, seed, at_end, world_oracle)


def test_the_place_of_the_gap_is_where_the_body_was_nearest():
    """The pose lies on the arc of the step, and has the gap."""
    for seed in range(4):
        env = map_env(seed)
        poses = []
        for pose, info in steps_of(env, seed):
            if info is None:
                watch = env.watch_gap()
            else:
                poses.append(pose)
            watch.note()
        found = watch.smallest()
        cells, radius = env.nominal.terrain.grid.cells, env.nominal.robot.radius
        gap = float(brute_force.distance(cells, found.x, found.y)) - radius
        assert gap == pytest.approx(found.gap, abs=2e-6)
        if found.step:
            x, y, _ = poses[found.step - 1]
            reach = abs(env.nominal.full_step) + 1e-9
            assert math.hypot(found.x - x, found.y - y) <= reach


AWAY, BACK, SPIN = (0.2, 0.2), (-0.2, -0.2), (0.2, -0.2)
"""Steps of 1 px, and a turn on the spot."""


def between_walls(room, moves):
    """A robot of 10 px radius starts near the left wall, and faces the right one.

    The walls are 30 px and the radii apart; the required gap is 0.5 px.
    """
    cells = np.zeros((60, 80), np.bool_)
    cells[:, :11] = cells[:, 61:] = True
    env = Map2DEnv(
        cells, (20.5 + room, 30.0, 0.0), (40.0, 30.0), robot_radius=10.0,
        max_wheel_speed=100.0, goal_tolerance=0.1,
    )  # fmt: skip
    env.reset(seed=0)
    watch = env.watch_gap()
    watch.note()
    for count, wheels in moves:
        for _ in range(count):
            env.step(np.array(wheels, np.float32))
            watch.note()
    return watch


@pytest.mark.parametrize(
    ("room", "moves", "gap", "side"),
    [
        (0.2, [], None, None),
        (0.2, [(20, AWAY)], None, None),
        (0.2, [(9, SPIN), (4, (0.201, -0.199)), (9, AWAY)], None, None),
        # It came as near to the other wall as it was at the start, and nearer.
        (0.2, [(29, AWAY), (1, (0.1, 0.1))], 0.3, "right"),
        (0.2, [(29, AWAY), (1, (0.13, 0.13))], 0.15, "right"),
        # It went back to its start.
        (0.2, [(20, AWAY), (20, BACK)], 0.2, "left"),
        (0.2, [(1, (-0.03, -0.03))], 0.05, "left"),
        (0.2, [(1, (-0.01, -0.01))], None, None),
        (1.6, [(1, BACK), (9, AWAY)], None, None),
        (1.5, [(1, BACK), (1, (-0.02, -0.02))], 0.4, "left"),
    ],
)
def test_a_start_is_not_too_close_and_what_follows_may_be(room, moves, gap, side):
    """A gap is too close if it is smaller than required and than an earlier one."""
    watch = between_walls(room, moves)
    found = watch.too_close()
    if gap is None:
        assert found is None
        return
    assert found.gap == pytest.approx(gap, abs=EXACT)
    assert found.step > 0
    assert ("left" if found.x < 30 else "right") == side
    assert watch.smallest().gap == pytest.approx(min(gap, room), abs=EXACT)


def test_a_start_next_to_a_mover_is_not_too_close():
    """If the gap only grows from then on."""
    route = {"kind": "route", "points": [[30, 20], [30, 10]], "speed": 4, "phase": 0}
    env = Map2DEnv(
        map=np.zeros((60, 60), np.bool_),
        start=(30, 24.55, math.pi / 2),
        goal=(30, 50),
        robot_radius=2.0,
        movers=[{**route, "radius": 2.5}],
    )
    env.reset(seed=0)
    watch = env.watch_gap()
    watch.note()
    for _ in range(10):
        env.step(np.full(2, 0.2, np.float32))
        watch.note()
    assert watch.smallest().gap == pytest.approx(0.05)
    assert watch.smallest().gap < env.required_gap
    assert watch.too_close() is None


def test_a_mover_that_comes_nearest_is_named():
    """A robot that stands is passed by a mover, never by a wall."""
    route = {"kind": "route", "points": [[10, 33], [50, 33]], "speed": 40.0}
    env = Map2DEnv(
        map=np.zeros((60, 60), np.bool_),
        start=(30, 28),
        goal=(30, 5),
        robot_radius=2.0,
        movers=[{**route, "radius": 2.5}],
    )
    env.reset(seed=0)
    watch = env.watch_gap()
    watch.note()
    for _ in range(40):
        env.step(np.zeros(2, np.float32))
        watch.note()
    found = watch.smallest()
    assert found.mover == 0
    assert found.gap == pytest.approx(0.5, abs=EXACT)
    assert (found.x, found.y) == (30.0, 28.0)


@pytest.mark.parametrize("env_id", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
def test_a_batch_gives_the_same_gaps(env_id):
    """Bit for bit, as its arrays are those of single environments."""
    random = np.random.default_rng(3)
    script = random.uniform(-0.2, 0.2, (25, 2, 2)).astype(np.float32)
    batch = gym.make_vec(env_id, 2, "vector_entry_point", variation="jitter")
    batch.reset(seed=5)
    ours = [batch.unwrapped.watch_gap(robot) for robot in range(2)]
    singles = [gym.make(env_id, variation="jitter").unwrapped for _ in range(2)]
    theirs = []
    for number, env in enumerate(singles):
        env.reset(seed=5 + number)
        theirs.append(env.watch_gap())
    for each in (*ours, *theirs):
        each.note()
    for actions in script:
        batch.step(actions)
        for env, action in zip(singles, actions, strict=True):
            env.step(action)
        for each in (*ours, *theirs):
            each.note()
    assert [each.smallest() for each in ours] == [each.smallest() for each in theirs]
    assert [each.too_close() for each in ours] == [each.too_close() for each in theirs]


def test_a_batch_among_movers_has_no_watch():
    """It does not keep how the movers moved within a step."""
    batch = gym.make_vec(
        "TDAC-Map2D-v0", 2, "vector_entry_point", movers="bounce:1"
    ).unwrapped
    batch.reset(seed=0)
    with pytest.raises(ValueError, match="single environment"):
        batch.watch_gap(0)


def test_the_required_gap_is_the_way_to_stop():
    """At least 5 % of the radius, at most half of what the widest path leaves."""
    assert required_gap(20.0) == 1.0
    assert required_gap(20.0, 0.5) == 1.0
    assert required_gap(20.0, 3.5) == 3.5
    assert required_gap(20.0, 3.5, lambda: 40.0) == 3.5
    assert required_gap(20.0, 3.5, lambda: 24.0) == 2.0
    assert required_gap(20.0, 3.5, lambda: 20.5) == 1.0


def test_a_robot_file_gives_its_stopping_distance(tmp_path):
    """In its units, with or without errors of the pose; a narrow map allows less."""
    (tmp_path / "disc.yaml").write_text(
        load_text("paper-disc").replace("stopping_distance: 0", "stopping_distance: 2")
    )
    wide = np.zeros((41, 81), np.bool_)
    own = {"start": (20, 20), "goal": (60, 20), "robot_radius": 4}
    named = {**own, "robot": tmp_path / "disc.yaml"}
    assert Map2DEnv(wide, **named).required_gap == 2.0
    assert Map2DEnv(wide, **named, pose_noise=1.0).required_gap == 2.0
    assert Map2DEnv(wide, **own).required_gap == pytest.approx(0.2)
    assert Map2DEnv(wide, **own, stopping_distance=3).required_gap == 3.0
    narrow = wide.copy()
    narrow[:15, 40] = narrow[26:, 40] = True  # 11 px remain free
    env = Map2DEnv(narrow, **named)
    assert env.required_gap == pytest.approx(0.5 * (5.45 - 4.0), abs=0.03)


def load_text(name):
    """The text of a bundled robot file."""
    return (files("tdac_envs.robots") / "files" / f"{name}.yaml").read_text()
