"""Promises of TDAC-Map2D-v0 with moving discs."""

import json
import math
import pickle
from typing import ClassVar

import brute_force
import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_alike, assert_goes_on, assert_same
from gymnasium.envs.registration import EnvSpec

from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.vector import Map2DVectorEnv
from tdac_envs.movers.state import RADIUS, VX, VY

STILL = np.zeros(2, np.float32)
FULL = np.ones(2, np.float32)


def hall(width=200, height=100):
    """An empty map."""
    return np.zeros((height, width), bool)


def hall_env(movers, **options):
    given = {
        "map": hall(),
        "start": (30.0, 50.0),
        "goal": (180.0, 50.0),
        "robot_radius": 8.0,
        "max_wheel_speed": 40.0,
        "movers": movers,
        **options,
    }
    return Map2DEnv(**given)


def route(*points, **options):
    return {
        "kind": "route",
        "points": list(points),
        "speed": 20,
        "radius": 6,
        **options,
    }


def bounce(x, y, heading=0.0, **options):
    given = {"speed": 30, "radius": 6, **options}
    return {"kind": "bounce", "start": (x, y), "heading": heading, **given}


class TestRoutes:
    def test_way_points_are_passed_at_their_exact_time(self):
        """A triangle in steps that end between the waypoints."""
        env = hall_env([route((100, 20), (140, 20), (140, 50), phase=0.0)], dt=0.07)
        env.reset(seed=0)
        corners = np.array([[100, 20], [140, 20], [140, 50], [100, 20]], float)
        ends = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        for step in range(1, 300):
            env.step(STILL)
            along = 20 * 0.07 * step % ends[-1]
            expected = [np.interp(along, ends, corners[:, k]) for k in (0, 1)]
            np.testing.assert_allclose(env.movers.now[0, :2], expected, atol=1e-9)

    def test_back_and_forth(self):
        env = hall_env([route((100, 20), (140, 20), loop=False, phase=0.25)])
        env.reset(seed=0)
        assert env.movers.now[0, 0] == pytest.approx(120.0)
        places = []
        for _ in range(200):
            env.step(STILL)
            places.append(env.movers.now[0, 0])
        along = (20 + np.arange(1, 201)) % 80
        np.testing.assert_allclose(
            places, 100 + np.minimum(along, 80 - along), atol=1e-9
        )

    def test_many_way_points_in_a_step(self):
        """The path within a step bends as often as the route does."""
        angles = np.linspace(0, 2 * math.pi, 80, endpoint=False)
        circle = np.column_stack([120 + 12 * np.cos(angles), 50 + 12 * np.sin(angles)])
        env = hall_env([route(*circle.tolist(), speed=100, phase=0.0)])
        env.reset(seed=0)
        side = 2 * 12 * math.sin(math.pi / 80)
        for step in range(1, 60):
            env.step(STILL)
            turn = 5.0 * step / side
            whole = int(turn)
            begin, end = circle[whole % 80], circle[(whole + 1) % 80]
            expected = begin + (turn - whole) * (end - begin)
            np.testing.assert_allclose(env.movers.now[0, :2], expected, atol=1e-9)

    def test_one_way_point_stands(self):
        env = hall_env([route((120, 30))])
        env.reset(seed=0)
        for _ in range(5):
            env.step(STILL)
        assert env.movers.now[0, :4].tolist() == [120.0, 30.0, 0.0, 0.0]


