"""Promises of a Map2D task: feasible or refused with the reason, and drawn so."""

import copy
import math
import pickle

import brute_force
import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import Pose, random_task
from tdac_envs.grid.grid import OccupancyGrid, clearance_at
from tdac_envs.grid.plan import path_length
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.task import (
    Terrain,
    at_goal,
    make_task,
)
from tdac_envs.map2d.terrain import may_start, path_entry
from tdac_envs.mapping.params import RobotParams

ROBOT = RobotParams.disc(4.0)


def terrain(width=80, height=50, *occupied):
    cells = np.zeros((height, width), bool)
    for window in occupied:
        cells[window] = True
    return Terrain.of(OccupancyGrid(cells))


def two_rooms(gap=20):
    """A wall with a gap of so many pixels at its top."""
    return terrain(80, 50, np.s_[gap:, 40:43])


def task_on(world, start=(10.0, 40.0, 0.0), goal=(70.0, 40.0), robot=ROBOT, **more):
    return make_task(world, Pose(*start), goal, robot, **more)


class TestMakeTask:
    def test_d0_is_the_way_around_the_wall(self):
        task = task_on(two_rooms())
        path = task.path_from(task.start)
        assert task.shortest == pytest.approx(path_length(path), abs=0.01)
        assert task.shortest > 75.0
        assert task.shortest == pytest.approx(task.field[40, 10])

    def test_the_path_is_free_for_the_body(self):
        task = task_on(two_rooms())
        path = task.path_from(task.start)
        assert tuple(path[0]) == (10.0, 40.0)
        assert tuple(path[-1]) == (70.0, 40.0)
        part = np.linspace(0, 1, 9)[:, None, None]
        points = (path[:-1] * (1 - part) + path[1:] * part).reshape(-1, 2)
        gaps = brute_force.distance(task.terrain.grid.cells, *points.T)
        assert gaps.min() >= 4.0 - 1e-6

    @pytest.mark.parametrize(
        ("dt", "speed", "expected"),
        [(0.05, 75.59, 2500), (0.05, 1.0, None), (1e-3, 75.59, None)],
    )
    def test_the_horizon_is_six_times_the_way_or_2500(self, dt, speed, expected):
        robot = ROBOT.model_copy(update={"max_wheel_speed": speed})
        task = task_on(two_rooms(), robot=robot, dt=dt)
        formula = math.ceil(6.0 * task.shortest / (speed * dt))
        assert task.horizon == max(2500, formula) == (expected or formula)

    def test_the_tolerance_is_20_px_or_a_quarter_of_the_way(self):
        assert task_on(two_rooms()).goal_tolerance == pytest.approx(
            min(20.0, 0.25 * task_on(two_rooms()).shortest)
        )
        near = task_on(terrain(), goal=(22.0, 40.0))
        assert near.goal_tolerance == pytest.approx(3.0)
        assert task_on(terrain(200), goal=(170.0, 40.0)).goal_tolerance == 20.0

    def test_the_heading_is_wrapped(self):
        assert task_on(terrain(), (10.0, 40.0, 40.0)).start.heading == pytest.approx(
            math.remainder(40.0, 2 * math.pi)
        )
        assert task_on(terrain(), (10.0, 40.0, -math.pi)).start.heading == math.pi

    def test_numpy_and_lists_are_taken_as_numbers(self):
        task = make_task(terrain(), np.array([10, 40, 0]), [70, np.int64(40)], ROBOT)
        assert task.start == Pose(10.0, 40.0, 0.0)
        assert [type(v) for v in (*task.start, *task.goal)] == [float] * 5

    def test_a_start_that_just_holds_the_body_is_feasible(self):
        task = task_on(terrain(), (3.5, 3.5, 0.0), (75.0, 45.0))
        path = task.path_from(task.start)
        assert len(path) > 70
        assert math.isfinite(task.shortest)

    def test_a_goal_that_just_holds_the_body_is_feasible(self):
        task = task_on(terrain(), goal=(75.5, 45.5))
        assert tuple(task.path_from(task.start)[-1]) == (75.5, 45.5)

    def test_the_first_hop_of_a_path_is_not_through_a_wall(self):
        """A tiny body beside a thin diagonal wall: pixels beyond it are near."""
        cells = np.eye(40, dtype=bool)
        cells[:3] = cells[:, -3:] = False
        world = Terrain.of(OccupancyGrid(cells))
        robot = RobotParams.disc(0.3)
        start = Pose(21.0, 20.0, 0.0)
        task = make_task(world, start, (10.0, 25.0), robot)
        path = task.path_from(start)
        part = np.linspace(0, 1, 33)[:, None, None]
        points = (path[:-1] * (1 - part) + path[1:] * part).reshape(-1, 2)
        assert brute_force.distance(cells, *points.T).min() >= 0.3 - 1e-6
        assert task.shortest == pytest.approx(path_length(path), abs=1.5)


