"""Promises of crowds: they walk, avoid each other, and never enter a wall."""

import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_alike

from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.space_time import foreseen
from tdac_envs.ladder.task_sets import load_set
from tdac_envs.map2d.encounters import fits
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.vector import Map2DVectorEnv
from tdac_envs.movers.crowd import PATIENCE
from tdac_envs.movers.state import NEXT_VX, NEXT_VY, OWN, RADIUS, SEES, SPEED, Y
from tdac_envs.movers.walls import FROM_X, LENGTH, UNIT_X, cells_of, segments_of

STILL = np.zeros(2, np.float32)


def hall(width=260, height=160):
    cells = np.zeros((height, width), bool)
    cells[60:100, 110:150] = True
    return cells


def hall_env(count, **options):
    given = {
        "map": hall(),
        "start": (20.0, 20.0),
        "goal": (240.0, 140.0),
        "robot_radius": 6.0,
        "max_wheel_speed": 40.0,
        "movers": [{"kind": "crowd", "count": count, "radius": 6, "speed": 20}],
        "on_collision": "block",
        "horizon": 100_000,
        "dt": 0.1,
        **options,
    }
    return Map2DEnv(**given)


class Walk:
    """What a crowd did in some steps beside a robot that stands.

    Attributes:
        places: Shape (steps, n, 2), px.
        speeds: Shape (steps, n): as parts of each person's own speed.
        inside: Number of discs that were in a wall.
        deep: Shape (steps, n): whether a person was more than 5 % of a radius inside
            of another one.
    """

    def __init__(self, env, seed, steps):
        env.reset(seed=seed)
        traits = env.movers.traits
        radii, clear = traits[:, RADIUS], env.task.terrain.padded_clear
        places, speeds, self.inside = [], [], 0
        for _ in range(steps):
            env.step(STILL)
            now = env.movers.now
            at = now[:, : Y + 1].copy()
            places.append(at)
            speeds.append(np.hypot(now[:, 2], now[:, 3]) / traits[:, SPEED])
            self.inside += sum(
                not fits(clear, x, y, r) for (x, y), r in zip(at, radii, strict=True)
            )
        self.places, self.speeds = np.array(places), np.array(speeds)
        self.deep = deep(self.places, radii)


def deep(places, radii):
    """Who was more than 5 % of a radius inside of another one, shape (steps, n)."""
    reach = radii[:, None] + radii
    np.fill_diagonal(reach, -np.inf)
    far = np.hypot(*np.moveaxis(places[:, :, None] - places[:, None], 3, 0))
    return (reach - far).max(axis=2) > 0.05 * radii


def standing(places, steps, radii):
    """Which people stayed within a radius for as many steps."""
    stood = np.zeros(places.shape[1], bool)
    for begin in range(0, len(places) - steps + 1, 10):
        extent = np.ptp(places[begin : begin + steps], axis=0).max(axis=1)
        stood |= extent < radii
    return stood


def test_people_walk_to_their_places():
    """1,000 steps: the figures that are promised."""
    walk = Walk(hall_env(20), seed=1, steps=1000)
    assert walk.inside == 0
    assert np.median(walk.speeds.mean(axis=0)) >= 0.6
    assert walk.deep.mean() <= 1e-3
    assert standing(walk.places, 300, 6.0).sum() == 0


def test_people_arrive():
    env = hall_env(3)
    env.reset(seed=0)
    goals = [env.movers.now[:, OWN].copy()]
    for _ in range(600):
        env.step(STILL)
        goals.append(env.movers.now[:, OWN].copy())
    changes = (np.diff(goals, axis=0) != 0).sum(axis=0)
    assert (changes >= 2).all()
    assert (changes <= 60 / PATIENCE).all()


