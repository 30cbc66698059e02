"""Promises of the seeded disturbances that both robots share."""

import math
import pickle

import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_alike, assert_same
from scipy import stats
from world_texts import text

from tdac_envs import read_world, wrap_for_rl
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.observed import ENCODER_STEP
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.wrappers import GoalView

HALF, FULL = np.full(2, 0.5, np.float32), np.ones(2, np.float32)
SPIN = np.array([0.5, -0.5], np.float32)
EACH = {
    "wheel_slip": 0.1,
    "wheel_gains": 0.12,
    "axle_error": 0.05,
    "odometry": True,
    "odometry_scale": 0.05,
    "odometry_noise": 0.1,
}
RAYS = {"range_noise": 0.05, "range_dropout": 0.2}
IDS = {
    "TDAC-Map2D-v0": {**EACH, **RAYS},
    "TDAC-EPuck-v0": {**EACH, "sensor_noise": 1.0, "encoders": True},
}
every_env = pytest.mark.parametrize("name", IDS)


def on_map(**options):
    """A square without obstacles."""
    cells = np.zeros((300, 300), bool)
    return Map2DEnv(cells, (150, 150, 0), (250, 150), **options)


def in_world(*nodes, **options):
    """A plain without walls, but for some nodes."""
    world = read_world(text("E-puck { }", *nodes))
    return EPuckEnv(world, (0.0, 0.0, 0.3), (3.0, 3.0), **options)


MAKERS = pytest.mark.parametrize("make", [on_map, in_world])


def motion(env, action):
    """Length and turn of a step without contacts, from the poses before and after."""
    x, y, heading = env.pose()
    env.step(action)
    end_x, end_y, end_heading = env.pose()
    turn = math.remainder(end_heading - heading, 2 * math.pi)
    middle = heading + turn / 2
    chord = (end_x - x) * math.cos(middle) + (end_y - y) * math.sin(middle)
    return chord * (turn / 2) / math.sin(turn / 2) if turn else chord, turn


def gains_of(env, action=HALF):
    """The gains of the left and the right wheel, from the motion of a step."""
    forward, turn = motion(env, action)
    across = turn * env.task.axle_length / 2
    left, right = forward + across, forward - across
    speeds = np.array([left, right]) / env.task.full_step / action
    return speeds if isinstance(env, Map2DEnv) else speeds[::-1]


@every_env
def test_nothing_is_added_by_default(name):
    """Observations have the keys and spaces of an environment without the options."""
    usual = {"pose", "goal", "wheel_speeds"}
    usual |= {"ranges"} if "Map" in name else {"ps", "wheel_positions"}
    plain = gym.make(name).observation_space
    assert set(plain.keys()) == usual
    more = gym.make(name, **IDS[name]).observation_space
    assert {key: more[key] for key in usual} == dict(plain.items())
    added = {"odometry"} if "Map" in name else {"odometry", "encoders"}
    assert set(more.keys()) == usual | added
    assert list(more.keys()) == sorted(more.keys())


@MAKERS
def test_gains_are_uniform_and_last_an_episode(make):
    """Drawn at each reset for each wheel, within 1 +- the bound."""
    env, drawn = make(wheel_gains=0.12), []
    env.reset(seed=0)
    for _ in range(400):
        env.reset()
        drawn.append(gains_of(env))
        np.testing.assert_allclose(gains_of(env), drawn[-1], rtol=1e-6)
    found = np.array(drawn)
    assert 0.88 <= found.min() < 0.885
    assert 1.115 < found.max() <= 1.12
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.15
    for wheel in found.T:
        assert stats.kstest(wheel, "uniform", (0.88, 0.24)).pvalue > 1e-3


