"""Promises of what a robot on a map is told late, wrongly or not at all."""

import math

import gymnasium as gym
import numpy as np
import pytest
from batches import actions, assert_alike, assert_same
from gymnasium.utils.env_checker import check_env

from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.reception import JUMP, Receiver, Reception

RECEIVED = {
    "pose_noise": 1.5,
    "heading_noise": 0.05,
    "pose_correlation": 0.4,
    "pose_jumps": 60.0,
    "pose_delay": 2,
    "scan_delay": 3,
    "message_drop": 0.3,
}
ALL = {
    **RECEIVED,
    "range_noise": 0.05,
    "range_dropout": 0.05,
    "range_min": 12.0,
    "wheel_radius_error": 0.05,
    "max_acceleration": 150.0,
    "max_speed": 60.0,
    "max_turn_rate": 3.0,
    "odometry": True,
    "delay": 1,
    "motor_lag": 0.1,
}


def on_map(**options):
    """A square without obstacles."""
    cells = np.zeros((300, 300), bool)
    own = {"horizon": 10**6, "n_rays": 5, **options}
    return Map2DEnv(cells, (150, 150, 0), (280, 150), **own)


def test_nothing_changes_without_them():
    """The environment observes what it did, with the same random numbers."""
    plain = on_map(range_noise=0.1, wheel_slip=0.1)
    other = on_map(range_noise=0.1, wheel_slip=0.1, **dict.fromkeys(RECEIVED, 0))
    assert_same(plain.reset(seed=3)[0], other.reset(seed=3)[0])
    for action in 0.3 * actions(1, 30)[:, 0]:
        assert_same(plain.step(action)[0], other.step(action)[0])
    assert plain.np_random.random() == other.np_random.random()


def test_the_error_is_a_stationary_process():
    """Its deviation is that of the first step on; it forgets within the time given."""
    own = Reception(pose_noise=2.0, heading_noise=0.1, pose_correlation=1.0)
    receiver, random = Receiver(own, 0.1, 10**6, 10**6), np.random.default_rng(0)
    middle, none = np.array([5e5, 5e5, 0.0]), np.zeros(1, np.float32)
    seen = []
    for k in range(24_000):
        receiver.receive(middle, none, k == 0, random)
        seen.append(receiver.pose - middle)
    errors = np.array(seen) / [2.0, 2.0, 0.1]
    assert errors.std(axis=0) == pytest.approx(1.0, abs=0.05)
    assert errors.mean(axis=0) == pytest.approx(0.0, abs=0.15)
    for lag in (1, 10, 20):
        moved = (errors[lag:] * errors[:-lag]).mean(axis=0)
        assert moved == pytest.approx(math.exp(-lag / 10), abs=0.08)
    assert np.abs(np.corrcoef(errors.T)[np.triu_indices(3, 1)]).max() < 0.1
    firsts = []
    for _ in range(3000):
        receiver.receive(middle, none, True, random)
        firsts.append(receiver.pose[0] - middle[0])
    assert np.std(firsts) == pytest.approx(2.0, abs=0.1)


def test_jumps_draw_larger_errors_at_their_rate():
    """All three errors at once, three times as large, so often in a minute."""
    own = Reception(1.0, 0.01, pose_correlation=1e6, pose_jumps=60.0)
    receiver, random = Receiver(own, 0.1, 10**6, 10**6), np.random.default_rng(1)
    middle, none = np.array([5e5, 5e5, 0.0]), np.zeros(1, np.float32)
    seen = []
    for k in range(20_000):
        receiver.receive(middle, none, k == 0, random)
        seen.append((receiver.pose - middle) / [1.0, 1.0, 0.01])
    changes = np.abs(np.diff(seen, axis=0))
    jumps = np.flatnonzero((changes > 0.05).any(axis=1))
    assert len(jumps) == pytest.approx(20_000 * 0.1, rel=0.1)
    assert np.array(seen)[jumps + 1].std(axis=0) == pytest.approx(JUMP, rel=0.08)