def test_those_who_see_the_robot_make_way():
    """A robot that stands in a doorway: those who do not see it walk into it."""
    cells = hall()
    cells[:, 128:132] = True
    cells[70:95, 128:132] = False
    cells[60:100, 110:128] = cells[60:100, 132:150] = False
    contacts = {}
    for sees in (True, False):
        env = hall_env(
            6,
            map=cells,
            start=(129.5, 82.0),
            movers=[{"kind": "crowd", "count": 6, "radius": 4, "sees_robot": sees}],
        )
        env.reset(seed=3)
        contacts[sees] = sum(env.step(STILL)[4]["collision"] for _ in range(600))
        assert set(env.movers.people[:, SEES]) == {float(sees)}
    # A robot that stands is no obstacle to what it does not see: those wait at it.
    assert contacts[True] == 0


def test_half_of_the_people_see_the_robot():
    env = hall_env(11)
    seen = []
    for seed in range(20):
        env.reset(seed=seed)
        seen.append(env.movers.people[:, SEES].copy())
    assert {int(each.sum()) for each in seen} == {5}
    assert np.mean(seen, axis=0).max() < 0.9


def test_a_fair_start():
    """Nobody is within two seconds of the robot, nor touches another."""
    env = hall_env(30)
    for seed in range(10):
        env.reset(seed=seed)
        at, start = env.movers.now[:, : Y + 1], env.task.start
        assert np.hypot(*(at - start[:2]).T).min() > 6 + 6 + 2 * 20
        far = np.hypot(*np.moveaxis(at[:, None] - at, 2, 0))
        assert far[np.triu_indices(30, 1)].min() > 12


def test_scripted_movers_beside_people_have_a_fair_start():
    """Only theirs is looked at; the message counts the people before them."""
    crowd = {"kind": "crowd", "count": 5, "radius": 6, "speed": 20}
    post = {"kind": "route", "points": [[30, 20]], "radius": 6}
    bounce = {"kind": "bounce", "count": 3, "radius": 6, "speed": 20}
    env = hall_env(0, movers=[crowd, bounce])
    for seed in range(10):
        env.reset(seed=seed)
        for _ in range(20):
            assert env.step(STILL)[4]["contact"] is None
    with pytest.raises(TaskError, match="mover 5 starts on the robot"):
        hall_env(0, movers=[crowd, post])


def test_people_see_scripted_movers():
    """A disc that drives through people: they make way before it arrives."""
    route = {
        "kind": "route",
        "points": [[20, 130], [240, 130]],
        "loop": False,
        "speed": 25,
        "radius": 6,
    }
    crowd = {"kind": "crowd", "count": 12, "radius": 5, "speed": 25}
    env = hall_env(0, movers=[route, crowd])
    env.reset(seed=2)
    deep = 0
    for _ in range(800):
        env.step(STILL)
        now = env.movers.now
        off = np.hypot(*(now[1:, : Y + 1] - now[0, : Y + 1]).T)
        deep += (off < 0.9 * 11).sum()
    assert deep <= 0.001 * 800 * 12


def test_velocities_are_chosen_within_the_speed():
    env = hall_env(20)
    env.reset(seed=4)
    for _ in range(300):
        env.step(STILL)
        chosen = env.movers.people[:, [NEXT_VX, NEXT_VY]]
        assert np.hypot(*chosen.T).max() <= 20 + 1e-9


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_does_what_single_environments_do(mode):
    options = {
        "map": hall(),
        "start": (20.0, 20.0),
        "goal": (240.0, 140.0),
        "robot_radius": 6.0,
        "horizon": 60,
    }
    each = [
        {"movers": "crowd:9"},
        {"movers": [{"kind": "crowd", "count": 5}, {"kind": "bounce", "count": 4}]},
        {"movers": "bounce:3", "on_collision": "block"},
    ]
    batch = Map2DVectorEnv(6, each=each, autoreset_mode=mode, threads=2, **options)
    makes = [lambda given=each[i % 3]: Map2DEnv(**options, **given) for i in range(6)]
    many = gym.vector.SyncVectorEnv(makes, autoreset_mode=mode)
    assert len(list(assert_alike(many, batch, 5, actions(6, 200)))) == 200
    for i, env in enumerate(many.envs):
        np.testing.assert_array_equal(env.movers.now, batch.movers(i).now)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"movers": "crowd:65"}, "count: .*64"),
        ({"movers": [{"kind": "crowd", "count": 40}] * 2}, "at most 64 people, got 80"),
        ({"movers": [{"kind": "crowd", "radius": 100}]}, "100 px radius has no room"),
        (
            {"movers": [{"kind": "crowd", "count": 60, "radius": 14}]},
            "there is room for .* of the 60 people",
        ),
    ],
)
def test_a_fault_is_one_line(options, message):
    with pytest.raises(TaskError, match=message) as caught:
        hall_env(0, **options)
    assert "\n" not in str(caught.value)