@MAKERS
def test_no_wheel_is_faster_than_the_full_speed(make):
    """At full command neither gains nor slip lead beyond it, on the ground neither."""
    env = make(wheel_gains=0.3, wheel_slip=0.3, horizon=10**6)
    env.reset(seed=0)
    speeds = []
    for _ in range(300):
        env.reset()
        observation, *_ = env.step(FULL)
        assert observation["wheel_speeds"].tolist() == [1.0, 1.0]
        speeds.append(gains_of(env, FULL))
    assert np.max(speeds) <= 1.0 + 1e-9
    assert np.mean(np.isclose(speeds, 1.0)) > 0.2
    assert np.min(speeds) < 0.7


@MAKERS
def test_wheel_speeds_are_commands(make):
    """After clipping, delay and lag, whatever the gains are."""
    options = {"motor_lag": 0.1, "delay": 1}
    exact, other = make(**options), make(wheel_gains=0.2, **options)
    exact.reset(seed=0)
    other.reset(seed=0)
    for _ in range(10):
        one, two = exact.step(HALF)[0], other.step(HALF)[0]
        np.testing.assert_array_equal(one["wheel_speeds"], two["wheel_speeds"])
    assert (one["pose"] != two["pose"]).any()


@MAKERS
def test_the_axle_error_is_uniform_and_lasts_an_episode(make):
    """The robot turns as one whose axle is longer or shorter by up to the bound."""
    env, exact = make(axle_error=0.1), make()
    env.reset(seed=0)
    exact.reset(seed=0)
    usual, errors = motion(exact, SPIN)[1], []
    for _ in range(400):
        env.reset()
        errors.append(usual / motion(env, SPIN)[1] - 1.0)
        again = usual / motion(env, SPIN)[1] - 1.0
        assert again == pytest.approx(errors[-1], abs=1e-6)
    assert stats.kstest(errors, "uniform", (-0.1, 0.2)).pvalue > 1e-3
    assert np.abs(errors).max() <= 0.1 + 1e-6


@MAKERS
@pytest.mark.parametrize("blocked", ["terminate", "block"])
def test_exact_odometry_is_the_true_motion(make, blocked):
    """With gains, slip and axle error; (0, 0) after a reset."""
    options = {"wheel_gains": 0.1, "axle_error": 0.1, "wheel_slip": 0.1}
    env = make(odometry=True, on_collision=blocked, **options)
    for action in actions(1, 40, 1)[:, 0]:
        observation, _ = env.reset()
        assert observation["odometry"].tolist() == [0.0, 0.0]
        before = env.pose()
        seen = env.step(action)[0]["odometry"]
        after = env.pose()
        turn = math.remainder(after[2] - before[2], 2 * math.pi)
        chord = math.hypot(*(after - before)[:2])
        assert seen[1] == pytest.approx(turn, abs=1e-6)
        arc = chord * (turn / 2) / math.sin(turn / 2) if turn else chord
        assert abs(seen[0]) == pytest.approx(arc, rel=1e-5, abs=1e-7)
        ahead = (after - before)[:2] @ [np.cos(before[2]), np.sin(before[2])]
        assert seen[0] * ahead >= 0.0


def against_a_wall(robot, **options):
    """The last odometry, motion and full step of a robot that meets a wall."""
    if robot == "map":
        cells = np.zeros((100, 100), bool)
        cells[40:60, 60:63] = True
        env = Map2DEnv(cells, (45, 50, 0), (90, 50), robot_radius=5.0, **options)
    else:
        wall = "Wall { translation 0.1 0 0 size 0.01 0.4 0.1 }"
        world = read_world(text("E-puck { }", wall))
        env = EPuckEnv(world, (0.0, 0.0, 0.0), (0.5, 0.0), **options)
    env.reset(seed=0)
    for _ in range(100):
        before = env.pose()
        observation, *_, info = env.step(FULL)
        if info["collision"]:
            moved = math.hypot(*(env.pose() - before)[:2])
            return observation["odometry"], moved, env.task.full_step
    raise AssertionError("no contact")


@pytest.mark.parametrize("robot", ["map", "world"])
def test_a_contact_that_ends_the_episode_cuts_the_odometry(robot):
    """It is what was driven up to there."""
    seen, moved, full = against_a_wall(robot, odometry=True)
    assert moved < 0.95 * full
    assert seen[0] == pytest.approx(moved, rel=1e-4)


