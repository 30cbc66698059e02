"""Promises of task sets with movers, and of the planner in space and time."""

from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_same

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.disturbances import Disturbances
from tdac_envs.ladder.env import LadderEnv
from tdac_envs.ladder.orca_driver import OrcaDriver, drive_by_orca
from tdac_envs.ladder.space_time import earliest_arrival
from tdac_envs.ladder.task_sets import load_set
from tdac_envs.ladder.vector import LadderVectorEnv
from tdac_envs.map2d.env import Map2DEnv

SET = """
schema: 1
name: street
worlds:
  - {name: rooms, width: 200, height: 160, sides: [4, 7], doors: [2.5, 3.2]}
robot: {radius: 6, axle_length: 10, max_wheel_speed: 30}
admission: {gap: 2.2, steps: 30}
movers:
  - {kind: bounce, count: [3, 5], speed: [9, 30], radius: [4, 6]}
"""
CROWD = "  - {kind: crowd, count: [4, 6], speed: [10, 15], radius: [4, 5]}\n"


@pytest.fixture
def street(tmp_path: Path) -> Path:
    path = tmp_path / "street.yaml"
    path.write_text(SET + CROWD)
    return path


def test_a_world_has_the_same_movers_whenever_it_is_made(street):
    one, two = load_set(street), load_set(street)
    for index in (3, 0):
        first, again = one.task("test", index), two.task("test", index)
        for a, b in zip(first.movers, again.movers, strict=True):
            np.testing.assert_array_equal(a, b)
    assert not np.array_equal(
        one.task("dev", 0).movers.now, one.task("test", 0).movers.now
    )


def test_movers_are_as_the_set_says(street):
    tasks = load_set(street)
    for index in range(5):
        kind, radius, speed = tasks.task("dev", index).movers.traits[:, :3].T
        bounce, crowd = kind == 1, kind == 2
        assert 3 <= bounce.sum() <= 5
        assert 4 <= crowd.sum() <= 6
        assert ((radius[bounce] >= 4) & (radius[bounce] <= 6)).all()
        assert ((speed[bounce] >= 9) & (speed[bounce] <= 30)).all()
        assert ((speed[crowd] >= 10) & (speed[crowd] <= 15)).all()


def test_the_pool_of_training_worlds_has_movers(street):
    env = LadderEnv(level=street, train_pool=4)
    env.reset(seed=0, options={"index": 2})
    made = load_set(street).task("train", 2).movers
    np.testing.assert_array_equal(env.movers.now, made.now)
    assert len(LadderEnv(level=street, train_pool=4).task.movers.traits) >= 7


def test_a_batch_does_what_single_environments_do(street):
    options = {"level": street, "train_pool": 6}
    batch = LadderVectorEnv(3, autoreset_mode="SameStep", threads=2, **options)
    singles = [LadderEnv(**options) for _ in range(3)]
    seen, _ = batch.reset(seed=[4, 5, 6])
    first = [env.reset(seed=4 + i)[0] for i, env in enumerate(singles)]
    assert_same(seen, {key: np.stack([o[key] for o in first]) for key in seen})
    alive = np.ones(3, bool)
    for action in actions(3, 60):
        seen, _, terminated, truncated, _ = batch.step(action)
        alive &= ~(terminated | truncated)
        for i in np.flatnonzero(alive):
            own = singles[i].step(action[i])[0]
            assert_same({key: seen[key][i] for key in seen}, own)
    assert alive.any()


def test_sets_without_movers_keep_their_hashes():
    assert load_set("unknown").sha256.startswith("a95bc6cc")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{kind: bounce, count: [5, 3], speed: [9, 30], radius: [4, 6]}", "count: "),
        ("{kind: crowd, count: [5, 70], speed: [9, 30], radius: [4, 6]}", "64 people"),
        ("{kind: walk, count: [5, 6], speed: [9, 30], radius: [4, 6]}", "kind: "),
        ("{kind: bounce, count: [5, 6], radius: [4, 6]}", "speed: "),
        ("{kind: bounce, count: [5, 6], speed: [9, 30], radius: [0, 6]}", "radius"),
    ],
)
def test_a_fault_is_one_line(tmp_path, text, message):
    path = tmp_path / "street.yaml"
    path.write_text(f"{SET.partition('movers:')[0]}movers:\n  - {text}\n")
    with pytest.raises(TaskError, match=message) as caught:
        load_set(path)
    assert "\n" not in str(caught.value)


