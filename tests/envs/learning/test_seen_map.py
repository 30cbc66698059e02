"""A robot's own map: walls where they are, ways that lead to the goal."""

import gymnasium as gym
import numpy as np
import pytest

from tdac_envs import wrap_for_rl
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import body_free
from tdac_envs.grid.plan import distance_field
from tdac_envs.learning.seen_kernels import (
    MARGIN,
    RING,
    UNKNOWN,
    add_scans,
    add_walls,
    look_around,
)
from tdac_envs.learning.seen_map import AHEAD, BINS, CELL
from tdac_envs.learning.seen_ways import look_along
from tdac_envs.learning.wrappers import Frame

LADDER = "TDAC-Ladder-v0"


def drive(env, index, steps, random):
    """Drives about at random; gives the environment and the last observation."""
    seen, _ = env.reset(options={"index": index})
    action = np.array([0.8, 0.8])
    for k in range(steps):
        if k % 8 == 0:
            action = random.uniform(-0.4, 1.0, 2)
        seen, *_, over, _, _ = env.step(action.astype(np.float32))
        if over:
            break
    return seen


def on_world(env, cells):
    """The pixels, in the world, of cells of the map that a robot makes."""
    plain, maps = env.unwrapped, env.maps
    anchor = plain.view.anchor(plain.task)
    places = (np.asarray(cells, float) - maps.seeing.shift) * maps.seeing.cell
    x, y = places.T * (1.0 if not maps.seeing.up else -1.0)
    if maps.seeing.up:
        places = places / maps.seeing.per_px
        x, y = places[:, 0], -places[:, 1]
    cosine, sine = anchor[3], anchor[4]
    return np.stack(
        [anchor[0] + cosine * x - sine * y, anchor[1] + sine * x + cosine * y], axis=-1
    )


@pytest.mark.parametrize("level", ["unknown", "moving"])
def test_walls_are_where_rays_end(level):
    """Within a cell of an occupied pixel; what is free is not within a wall."""
    env = wrap_for_rl(gym.make(LADDER, level=level, split="dev"), ["seen-map"])
    random = np.random.default_rng(0)
    for index in range(6):
        drive(env, index, 40, random)
        clear = env.unwrapped.task.terrain.clear
        walls = env.maps.walls[0]
        rows, columns = np.nonzero(walls > 0)
        assert len(rows) > 20
        places = np.rint(on_world(env, np.stack([columns, rows], axis=-1))).astype(int)
        height, width = clear.shape
        x, y = places[:, 0].clip(0, width - 1), places[:, 1].clip(0, height - 1)
        cell = CELL * env.unwrapped.task.body_radius
        near = clear[y, x] <= 1.5 * cell
        # Discs that move leave marks, until a ray passes there again.
        assert near.mean() > (0.99 if level == "unknown" else 0.5)
        rows, columns = np.nonzero((walls > -100) & (walls <= 0))
        free = np.rint(on_world(env, np.stack([columns, rows], axis=-1))).astype(int)
        inside = (free >= 0).all(1) & (free < (width, height)).all(1)
        solid = ~env.unwrapped.task.terrain.grid.cells
        assert solid[free[inside, 1], free[inside, 0]].mean() > 0.95


def test_waypoints_lead_to_the_goal_on_a_given_map():
    """The last one is nearer to the goal along the shortest path than the robot is."""
    env = wrap_for_rl(gym.make(LADDER, level="known", split="dev"), ["waypoints"])
    nearer = 0
    for index in range(30):
        seen, _ = env.reset(options={"index": index})
        plain = env.unwrapped
        task, radius = plain.task, plain.task.body_radius
        # The path of a slim robot: the way may be nearer to walls than the body fits.
        free = body_free(task.terrain.clear, 1.0)
        field = distance_field(free, (round(task.goal[0]), round(task.goal[1])))
        x, y, heading = plain.pose()
        here = field[round(y), round(x)]
        ahead, left = seen["waypoints"][-1] * AHEAD[-1] * radius
        to_x = x + ahead * np.cos(heading) + left * np.sin(heading)
        to_y = y + ahead * np.sin(heading) - left * np.cos(heading)
        nearer += field[round(to_y), round(to_x)] < here
    assert nearer >= 29