@pytest.mark.parametrize("robot", ["map", "world"])
def test_the_wheels_of_a_blocked_robot_go_on(robot):
    """The odometry is that of the wheels, which slip."""
    options = {"odometry": True, "on_collision": "block"}
    seen, moved, full = against_a_wall(robot, **options)
    assert moved < 0.95 * full
    assert seen[0] == pytest.approx(full, rel=1e-6)


@MAKERS
def test_scale_and_noise_of_the_odometry_have_their_sizes(make):
    """Measured = true * (1 + scale of the episode) * (1 + noise of the step)."""
    scaled, noisy = (
        make(odometry=True, odometry_scale=0.05),
        make(odometry=True, odometry_noise=0.1),
    )
    bow = np.array([0.5, 0.3], np.float32)
    exact = make(odometry=True)
    exact.reset(seed=0)
    true = exact.step(bow)[0]["odometry"]
    scaled.reset(seed=0)
    scales = []
    for _ in range(600):
        scaled.reset()
        scales.append(scaled.step(bow)[0]["odometry"] / true - 1.0)
        np.testing.assert_allclose(
            scaled.step(bow)[0]["odometry"] / true - 1.0, scales[-1], atol=1e-5
        )
    errors = []
    for episode in range(100):
        noisy.reset(seed=episode)
        errors += [noisy.step(bow)[0]["odometry"] / true - 1.0 for _ in range(10)]
    for found, size in ((scales, 0.05), (errors, 0.1)):
        for one in np.array(found, np.float64).T / size:
            assert stats.kstest(one, stats.norm.cdf).pvalue > 1e-3
        assert abs(np.corrcoef(np.array(found).T)[0, 1]) < 0.15


def test_dropouts_are_as_frequent_as_said():
    """A dropped ray reads the largest range; each ray in each step on its own."""
    env, exact = on_map(range_dropout=0.05), on_map()
    usual = exact.reset(seed=0)[0]["ranges"]
    most = np.float32(env.nominal.robot.range_max)
    near = usual < most
    assert near.sum() > 3
    seen = np.array([env.reset(seed=k)[0]["ranges"] for k in range(1000)])
    dropped = seen[:, near] == most
    kept = np.broadcast_to(usual[near], dropped.shape)[~dropped]
    np.testing.assert_array_equal(seen[:, near][~dropped], kept)
    count, size = int(dropped.sum()), dropped.size
    assert stats.binomtest(count, size, 0.05).pvalue > 1e-3
    for ray in dropped.T:
        assert stats.binomtest(int(ray.sum()), 1000, 0.05).pvalue > 1e-4
    every = on_map(range_dropout=1, range_noise=0.5)
    assert (every.reset(seed=0)[0]["ranges"] == most).all()


def test_numbers_are_drawn_in_the_documented_order():
    """A generator with the same seed gives every disturbance of two steps."""
    options = {**EACH, **RAYS}
    env, exact = on_map(**options), on_map()
    random = gym.utils.seeding.np_random(7)[0]
    observation, _ = env.reset(seed=7)
    gains = random.uniform(0.88, 1.12, 2)
    axle = env.nominal.axle_length * (1.0 + random.uniform(-0.05, 0.05))
    scales = random.normal(1.0, 0.05, 2)
    most = env.nominal.robot.range_max

    def disturbed(ranges):
        noise = random.normal(1.0, 0.05, ranges.size)
        seen = np.clip(ranges * noise, 0.0, most)
        seen[random.random(ranges.size) < 0.2] = most
        return seen.astype(np.float32)

    first, _ = exact.reset(seed=0)
    np.testing.assert_array_equal(observation["ranges"], disturbed(first["ranges"]))
    for _ in range(2):
        slip = random.normal(1.0, 0.1, 2)
        left, right = np.clip(0.5 * gains * slip, -1, 1) * env.nominal.full_step
        true = np.array([(left + right) / 2, (left - right) / axle])
        observation, *_ = env.step(HALF)
        ranges = env.robot.ranges
        np.testing.assert_array_equal(observation["ranges"], disturbed(ranges))
        seen = true * scales * random.normal(1.0, 0.1, 2)
        np.testing.assert_allclose(observation["odometry"], seen, rtol=1e-6)
    assert random.random() == env.np_random.random()