def test_the_truth_stays_where_it_is():
    """Info, reward and the true pose are those of the exact robot."""
    exact, other = on_map(), on_map(**{**RECEIVED, "pose_noise": 20.0})
    exact.reset(seed=0)
    other.reset(seed=0)
    for action in 0.3 * actions(1, 60)[:, 0]:
        _, reward, *_, info = exact.step(action)
        seen, same_reward, *_, same_info = other.step(action)
        assert (reward, info) == (same_reward, same_info)
        np.testing.assert_array_equal(exact.pose(), other.pose())
    assert np.abs(seen["pose"][:2] - other.pose()[:2]).max() > 1.0


def test_late_and_lost_messages_replay():
    """Observed are the values of some steps before, or again those seen last."""
    options = {"pose_delay": 2, "scan_delay": 3, "message_drop": 0.4}
    exact, other = on_map(), on_map(**options)
    first = exact.reset(seed=5)[0]
    seen = other.reset(seed=5)[0]
    random = np.random.default_rng()
    random.bit_generator.state = other.np_random.bit_generator.state
    poses, scans = [first["pose"]], [first["ranges"]]
    told = {"pose": poses[0], "ranges": scans[0]}
    assert_same(seen, {**first, **told})
    for k, action in enumerate(0.3 * actions(1, 80)[:, 0], 1):
        now = exact.step(action)[0]
        poses.append(now["pose"])
        scans.append(now["ranges"])
        if random.random() >= 0.4:
            told = {"pose": poses[max(k - 2, 0)], "ranges": scans[max(k - 3, 0)]}
        assert_same(other.step(action)[0], {**now, **told})


def test_what_a_controller_does_with_an_observation_stays_there():
    """The robot keeps its own copy of what is late."""
    env = on_map(scan_delay=2, pose_delay=2)
    first = env.reset(seed=0)[0]
    kept = first["ranges"].copy()
    first["ranges"][:] = -1.0
    first["pose"][:] = -1.0
    seen = env.step(np.ones(2, np.float32))[0]
    np.testing.assert_array_equal(seen["ranges"], kept)
    assert seen["pose"][0] == 150.0


def test_near_surfaces_are_not_seen():
    """A range below the least one reads as the argument says; others stay."""
    cells = np.zeros((100, 200), bool)
    cells[:, 130:] = True
    for below, reading in (("range_max", 80.0), ("range_min", 30.0), ("zero", 0.0)):
        make = {"n_rays": 1, "robot_radius": 5, "range_max": 80.0, "below_min": below}
        for x, distance in ((60.0, 69.5), (110.0, reading)):
            env = Map2DEnv(cells, (x, 50, 0), (20, 20), range_min=30.0, **make)
            assert env.reset(seed=0)[0]["ranges"].tolist() == [distance]


@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_no_wheel_accelerates_faster(lag):
    """Whatever the commands are; a robot that may, reaches the full speed."""
    env = on_map(max_acceleration=100.0, max_wheel_speed=50.0, dt=0.05, motor_lag=lag)
    env.reset(seed=0)
    before = env.step(np.zeros(2, np.float32))[0]["wheel_speeds"]
    largest = 0.0
    random = np.random.default_rng(0)
    for action in np.repeat(random.uniform(-1, 1, (40, 2)), 5, axis=0):
        after = env.step(action.astype(np.float32))[0]["wheel_speeds"]
        largest = max(largest, np.abs(after - before).max())
        before = after
    assert largest * 50.0 <= 100.0 * 0.05 * (1 + 1e-5)
    assert largest * 50.0 > 4.0
    env.reset(seed=0)
    for _ in range(9):
        seen = env.step(np.ones(2, np.float32))[0]
    assert (seen["wheel_speeds"].min() == 0.9) if not lag else True
    assert env.reset(seed=0)[0]["wheel_speeds"].tolist() == [0.0, 0.0]
    assert env.step(np.ones(2, np.float32))[0]["wheel_speeds"].max() <= 0.1 + 1e-6


@pytest.mark.parametrize("frame", ["v", "turn", "both"])
def test_the_body_keeps_its_limits_and_its_curve(frame):
    """A command beyond a limit is scaled down, both wheels alike; others stay."""
    limits = {"max_speed": 40.0, "max_turn_rate": 1.0}
    if frame != "both":
        limits.pop("max_turn_rate" if frame == "v" else "max_speed")
    env = on_map(max_wheel_speed=50.0, axle_length=30.0, **limits)
    for left, right in np.random.default_rng(0).uniform(-1, 1, (60, 2)).tolist():
        env.reset(seed=0)
        action = np.array([left, right], np.float32)
        found = env.step(action)[0]["wheel_speeds"].astype(float)
        speed, turn = 25.0 * (left + right), 50.0 * (left - right) / 30.0
        part = min(
            1.0,
            limits.get("max_speed", math.inf) / abs(speed),
            limits.get("max_turn_rate", math.inf) / abs(turn),
        )
        np.testing.assert_allclose(found, part * action, rtol=1e-5)
        if part == 1.0:
            np.testing.assert_array_equal(found, action)