def test_waypoints_of_an_empty_map_lie_straight_ahead():
    """Before anything is seen but free space, the way is the straight one."""
    empty = np.zeros((400, 400), np.bool_)
    own = {"start": (60, 200, 0.5), "goal": (340, 280), "robot_radius": 8}
    env = wrap_for_rl(gym.make("TDAC-Map2D-v0", map=empty, **own), ["waypoints"])
    seen, _ = env.reset(seed=0)
    plain = env.unwrapped
    own = Frame.of_task(plain.task).seen(plain.pose(), np.array(plain.task.goal))
    bearing = np.arctan2(own[1], own[0])
    found = np.arctan2(seen["waypoints"][:, 1], seen["waypoints"][:, 0])
    assert np.abs(np.angle(np.exp(1j * (found - bearing)))).max() < np.pi / 4


def test_what_is_seen_is_remembered():
    """Nothing is known behind a robot at first; after a turn, all is."""
    level = "lost"  # rays ahead only
    env = wrap_for_rl(gym.make(LADDER, level=level, split="dev"), ["seen-map"])
    seen, _ = env.reset(options={"index": 3})
    assert seen["seen"].shape == (2, BINS)
    ring = seen["seen"][0][:24]
    assert (ring[10:15] == 0).all()
    assert (ring[:3] != 0).all()
    for _ in range(14):
        seen, *_, over, _, _ = env.step(np.array([0.3, -0.3], np.float32))
        assert not over
    assert (seen["seen"][0][:24] != 0).mean() > 0.9
    # It has been where it came from.
    for _ in range(8):
        seen, *_, over, _, _ = env.step(np.ones(2, np.float32))
        assert not over
    behind = [k for k in range(24) if seen["seen"][1][k] > 0.0]
    assert behind
    assert all(6 <= k <= 18 for k in behind)


@pytest.mark.parametrize("made", [gym.make, gym.make_vec])
def test_a_map_needs_ranges_and_a_pose(made):
    """In one line that says what is missing."""
    for names in (["goal-relative", "seen-map"], ["flatten", "waypoints"]):
        with pytest.raises(TaskError, match="expected original observations with"):
            wrap_for_rl(made(LADDER, level="unknown", split="dev"), names)
    with pytest.raises(TaskError, match="expected original observations with"):
        wrap_for_rl(made(LADDER, level="epuck", split="dev"), ["seen-map"])
    with pytest.raises(TaskError, match="expected original observations with"):
        wrap_for_rl(made("TDAC-EPuck-v0"), ["waypoints"])


@pytest.mark.parametrize("resolution", [None, 0.05])
def test_a_given_map_is_the_right_way_up(resolution, tmp_path):
    """Its walls lie on those of the world, in px and in metres."""
    scale = resolution or 1.0
    own = {"radius": 8.0, "axle_length": 11.0, "max_wheel_speed": 30.0}
    robot = "{" + ", ".join(f"{key}: {size}" for key, size in own.items()) + "}"
    lines = [
        "worlds: [{name: mazes}]",
        *("frame: map", "map: true", f"robot: {robot}"),
        *([] if resolution is None else [f"resolution: {scale}"]),
    ]
    file = tmp_path / "mine.yaml"
    file.write_text("\n".join(lines))
    env = gym.make(LADDER, level=str(file), split="dev")
    env = wrap_for_rl(env, ["seen-map"])
    env.reset(options={"index": 1})
    cells = env.unwrapped.task.terrain.grid.cells
    assert not np.array_equal(cells, cells[::-1])
    walls = env.maps.walls[0]
    maps = np.indices(walls.shape)[::-1].reshape(2, -1).T
    places = np.rint(on_world(env, maps)).astype(int)
    within = (places >= 2).all(1) & (places < np.array(cells.shape)[::-1] - 2).all(1)
    (x, y), (to_x, to_y) = places[within].T, maps[within].T
    near = np.stack([cells[y + dy, x + dx] for dy in (-2, 0, 2) for dx in (-2, 0, 2)])
    held = walls[to_y, to_x] > 0
    assert near.any(axis=0)[held].all()
    assert not near.all(axis=0)[~held].any()