class TestRefused:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"start": (-3, 4, 0)}, r"start \(-3, 4\) lies outside the map of 80 x 50"),
            ({"goal": (10, 50)}, r"goal \(10, 50\) lies outside the map"),
            (
                {"start": (41, 40, 0)},
                r"^move the start to \((35|47), \d+\), the nearest free pixel: "
                r"start \(41, 40\) lies in an obstacle$",
            ),
            (
                {"goal": (70, 47)},
                r"^move the goal to \(70, 45\), the nearest free pixel: "
                r"goal \(70, 47\) is 2.5 px from a wall, too near for a body of 4 px "
                r"radius$",
            ),
            (
                {"start": (70, 41, 0), "goal_tolerance": 2},
                "already at the goal: 1.0 px apart with a tolerance of 2.0 px; move",
            ),
            ({"start": (math.nan, 4, 0)}, "expected start to be 3 finite numbers"),
            ({"start": (4, 4, math.inf)}, "expected start to be 3 finite numbers"),
            ({"goal": (1, 2, 3)}, "expected goal to be 2 finite numbers"),
            ({"goal": "ab"}, "expected goal to be 2 finite numbers"),
            ({"dt": 0.0}, "expected dt above 0, got 0.0"),
            ({"dt": -1.0}, "expected dt above 0"),
            ({"dt": math.nan}, "expected dt to be a finite number"),
            ({"goal_tolerance": -2.0}, "expected goal_tolerance above 0, got -2.0"),
            ({"goal_tolerance": 0}, "expected goal_tolerance above 0, got 0"),
            ({"horizon": 0}, "expected horizon to be a whole number from 1, got 0"),
            ({"horizon": 2.5}, "expected horizon to be a whole number"),
        ],
    )
    def test_the_reason_is_named(self, change, message):
        given = {"start": (10, 40, 0), "goal": (70, 40), **change}
        start, goal = given.pop("start"), given.pop("goal")
        with pytest.raises(TaskError, match=message):
            make_task(two_rooms(), start, goal, ROBOT, **given)

    def test_separate_rooms(self):
        with pytest.raises(TaskError, match=r"no free path .* they are in separate"):
            task_on(two_rooms(gap=0))

    def test_a_gap_that_is_too_narrow_is_measured(self):
        with pytest.raises(TaskError, match=r"no free path .* radius of 2\.\d px"):
            task_on(two_rooms(gap=6))

    def test_a_body_that_fits_nowhere(self):
        robot = RobotParams.disc(40.0)
        with pytest.raises(TaskError, match=r"nowhere; the largest clearance is 24.5"):
            task_on(terrain(), (10.0, 10.0, 0.0), robot=robot)

    def test_the_goal_behind_a_wall_is_not_reached(self):
        """Within the tolerance, but a wall of one pixel is in between."""
        world = terrain(80, 50, np.s_[20:, 40])
        task = task_on(world, (34.0, 40.0, 0.0), (46.0, 40.0), goal_tolerance=15.0)
        assert not at_goal(world, task.goal, 15.0, 34.0, 40.0)
        assert at_goal(world, task.goal, 15.0, 50.0, 40.0)


class TestVariations:
    def test_jitter_stays_within_one_radius_and_half_a_radian(self):
        task, random = task_on(two_rooms()), np.random.default_rng(0)
        cells = task.terrain.grid.cells
        starts = [task.jittered(random) for _ in range(200)]
        for start in starts:
            assert math.dist(start[:2], task.start[:2]) <= 4.0
            assert abs(start.heading) <= 0.5
            assert float(brute_force.distance(cells, start.x, start.y)) >= 4.0
            assert math.isfinite(task.moved(start).shortest)
        assert np.ptp([s.x for s in starts]) > 6.0
        assert np.ptp([s.y for s in starts]) > 6.0

    def test_jitter_repeats_with_its_seed(self):
        task = task_on(two_rooms())
        one, two = (task.jittered(np.random.default_rng(7)) for _ in range(2))
        assert one == two
        assert task.jittered(np.random.default_rng(8)) != one

    @pytest.mark.parametrize("start", [(3.5, 3.5), (12.0, 23.5), (75.5, 45.5)])
    def test_jitter_ends_in_a_tight_place(self, start):
        """A corner, or the mouth of a slot that is as wide as the body."""
        world = terrain(80, 50, np.s_[10:20, :12], np.s_[28:, :12])
        task = task_on(world, (*start, 3.0), (70.0, 10.0))
        for seed in range(30):
            pose = task.jittered(np.random.default_rng(seed))
            assert float(brute_force.distance(world.grid.cells, *pose[:2])) >= 4.0
            assert len(task.path_from(pose)) > 2
            assert -math.pi < pose.heading <= math.pi

    def test_jitter_ends_where_no_other_place_will_do(self):
        """Everywhere but at the nominal start the episode would be over."""
        task = task_on(terrain(), goal_tolerance=59.0)
        stuck = copy.copy(task)
        object.__setattr__(stuck, "goal_tolerance", 1000.0)
        pose = stuck.jittered(np.random.default_rng(0))
        assert pose[:2] == task.start[:2]
        assert pose.heading != task.start.heading

    def test_random_tasks_are_feasible(self):
        task, random = task_on(two_rooms()), np.random.default_rng(0)
        drawn = [random_task(task, random) for _ in range(20)]
        for one in drawn:
            again = make_task(
                task.terrain,
                one.start,
                one.goal,
                ROBOT,
                goal_tolerance=task.goal_tolerance,
            )
            assert again.shortest == pytest.approx(one.shortest)
        assert len({one.goal for one in drawn}) > 10
        assert len({one.start for one in drawn}) > 10

    def test_random_tasks_end_where_there_is_hardly_any_room(self):
        """Every two places are within the tolerance but the nominal ones."""
        task = task_on(terrain(40, 10), (4.5, 4.5, 0.0), (34.5, 4.5))
        tight = copy.copy(task)
        object.__setattr__(tight, "goal_tolerance", 1000.0)
        assert random_task(tight, np.random.default_rng(0)) is tight