def test_segments_surround_what_is_free():
    """Beside each segment is free space on one side, and a wall on the other."""
    random = np.random.default_rng(0)
    cells = np.zeros((80, 120), bool)
    cells[20:40, 15:50] = cells[40:45, 15:20] = cells[60, 20:100] = True
    y, x = np.mgrid[:80, :120]
    cells |= np.hypot(x - 85, y - 28) < 20
    walls, free = segments_of(cells), []
    for wall in walls[walls[:, LENGTH] >= 4.0]:
        unit = wall[UNIT_X : UNIT_X + 2]
        middle = wall[FROM_X : FROM_X + 2] + 0.5 * wall[LENGTH] * unit
        i, j = np.floor(middle + 2.6 * np.array([-unit[1], unit[0]]) + 0.5).astype(int)
        free.append(not cells[j, i])
    assert len(free) > 15
    assert all(free)
    first, listed = cells_of(walls, cells.shape, 10.0)
    for row, column in random.integers(0, (10, 15), (50, 2)):
        centre = 8.0 * np.array([column + 0.5, row + 0.5])
        off = centre - walls[:, :2]
        along = np.clip((off * walls[:, 2:4]).sum(1), 0.0, walls[:, LENGTH])
        far = np.hypot(*(off - along[:, None] * walls[:, 2:4]).T)
        near = np.flatnonzero(far <= 10.0 + 8.0 * np.sqrt(0.5))
        got = listed[first[row, column] : first[row, column + 1]]
        np.testing.assert_array_equal(got, near)


@pytest.mark.slow
def test_on_many_worlds():
    """500 generated worlds, 10^7 steps of people and of discs that bounce.

    Nobody is ever in a wall.
    """
    tasks = load_set("unknown")
    for index in range(500):
        task = tasks.task("train", index)
        env = hall_env(
            0,
            map=task.terrain.grid.cells,
            start=tuple(task.start[:2]),
            goal=task.goal,
            robot_radius=4.0,
            movers=[
                {"kind": "crowd", "count": 15, "radius": 3, "speed": 20},
                {"kind": "bounce", "count": 5, "radius": 4, "speed": 40},
            ],
        )
        walk = Walk(env, seed=index, steps=1000)
        assert walk.inside == 0


@pytest.mark.slow
def test_people_of_the_level_walk():
    """1,000 steps in 40 worlds of the level `crowd`: the figures that are promised."""
    tasks, speeds, inside, stood = load_set("crowd"), [], [], []
    for index in range(40):
        task = tasks.task("train", index)
        own = task.movers.traits
        at = foreseen(task, 1000)
        steps = np.hypot(*np.moveaxis(np.diff(at, axis=0), 2, 0))
        speeds += (steps.mean(axis=0) / (own[:, SPEED] * task.dt)).tolist()
        inside += deep(at, own[:, RADIUS]).ravel().tolist()
        stood += standing(at, 300, own[:, RADIUS]).tolist()
    assert np.median(speeds) >= 0.6
    assert np.mean(inside) <= 1e-3
    assert np.mean(stood) < 0.02