@pytest.mark.parametrize("scale", [0.25, 1.0, 2.5, 40.0])
def test_a_given_map_has_no_gaps(scale):
    """However small the cells, walls are solid, and nothing is written outside."""
    side = int(np.ceil(9 * scale)) + 2 * MARGIN + 1
    walls = np.full((side, side), UNKNOWN, np.int8)
    costs = np.ones((side, side), np.int16)
    cells = np.zeros((9, 9), np.bool_)
    cells[4] = True
    add_walls(cells, scale, MARGIN + 0.5 * scale, walls, costs)
    middle = walls[round(MARGIN + 4.5 * scale)]
    assert (middle[MARGIN + 1 : -MARGIN - 1] > 0).all()
    assert (walls[:RING] == UNKNOWN).all()
    assert (walls[-RING:] == UNKNOWN).all()


ODD = [np.nan, np.inf, -np.inf, 1e300, -1e300, -1.0, 5.0]


@pytest.mark.parametrize("size", [2 * MARGIN + 1, 31])
@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("reading", [0.0, 0.5, 1.0, np.inf, np.nan, -1.0])
def test_odd_numbers_stay_on_the_map(size, odd, reading):
    """Poses, goals and ranges that no robot has: neither memory nor time is lost."""
    columns = [[odd, 6.0, 0.0], [6.0, odd, 0.0], [6.0, 6.0, odd], [odd, odd, odd]]
    poses = np.array(columns)
    count = len(poses)
    rows = np.arange(count)
    walls = np.full((count, size, size), UNKNOWN, np.int8)
    visits = np.zeros((count, size, size), np.uint8)
    costs = np.ones((count, size, size), np.int16)
    ranges = np.full((count, 3), reading, np.float32)
    rays = np.array([[1.0, 0.0], [0.0, 1.0], [odd, 0.0]])
    far, offset = np.array([8.0, odd, 1e18, np.inf]), np.array([odd, 0.0])
    add_scans(rows, poses, ranges, far, rays, offset, walls, costs, visits)
    assert visits.sum() == count
    inside = visits[:, MARGIN : size - MARGIN, MARGIN : size - MARGIN]
    assert inside.sum() == count
    seen = np.zeros((count, 2, 1), np.float32)
    look_around(rows, poses, np.array([[[odd, 1.0]]]), walls, visits, seen)
    assert np.isfinite(seen).all()
    routes, routed = np.zeros((count, 64, 2), np.int32), np.zeros((count, 3), np.int32)
    found = np.full((count, 2, 2), np.nan)
    own = poses, poses[::-1, :2].copy(), np.array([2.0, 4.0]), np.zeros(count)
    look_along(rows, *own, costs, routes, routed, found)
    assert ((found >= MARGIN) & (found <= size - MARGIN)).all()


def test_an_own_map_has_a_largest_size():
    """A robot that is tiny in its world gets one clear line, not all memory."""
    own = {"start": (60, 200, 0.5), "goal": (340, 280), "robot_radius": 0.1}
    env = gym.make("TDAC-Map2D-v0", map=np.zeros((400, 400), np.bool_), **own)
    with pytest.raises(TaskError, match="16,019 x 16,019 cells"):
        wrap_for_rl(env, ["waypoints"])