class TestBounces:
    def test_between_two_walls(self):
        """The time of each bounce is exact; speed is kept."""
        env = hall_env([bounce(150, 30)])
        env.reset(seed=0)
        low, high = -0.5 + 6, 199.5 - 6
        for step in range(1, 400):
            env.step(STILL)
            along = (150 - low + 1.5 * step) % (2 * (high - low))
            expected = low + min(along, 2 * (high - low) - along)
            assert env.movers.now[0, 0] == pytest.approx(expected, abs=1e-4)
            assert np.hypot(*env.movers.now[0, [VX, VY]]) == pytest.approx(30.0)

    def test_off_a_corner_the_normal_is_that_of_the_disc(self):
        cells = hall()
        cells[60, 150] = True
        env = hall_env([bounce(120, 56.5, speed=40.0)], map=cells)
        env.reset(seed=0)
        for _ in range(60):
            env.step(STILL)
            if abs(env.movers.now[0, VY]) > 1e-9:
                break
        # The corner (149.5, 59.5) is 3 px below the line of the centre.
        away = np.array([-math.sqrt(36 - 9), -3.0]) / 6
        direction = np.array([1.0, 0.0]) - 2 * away[0] * away
        np.testing.assert_allclose(env.movers.now[0, 2:4] / 40, direction, atol=1e-6)

    def test_a_passage_as_wide_as_the_disc(self):
        """Dozens of bounces in a step end in a pause, not in a wall."""
        cells = hall()
        cells[:, 100] = cells[:, 114] = True
        movers = [bounce(107, 30, 0.0, radius=6.49999, speed=100.0)]
        env = hall_env(movers, map=cells, goal=(80.0, 50.0))
        env.reset(seed=0)
        for _ in range(50):
            env.step(STILL)
            assert abs(env.movers.now[0, 0] - 107) < 1e-4

    @pytest.mark.parametrize("seed", range(4))
    def test_no_disc_enters_a_wall(self, seed):
        """On random maps, for discs of several sizes and speeds."""
        random = np.random.default_rng(seed)
        cells = random.random((60, 90)) < 0.01
        cells[20:40, :30] = False
        movers = [
            {"kind": "bounce", "count": 8, "speed": float(speed), "radius": radius}
            for radius, speed in ((1.0, 20), (2.5, 60), (3.3, 400))
        ]
        env = Map2DEnv(
            cells, (10.0, 30.0), (20.0, 30.0), robot_radius=1.0, goal_tolerance=1.0,
            movers=movers, on_collision="block", horizon=10_000,
        )  # fmt: skip
        env.reset(seed=seed)
        for _ in range(400):
            env.step(STILL)
            x, y, radius = env.movers.discs().T
            assert (brute_force.distance(cells, x, y) >= radius - 1e-7).all()


class TestContacts:
    def test_a_mover_hits_a_robot_that_stands(self):
        env = hall_env([bounce(139.5, 50, math.pi)])
        env.reset(seed=0)
        terminated, step = False, 0
        while not terminated:
            _, reward, terminated, _, info = env.step(STILL)
            step += 1
        assert (info["collision"], info["contact"]) == (True, "mover_standing")
        assert reward < -9.0
        # 95.5 px at 1.5 px a step.
        assert step == 64
        assert env.movers.now[0, 0] - env.pose()[0] == pytest.approx(14.0, abs=1e-6)

    def test_a_robot_drives_against_a_mover(self):
        env = hall_env([route((100, 50))])
        env.reset(seed=0)
        terminated = False
        while not terminated:
            _, _, terminated, _, info = env.step(FULL)
        assert info["contact"] == "mover"
        assert env.pose()[0] == pytest.approx(100.0 - 14.0, abs=1e-6)

    def test_the_first_of_wall_and_mover_counts(self):
        cells = hall()
        cells[:, 110] = True
        for place, expected in ((100.0, "mover"), (140.0, "wall")):
            env = hall_env([route((place, 50))], map=cells, goal=(30.0, 80.0))
            env.reset(seed=0)
            terminated = False
            while not terminated:
                _, _, terminated, _, info = env.step(FULL)
            assert info["contact"] == expected

    def test_both_stop_for_the_rest_of_the_step(self):
        env = hall_env([bounce(150, 50, math.pi)], on_collision="block")
        env.reset(seed=0)
        infos = [env.step(FULL)[4] for _ in range(60)]
        assert infos[-1]["contact"] == "mover_standing"
        gap = env.movers.now[0, 0] - env.pose()[0]
        assert gap == pytest.approx(14.0, abs=1e-6)
        first = next(k for k, info in enumerate(infos) if info["contact"])
        assert infos[first]["contact"] == "mover"
        assert infos[-1]["collisions"] == 60 - first
        # Half of the way for each, in proportion to the speeds.
        assert env.pose()[0] == pytest.approx(30 + 106 * 40 / 70, abs=1e-4)

    def test_a_faster_mover_behind_does_not_pin_the_robot(self):
        env = hall_env([bounce(150, 50, math.pi, speed=39)], on_collision="block")
        env.reset(seed=0)
        for _ in range(40):
            env.step(FULL)
        before = env.pose()[0]
        for _ in range(8):
            env.step(-FULL)
        assert before - env.pose()[0] > 4.0

    def test_a_robot_that_is_blocked_may_turn(self):
        env = hall_env([route((60, 50))], on_collision="block")
        env.reset(seed=0)
        for _ in range(30):
            env.step(np.array([1.0, 0.5], np.float32))
        assert abs(env.pose()[2]) > 0.2
        gap = math.dist(env.movers.now[0, :2], env.pose()[:2])
        assert gap >= 14.0 - 1e-6

    @pytest.mark.parametrize("seed", range(3))
    def test_no_overlap_in_a_crowded_hall(self, seed):
        """Neither with walls nor with the robot, which slides and is hit."""
        env = hall_env(
            [{"kind": "bounce", "count": 12, "radius": 5.0, "speed": 35.0}],
            on_collision="block", horizon=5000,
        )  # fmt: skip
        env.reset(seed=seed)
        random = np.random.default_rng(seed)
        kinds = set()
        for k in range(500):
            if k % 25 == 0:
                action = random.uniform(-1, 1, 2).astype(np.float32)
            *_, info = env.step(action)
            kinds.add(info["contact"])
            x, y, radius = env.movers.discs().T
            gaps = np.hypot(x - env.pose()[0], y - env.pose()[1]) - radius - 8.0
            assert gaps.min() > -1e-6
            assert (brute_force.distance(hall(), x, y) >= radius - 1e-7).all()
        assert {None, "mover"} <= kinds