class TestSharing:
    def test_equal_grids_share_terrain_and_field(self):
        cells = np.zeros((30, 40), bool)
        one, two = (
            make_task(
                Terrain.of(OccupancyGrid(cells.copy())), (5, 5, 0), (35, 25), ROBOT
            )
            for _ in range(2)
        )
        assert one.terrain is two.terrain
        assert one.field is two.field

    def test_what_is_shared_cannot_be_written(self):
        task = task_on(two_rooms())
        world = task.terrain
        for array in (task.field, world.clear, world.padded_clear, world.leaps):
            assert not array.flags.writeable

    def test_a_task_takes_at_most_16_bytes_a_pixel(self):
        task = task_on(two_rooms())
        arrays = {
            id(array if array.base is None else array.base): array.nbytes
            for array in (
                task.terrain.grid.cells,
                task.terrain.padded_clear,
                task.terrain.clear,
                task.terrain.leaps,
                task.field,
            )
        }
        assert sum(arrays.values()) <= 16 * 82 * 52

    @pytest.mark.parametrize(
        "twin", [copy.deepcopy, lambda t: pickle.loads(pickle.dumps(t))]
    )
    def test_a_copy_is_the_same_task_and_small(self, twin):
        task = task_on(two_rooms(), goal_tolerance=7.0, horizon=99)
        other = twin(task)
        assert other.terrain is task.terrain
        assert other.field is task.field
        for name in ("start", "goal", "robot", "goal_tolerance", "dt", "horizon"):
            assert getattr(other, name) == getattr(task, name)
        assert other.shortest == task.shortest
        assert len(pickle.dumps(task)) < 2 * task.terrain.grid.cells.size

    def test_moved_keeps_horizon_and_tolerance(self):
        task = task_on(two_rooms(), horizon=123, goal_tolerance=5.0)
        moved = task.moved(Pose(60.0, 40.0, 9.0), (10.0, 40.0))
        assert (moved.horizon, moved.goal_tolerance) == (123, 5.0)
        assert moved.shortest > 60.0
        assert moved.start.heading == pytest.approx(9.0 - 2 * math.pi)
        assert task.moved(Pose(20.0, 40.0, 0.0)).field is task.field


@pytest.mark.parametrize("name", ["maze", "spiral"])
def test_where_an_episode_may_start(name):
    """It has room for the body, a way to the goal, and is not there already."""
    task = Map2DEnv(name).nominal
    world, radius, random = task.terrain, task.robot.radius, np.random.default_rng(0)
    room, height = math.sqrt(radius**2 + 0.5), world.grid.height
    found = 0
    for k in range(400):
        end = (task.start[:2], task.goal)[k % 2]
        near = end + random.uniform(-1.5, 1.5, 2) * radius
        anywhere = random.uniform(-1, 1.01, 2) * (world.grid.width, height)
        x, y = (near if k % 4 < 3 else anywhere).tolist()
        expected = (
            clearance_at(world.grid.cells, x, y, room) >= room
            and path_entry(world, task.field, x, y, radius) is not None
            and not at_goal(world, task.goal, task.goal_tolerance, x, y)
        )
        given = (world.padded_clear, world.leaps, task.field, x, y, radius)
        assert may_start(*given, *task.goal, task.goal_tolerance) == expected
        found += expected
    assert 40 < found < 360