class TestEncoders:
    def test_they_count_the_true_rotation_in_steps(self):
        """With the gain, but without the slip on the floor."""
        env = in_world(encoders=True, wheel_gains=0.2, wheel_slip=0.2)
        env.reset(seed=3)
        same = in_world(encoders=True, wheel_gains=0.2)
        first, _ = same.reset(seed=3)
        assert first["encoders"].tolist() == [0.0, 0.0]
        for _ in range(50):
            one, two = env.step(HALF)[0], same.step(HALF)[0]
            np.testing.assert_array_equal(one["encoders"], two["encoders"])
        forward, turn = motion(same, HALF)
        half = same.task.axle_length / 2
        true = np.array([forward - half * turn, forward + half * turn]) / 0.02
        off = two["wheel_positions"] - 50 * true
        np.testing.assert_allclose(off, 0.0, atol=1e-4)
        steps = two["encoders"].astype(float) / ENCODER_STEP
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)
        rest = two["encoders"] - two["wheel_positions"]
        assert np.abs(rest).max() <= ENCODER_STEP / 2 + 1e-6
        assert (two["encoders"] > 100 * ENCODER_STEP).all()

    def test_they_do_not_show_the_radii_of_the_wheels(self):
        """Each wheel has a radius of its own, which lasts an episode."""
        env, drawn = in_world(encoders=True, wheel_radius_error=0.1), []
        env.reset(seed=3)
        half = env.task.axle_length / 2
        for _ in range(300):
            first, _ = env.reset()
            forward, turn = motion(env, HALF)
            rims = np.array([forward - half * turn, forward + half * turn])
            turned = env.robot.turned - first["wheel_positions"]
            drawn.append(rims / turned / 0.02)
            usual = 0.5 * env.task.max_wheel_speed * env.task.dt
            np.testing.assert_allclose(turned, usual, rtol=1e-5)
        found = np.array(drawn)
        assert 0.9 - 1e-4 <= found.min() < 0.91
        assert 1.09 < found.max() <= 1.1 + 1e-4
        assert abs(np.corrcoef(found.T)[0, 1]) < 0.2

    def test_a_revolution_has_1000_steps(self):
        """Rounded as in Webots' model of the robot."""
        assert round(2 * math.pi / 1000, 5) == ENCODER_STEP

    def test_the_wheels_do_not_turn_faster_than_their_limit(self):
        env = in_world(encoders=True, wheel_gains=0.5)
        limit = env.task.max_wheel_speed * env.task.dt
        turned = []
        for seed in range(50):
            env.reset(seed=seed)
            turned.append(env.step(FULL)[0]["wheel_positions"] / limit)
        assert np.max(turned) == pytest.approx(1.0, abs=1e-6)
        assert np.min(turned) < 0.8


@pytest.mark.slow_after(6)
@every_env
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("blocked", ["terminate", "block"])
def test_a_batch_does_what_single_environments_do(name, mode, blocked):
    """With everything disturbed, to the last bit."""
    options = {**IDS[name], "on_collision": blocked, "horizon": 20}
    options["variation"] = "jitter"
    if "EPuck" in name:
        options["world"] = "maze"
    kwargs = {"autoreset_mode": mode}
    many = gym.make_vec(name, 4, "sync", vector_kwargs=kwargs, **options)
    batch = gym.make_vec(name, 4, "vector_entry_point", **kwargs, **options)
    assert batch.single_observation_space == many.single_observation_space
    for result in assert_alike(many, batch, 3, actions(4, 60)):
        assert result[0] in batch.observation_space
        over = result[2] | result[3]
        if mode == "Disabled" and over.any():
            again = [env.reset(options={"reset_mask": over}) for env in (many, batch)]
            for one, two in zip(*again, strict=True):
                assert_same(one, two)
    many.close()
    batch.close()