class TestStarts:
    @pytest.mark.parametrize("variation", ["nominal", "jitter", "random"])
    def test_no_mover_touches_a_standing_robot_within_two_seconds(self, variation):
        movers = [{"kind": "bounce", "count": 6}, route((60, 20), (60, 80))]
        env = hall_env(movers, variation=variation)
        starts = set()
        for seed in range(25):
            env.reset(seed=seed)
            starts.add(tuple(env.movers.now[0].tolist()))
            for _ in range(40):
                assert not env.step(STILL)[4]["collision"]
        assert len(starts) == 25

    def test_equal_seeds_give_equal_starts(self):
        env, again = (hall_env("bounce:4") for _ in range(2))
        for seed in (3, 4):
            env.reset(seed=seed)
            again.reset(seed=seed)
            np.testing.assert_array_equal(env.movers.now, again.movers.now)

    @pytest.mark.parametrize(
        ("mover", "message"),
        [
            (bounce(40, 50), "mover 0 starts on the robot: .* 10.0 px .* 14.0 px"),
            (bounce(80, 50, math.pi), "mover 0 .* reaches the robot.*within 2 s"),
            (route((60, 50), (30, 50), phase=0.0), "mover 0 .* reaches the robot"),
            (route((30, 60)), "mover 0 starts on the robot"),
            (route((30, 60), (31, 60)), "mover 0 reaches .* wherever it starts"),
            (route((60, 50), (60, 99)), "mover 0: waypoint 1 of its route is at"),
            (route((20, 20), (150, 20), (150, 80)), "mover 0: segment 2 of its route"),
            (route((5, 5), radius=6.0), "mover 0: it stands at"),
            (bounce(3, 3), "mover 0: it starts at"),
            ({"kind": "bounce", "radius": 60}, "mover 0: a disc of 60 px"),
            (route((168, 50), radius=31), "mover 0 covers the goal .* for ever"),
            (route((100, 20), (101, 20), speed=2000), "more than 14 waypoints"),
            (bounce(100, 50, speed=1e9), "the limit is"),
        ],
    )
    def test_a_fault_is_one_line(self, mover, message):
        cells = hall()
        cells[40:60, 95] = True
        with pytest.raises(TaskError, match=message) as caught:
            hall_env([mover], map=cells)
        assert "\n" not in str(caught.value)

    def test_a_mover_that_moves_off_the_goal_is_fine(self):
        hall_env([route((168, 50), (120, 50), radius=31)]).reset(seed=0)