def test_wheel_radii_are_hidden_errors_of_the_motion():
    """Drawn at each reset for each wheel; the observed commands do not show them."""
    env, exact = on_map(wheel_radius_error=0.1), on_map()
    half, turns = np.full(2, 0.5, np.float32), set()
    exact.reset(seed=0)
    way = exact.step(half)[0]["pose"][0] - 150
    for seed in range(20):
        env.reset(seed=seed)
        seen = env.step(half)[0]
        assert seen["wheel_speeds"].tolist() == [0.5, 0.5]
        assert math.dist(env.pose()[:2], (150, 150)) == pytest.approx(way, rel=0.1)
        turns.add(round(float(env.pose()[2]), 6))
    assert len(turns) == 20


CASES = {
    "maze": {"variation": "jitter", "horizon": 40, **ALL},
    "movers": {"map": "office", "movers": "bounce:3", "horizon": 30, **ALL},
}


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_a_batch_does_what_single_environments_do(case, mode):
    """To the last bit, also where episodes begin anew or not all robots are reset."""
    count, options, kwargs = 3, CASES[case], {"autoreset_mode": mode}
    many = gym.make_vec("TDAC-Map2D-v0", count, "sync", vector_kwargs=kwargs, **options)
    batch = gym.make_vec(
        "TDAC-Map2D-v0", count, "vector_entry_point", **kwargs, **options
    )
    for result in assert_alike(many, batch, 4, actions(count, 90)):
        over = result[2] | result[3]
        if mode == "Disabled" and over.any():
            again = [env.reset(options={"reset_mask": over}) for env in (many, batch)]
            for one, two in zip(*again, strict=True):
                assert_same(one, two)


def test_robots_of_a_batch_may_differ():
    """One robot has a localiser, the other one the truth."""
    each = [{"pose_noise": 3.0}, {}]
    batch = gym.make_vec("TDAC-Map2D-v0", 2, each=each).unwrapped
    seen = batch.reset(seed=0)[0]["pose"]
    exact = batch.pose().astype(np.float32)
    assert (seen[0] != exact[0]).any()
    np.testing.assert_array_equal(seen[1], exact[1])


def test_gymnasium_has_nothing_to_say_with_all_of_them():
    """Observations stay in their space, and seeds determine them."""
    check_env(gym.make("TDAC-Map2D-v0", map="office", **ALL).unwrapped)


def test_poses_stay_on_the_map():
    """Also those of a bad localiser, whose errors are larger than the map."""
    env = on_map(pose_noise=500.0, heading_noise=3.0)
    seen = [env.reset(seed=k)[0] for k in range(50)]
    assert all(each in env.observation_space for each in seen)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pose_noise": -1.0}, "pose_noise of at least 0"),
        ({"heading_noise": 4.0}, "heading_noise from 0 to 3.14159"),
        ({"pose_correlation": 1.0}, "pose_correlation needs pose_noise or"),
        ({"pose_jumps": 1.0}, "pose_jumps needs pose_noise or"),
        ({"pose_delay": 1.5}, "pose_delay to be a whole number from 0 to 1000"),
        ({"scan_delay": -1}, "scan_delay to be a whole number from 0 to 1000"),
        ({"message_drop": 2.0}, "message_drop from 0 to 1"),
        ({"range_min": 500.0}, "range_min below 220 .range_max., got 500"),
        ({"below_min": "nan"}, "below_min to be one of"),
        ({"max_acceleration": -1.0}, "max_acceleration of at least 0"),
        ({"max_speed": 0.0}, "max_speed above 0"),
        ({"max_turn_rate": math.nan}, "max_turn_rate to be a finite number"),
    ],
)
def test_a_wrong_value_is_named(options, message):
    """With what was expected."""
    with pytest.raises(TaskError, match=message):
        on_map(**options)