@every_env
def test_robots_of_a_batch_may_differ(name):
    """Each has its own sizes; a copy goes on where the batch was."""
    each = [
        {"odometry": True},
        {"wheel_gains": 0.1, "odometry": True, "odometry_noise": 0.2},
        {"axle_error": 0.1, "odometry": True, "odometry_scale": 0.1},
    ]
    batch = gym.make_vec(name, 4, each=each).unwrapped
    singles = [gym.make(name, **each[i % 3]).unwrapped for i in range(4)]
    observations, _ = batch.reset(seed=5)
    for i, env in enumerate(singles):
        single, _ = env.reset(seed=5 + i)
        assert_same(single, {key: value[i] for key, value in observations.items()})
    copied = pickle.loads(pickle.dumps(batch))
    for action in actions(4, 10):
        observations, *_ = batch.step(action)
        assert_same(copied.step(action)[0], observations)
        assert observations in batch.observation_space
        for i, env in enumerate(singles):
            single, *_ = env.step(action[i])
            assert_same(single, {key: value[i] for key, value in observations.items()})
    for one in (batch, copied):
        one.close()


@every_env
def test_all_robots_of_a_batch_need_the_same_keys(name):
    """Else one line names those that only some observe."""
    line = "the same sensors for all robots of a batch; not all observe odometry$"
    with pytest.raises(TaskError, match=line):
        gym.make_vec(name, 2, each=[{"odometry": True}, {}])


@every_env
def test_wrappers_for_learning_leave_out_what_they_do_not_know(name):
    """`wrap_for_rl` gives the usual array; flattened alone, everything is in it."""
    options = {**IDS[name], "variation": "jitter"}
    usual = wrap_for_rl(gym.make(name)).observation_space
    env, batch = gym.make(name, **options), gym.make_vec(name, 2, **options)
    assert wrap_for_rl(env).observation_space == usual
    assert wrap_for_rl(batch).single_observation_space == usual
    flat, flats = wrap_for_rl(env, ["flatten"]), wrap_for_rl(batch, ["flatten"])
    size = sum(space.shape[0] for space in env.observation_space.values())
    assert flat.observation_space.shape == (size,)
    np.testing.assert_array_equal(flat.reset(seed=3)[0], flats.reset(seed=3)[0][0])
    one, many = flat.step(HALF)[0], flats.step(np.stack([HALF, HALF]))[0]
    np.testing.assert_array_equal(one, many[0])
    assert one in flat.observation_space
    view = GoalView(gym.make(name, **options))
    view.reset(seed=0)
    assert view.step(HALF)[0] in view.observation_space
    batch.close()


@MAKERS
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"wheel_gains": 1}, "expected wheel_gains from 0 to 0.9, got 1"),
        ({"wheel_gains": -0.1}, "expected wheel_gains from 0 to 0.9, got -0.1"),
        ({"axle_error": 0.95}, "expected axle_error from 0 to 0.9, got 0.95"),
        ({"axle_error": math.nan}, "expected axle_error to be a finite number"),
        ({"odometry_noise": 0.1}, "odometry_noise needs odometry=True"),
        ({"odometry_scale": 0.1}, "odometry_scale needs odometry=True"),
        ({"odometry": True, "odometry_scale": 2}, "odometry_scale from 0 to 1, got 2"),
        ({"odometry": True, "odometry_noise": "x"}, "odometry_noise to be a finite"),
    ],
)
def test_what_cannot_be_used_is_named(make, given, message):
    """In one line, by the argument's name."""
    with pytest.raises(TaskError, match=message):
        make(**given)


def test_a_dropout_is_a_probability():
    """Others are refused."""
    with pytest.raises(TaskError, match="expected range_dropout from 0 to 1, got 2"):
        on_map(range_dropout=2)