class TestBatch:
    OPTIONS: ClassVar = {"map": hall(), "start": (30.0, 50.0), "goal": (180.0, 50.0)}
    EACH: ClassVar = [
        {"movers": "bounce:7", "robot_radius": 6.0},
        {"movers": None, "robot_radius": 6.0},
        {
            "movers": [route((100, 20), (140, 60)), bounce(150, 80, 1.0)],
            "variation": "jitter",
            "on_collision": "block",
        },
        {"movers": "bounce:9", "on_collision": "block", "robot_radius": 5.0},
    ]

    @pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
    def test_it_does_what_single_environments_do(self, mode):
        """To the last bit, with as many movers as each robot has."""
        batch = Map2DVectorEnv(
            6,
            each=self.EACH,
            horizon=40,
            autoreset_mode=mode,
            threads=2,
            **self.OPTIONS,
        )
        kinds = [self.EACH[i % 4] for i in range(6)]
        makes = [
            lambda given=given: Map2DEnv(**{"horizon": 40, **self.OPTIONS, **given})
            for given in kinds
        ]
        many = gym.vector.SyncVectorEnv(makes, autoreset_mode=mode)
        contacts = set()
        for result in assert_alike(many, batch, 5, actions(6, 150)):
            contacts |= set(result[4]["contact"])
        assert "mover" in contacts
        for i, env in enumerate(many.envs):
            np.testing.assert_array_equal(env.movers.now, batch.movers(i).now)

    def test_a_pickle_goes_on_where_the_batch_was(self):
        assert_goes_on(Map2DVectorEnv(4, each=self.EACH, **self.OPTIONS), 4)

    def test_frames_are_those_of_single_environments(self):
        options = {**self.OPTIONS, "movers": "bounce:5", "render_mode": "rgb_array"}
        batch, single = Map2DVectorEnv(2, **options), Map2DEnv(**options)
        batch.reset(seed=[1, 2])
        single.reset(seed=2)
        for _ in range(10):
            batch.step(np.zeros((2, 2), np.float32))
            single.step(STILL)
        frame, own = batch.render()[1], single.render()
        assert frame.shape == own.shape or frame.size > 0
        twin = pickle.loads(pickle.dumps(batch))
        np.testing.assert_array_equal(twin.render()[1], frame)
        batch.step(np.zeros((2, 2), np.float32))
        assert (batch.render()[1] != frame).any()


def test_movers_out_of_reach_change_nothing():
    """The robot's motion, rewards and ranges are those without movers, bit for bit."""
    cells = hall()
    cells[:, 100] = True
    for how in ("terminate", "block"):
        options = {"map": cells, "goal": (80.0, 80.0), "on_collision": how}
        far = [{"kind": "bounce", "start": (150, 50), "radius": 6, "heading": 0.3}]
        with_movers, without = hall_env(far, **options), hall_env(None, **options)
        for one, two in zip(
            with_movers.reset(seed=0), without.reset(seed=0), strict=True
        ):
            assert str(one) == str(two)
        for action in actions(1, 150)[:, 0]:
            one, two = with_movers.step(action), without.step(action)
            assert_same(one[0], two[0])
            assert one[1:] == two[1:]
            if one[2] or one[3]:
                break


def test_movers_are_not_observed_but_by_rays():
    env = hall_env([route((80, 50))])
    seen, _ = env.reset(seed=0)
    assert seen.keys() == {"pose", "goal", "wheel_speeds", "ranges"}
    assert 44 <= seen["ranges"].min() < 45
    assert hall_env(None).reset(seed=0)[0]["ranges"].min() > 45


def test_a_spec_survives_json():
    movers = [route((245, 480), (245, 430)), {"kind": "bounce", "count": 2}]
    env = gym.make("TDAC-Map2D-v0", movers=movers)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert json.loads(env.spec.to_json())["kwargs"]["movers"]
    for one, two in zip(env.reset(seed=1), again.reset(seed=1), strict=True):
        assert str(one) == str(two)


@pytest.mark.slow
@pytest.mark.parametrize("movers", ["bounce:3", "crowd:6"])
def test_ppo_learns_among_movers(movers):
    sb3 = pytest.importorskip("stable_baselines3")
    env = gym.make("TDAC-Map2D-v0", map="office", movers=movers)
    model = sb3.PPO("MultiInputPolicy", env, n_steps=512, seed=0).learn(2000)
    assert model.num_timesteps >= 2000


def test_frames_show_movers_with_a_trail():
    options = {"render_mode": "rgb_array", "heading": math.pi}
    with_movers = hall_env([route((120, 30), (160, 30))], **options)
    without = hall_env(None, **options)
    for env in (with_movers, without):
        env.reset(seed=0)
        for _ in range(8):
            env.step(STILL)
    frames = with_movers.render(), without.render()
    assert frames[0].shape == frames[1].shape
    rows, columns = np.nonzero((frames[0] != frames[1]).any(axis=2))
    scale = frames[0].shape[1] / 200
    _, y, radius = with_movers.movers.discs()[0] * scale
    assert radius == with_movers.movers.traits[0, RADIUS] * scale
    assert np.ptp(rows) == pytest.approx(2 * radius, abs=6)
    assert np.ptp(columns) > 2 * radius + 2
    assert abs(np.mean([rows.min(), rows.max()]) - y) < 6