class TestPlanner:
    OPTIONS = {  # noqa: RUF012
        "map": np.zeros((60, 200), bool),
        "start": (20.0, 30.0, 0.0),
        "goal": (180.0, 30.0),
        "robot_radius": 8.0,
        "max_wheel_speed": 40.0,
        "dt": 0.1,
        "horizon": 400,
    }

    def task(self, movers, **options):
        env = Map2DEnv(**{**self.OPTIONS, "movers": movers, **options})
        env.reset(seed=0)
        return env.task

    def test_nobody_in_the_way(self):
        """Straight on, as fast as the lattice allows."""
        task = self.task(None)
        found = earliest_arrival(replace(task, movers=None))
        # 5 px in two steps of 4 px each.
        assert found.steps == pytest.approx(2 * 160 / 5, abs=4)
        np.testing.assert_allclose(found.path[0, 1:], (20, 30), atol=5)
        np.testing.assert_allclose(found.path[-1, 1:], (180, 30), atol=5)

    def test_it_waits_in_a_bay(self):
        """A mover fills the corridor on its way back and forth."""
        cells = np.ones((60, 200), bool)
        cells[20:41] = False
        cells[41:60, 90:111] = False
        route = {
            "kind": "route",
            "points": [[60, 30], [185, 30]],
            "loop": False,
            "speed": 20,
            "radius": 9,
            "phase": 0.0,
        }
        task = self.task([route], map=cells)
        alone = earliest_arrival(replace(task, movers=None))
        found = earliest_arrival(task)
        assert found.steps > alone.steps
        assert found.path[:, 2].max() > 38

    # The robot stands still, and a mover may touch it.
    @pytest.mark.filterwarnings("ignore:.*the episode has ended")
    def test_the_path_touches_nobody(self):
        """It is driven here as a straight line from node to node."""
        for seed in range(5):
            movers = [{"kind": "bounce", "count": 3, "radius": 5}]
            env = Map2DEnv(**{**self.OPTIONS, "movers": movers})
            env.reset(seed=seed)
            task = env.task
            found = earliest_arrival(task)
            assert found is not None
            times, x, y = found.path.T
            at = np.arange(found.steps + 1)
            own = np.column_stack([np.interp(at, times, x), np.interp(at, times, y)])
            nearest = np.inf
            for step in range(1, found.steps + 1):
                env.step(np.zeros(2, np.float32))
                off = np.hypot(*(env.movers.now[:, :2] - own[step]).T)
                nearest = min(nearest, off.min())
            assert nearest >= 13.0

    def test_where_there_is_no_way(self):
        wall = {"kind": "route", "points": [[100, y] for y in (10, 11)], "speed": 0}
        walls = [
            {**wall, "points": [[100, y]], "radius": 9} for y in (10, 20, 30, 40, 49)
        ]
        task = self.task(walls)
        assert earliest_arrival(task) is None


class TestDriver:
    """The privileged driver by ORCA, which admits worlds with a crowd."""

    @pytest.mark.slow
    def test_it_arrives_in_each_world_of_the_level(self):
        tasks = load_set("crowd")
        for index in range(4):
            task, noise = tasks.task("dev", index), tasks.noise("dev", index)
            assert drive_by_orca(task, tasks.file.errors, noise) is not None

    def test_it_drives_the_episode_of_the_environment(self):
        """With its people and the gains of its wheels, step by step."""
        env = gym.make("TDAC-Ladder-v0", level="crowd", split="dev").unwrapped
        tasks = env.set
        env.reset(options={"index": 1})
        found = drive_by_orca(env.task, tasks.file.errors, tasks.noise("dev", 1))
        driver, ended, count = OrcaDriver(env), False, 0
        while not ended:
            _, _, terminated, truncated, info = env.step(driver.action())
            ended, count = terminated or truncated, count + 1
        assert info["is_success"]
        assert count == found.steps

    def test_nobody_in_the_way(self):
        env = Map2DEnv(**TestPlanner.OPTIONS)
        env.reset(seed=0)
        found = drive_by_orca(env.task, Disturbances(), np.random.default_rng(0))
        far = 160 - env.task.goal_tolerance
        assert found.steps == pytest.approx(far / 4, abs=3)
        assert found.driven == pytest.approx(far, abs=4)

    def test_where_there_is_no_way(self):
        """It waits in front of a mover that fills the corridor."""
        cells = np.ones((60, 200), bool)
        cells[20:41] = False
        post = {"kind": "route", "points": [[100, 30]], "radius": 9}
        env = Map2DEnv(**{**TestPlanner.OPTIONS, "map": cells, "movers": [post]})
        env.reset(seed=0)
        noise = np.random.default_rng(0)
        assert drive_by_orca(env.task, Disturbances(), noise) is None
