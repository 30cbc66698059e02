"""Promises of the wrappers on task sets: sensors alone, for one robot and for many."""

import pickle

import gymnasium as gym
import numpy as np
import pytest
import yaml
from gymnasium.vector import SyncVectorEnv

from tdac_envs import wrap_for_rl
from tdac_envs.core.errors import TaskError
from tdac_envs.learning.dead_reckoning import DeadReckoning, WheelReckoning
from tdac_envs.learning.wrappers import Frame

LADDER = "TDAC-Ladder-v0"
LEVELS = ["unknown", "lost"]
SIZE = 3 + 2
"""Numbers besides the ranges: goal, wheel speeds."""


@pytest.fixture
def few(tmp_path):
    """Writes a set of small worlds and short episodes; gives its path."""

    def write(**values):
        aisles = {"name": "aisles", "width": 220, "height": 180}
        short = {"factor": 1.0, "least": 12, "most": 12}
        path = tmp_path / "few.yaml"
        path.write_text(
            yaml.safe_dump({"worlds": [aisles], "horizon": short, **values})
        )
        return path

    return write


LOST = {
    "observed": ["odometry", "goal", "wheel_speeds", "ranges"],
    "disturbances": {"odometry_scale": 0.05, "odometry_noise": 0.05, "delay": 1},
}
MAP = {"map": True, "frame": "map"}
VIEWED = "goal-relative", "closeness", "map-view", "flatten"
SHARES = ("goal-relative", "flatten")
OWN_MAP = "seen-map", "waypoints", "goal-relative", "closeness", "flatten"


@pytest.mark.parametrize("level", LEVELS)
def test_the_default_is_sensors_alone(level):
    """Flat, closeness, no guidance; the same space for one robot and for many."""
    env = wrap_for_rl(gym.make(LADDER, level=level, split="dev"))
    rays = env.unwrapped.observation_space["ranges"].shape[0]
    assert env.observation_space.shape == (SIZE + rays,)
    batch = wrap_for_rl(gym.make_vec(LADDER, 2, level=level, split="dev"))
    assert batch.single_observation_space == env.observation_space
    seen, _ = env.reset(options={"index": 1})
    assert seen in env.observation_space
    plain, _ = env.unwrapped.reset(options={"index": 1})
    assert np.array_equal(seen[-2:], plain["wheel_speeds"])
    assert np.allclose(seen[3:-2], env.unwrapped.task.body_radius / plain["ranges"])
    batch.close()


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
@pytest.mark.parametrize(
    ("values", "names"),
    [
        *(({}, None), (LOST, None), (MAP, VIEWED), ({}, SHARES), ({}, OWN_MAP)),
        *((LOST, OWN_MAP), (MAP, OWN_MAP), ({"resolution": 0.05}, OWN_MAP)),
    ],
)
def test_a_batch_tells_what_single_environments_tell(few, mode, values, names):
    """To the last bit, also at the ends of episodes and after them."""
    given = {"level": few(**values), "train_pool": 3}
    single = [lambda: wrap_for_rl(gym.make(LADDER, **given), names) for _ in range(3)]
    many = SyncVectorEnv(single, autoreset_mode=mode)
    batch = gym.make_vec(LADDER, 3, autoreset_mode=mode, **given)
    ours = wrap_for_rl(batch, names)
    np.testing.assert_array_equal(many.reset(seed=5)[0], ours.reset(seed=5)[0])
    random, ends = np.random.default_rng(1), 0
    for _ in range(30):
        actions = random.uniform(-1.0, 1.0, (3, 2)).astype(np.float32)
        first, second = many.step(actions), ours.step(actions)
        np.testing.assert_array_equal(first[0], second[0])
        over = first[2] | first[3]
        ends += over.sum()
        if mode == "SameStep":
            for i in np.flatnonzero(over):
                final = first[4]["final_obs"][i], second[4]["final_obs"][i]
                np.testing.assert_array_equal(*final)
    assert ends >= 6
    copy = pickle.loads(pickle.dumps(ours))
    actions = np.ones((3, 2), np.float32)
    np.testing.assert_array_equal(ours.step(actions)[0], copy.step(actions)[0])
    ours.close()
    copy.close()


def test_exact_odometry_adds_up_to_the_true_pose(few):
    """So the goal is where a robot with a pose sees it; also in the next episode."""
    exact = {**LOST, "disturbances": {}}
    env = wrap_for_rl(gym.make(LADDER, level=few(**exact), split="dev"))
    told = wrap_for_rl(gym.make(LADDER, level=few(), split="dev"))
    random = np.random.default_rng(2)
    for index in (4, 5):
        env.reset(options={"index": index})
        # The set with a pose has other worlds: its environment takes this one's.
        plain, frame = env.unwrapped, told.unwrapped.view
        anchor = frame.anchor(plain.task)
        for _ in range(12):
            action = random.uniform(-1.0, 1.0, 2).astype(np.float32)
            seen, *_, ended, _, _ = env.step(action)
            whole = {"ranges": seen, "wheel_speeds": seen[-2:], "goal": seen}
            pose = frame.seen(whole, plain.pose(), anchor)["pose"]
            goal = anchor[5:].astype(np.float32)
            ahead, left = told.env.frame.seen(pose, goal)
            distance = np.hypot(ahead, left)
            assert np.allclose(seen[:2], [ahead / distance, left / distance], atol=1e-4)
            if ended:
                break


def test_a_set_in_metres_is_seen_without_its_unit(few):
    """Bearing and distance of the goal in radii, as from the true pose in px."""
    path = few(resolution=0.05)
    env = wrap_for_rl(gym.make(LADDER, level=path, split="dev"))
    own = Frame.of_task(env.unwrapped.nominal)
    env.reset(options={"index": 2})
    for action in ([0.05, 0.15],) * 6:
        seen, *_ = env.step(np.array(action, np.float32))
        plain = env.unwrapped
        here = {"pose": plain.pose(), "goal": np.array(plain.task.goal)}
        assert np.allclose(seen[:3], own.goal_relative(here)["goal"], atol=1e-5)
        assert np.all((seen >= -1.0) & (seen <= 1.0))


def test_poses_do_not_move_twice_in_a_step():
    """Whoever asks again for the same step gets the same pose."""
    reckoned = DeadReckoning()
    reckoned.follow([0.0, 0.0], 0)
    first = reckoned.follow([2.0, np.pi], 1)
    assert np.array_equal(reckoned.follow([2.0, np.pi], 1), first)
    # A half circle of length 2 has the diameter 4 / pi.
    assert np.allclose(first, [0.0, 4.0 / np.pi, np.pi])
    assert np.array_equal(reckoned.follow([1.0, 1.0], 0), np.zeros(3))


def test_a_given_map_is_seen_around_the_robot():
    """Clearance at points in the robot's frame, ahead first; beside the map it is 0."""
    env = wrap_for_rl(gym.make(LADDER, level="known", split="dev"), ["map-view"])
    for index in range(4):
        view = env.reset(options={"index": index})[0]["map"]
        plain = env.unwrapped
        x, y, heading = plain.pose()
        clear, radius = plain.task.terrain.clear, plain.task.body_radius
        for scale, spacing in enumerate((0.5, 2.0)):
            for row, column in np.ndindex(16, 16):
                ahead = radius * spacing * (7.5 - row)
                right = radius * spacing * (column - 7.5)
                i = round(x + ahead * np.cos(heading) - right * np.sin(heading))
                j = round(y + ahead * np.sin(heading) + right * np.cos(heading))
                inside = 0 <= i < clear.shape[1] and 0 <= j < clear.shape[0]
                expected = min(clear[j, i] / (3 * radius), 1.0) if inside else 0.0
                assert view[scale, row, column] == pytest.approx(expected, abs=1e-6)


def test_a_view_of_a_map_needs_a_map(few):
    """It may be added where there is one, and only there."""
    for names, size in ((VIEWED, 3 + 512 + 18 + 2), (None, 3 + 18 + 2)):
        env = wrap_for_rl(gym.make(LADDER, level="known", split="dev"), names)
        assert env.observation_space.shape == (size,)
        assert env.reset(seed=1)[0] in env.observation_space
    with pytest.raises(TaskError, match="leave out the wrapper 'map-view'"):
        wrap_for_rl(gym.make(LADDER, level=few(), split="dev"), ["map-view"])
    with pytest.raises(TaskError, match="leave out the wrapper 'map-view'"):
        wrap_for_rl(gym.make("TDAC-Map2D-v0"), ["map-view"])
    with pytest.raises(TaskError, match="expected observations in a Dict"):
        wrap_for_rl(gym.make(LADDER, level="known"), ["flatten", "map-view"])


CLOSE = ("goal-relative", "closeness")


def test_closeness_is_one_at_contact():
    """Body radius / distance; it needs ranges that are shares of the largest."""
    env = wrap_for_rl(gym.make(LADDER, level="unknown", split="dev"), CLOSE)
    seen, _ = env.reset(options={"index": 0})
    plain, _ = env.unwrapped.reset(options={"index": 0})
    radius = env.unwrapped.task.body_radius
    assert np.allclose(seen["ranges"], radius / plain["ranges"], rtol=1e-5)
    near = {"ranges": np.array([0.0, radius / 120.0, 1.0], np.float32)}
    closeness = env.frame.closeness(near)["ranges"]
    assert np.allclose(closeness, [1.0, 1.0, radius / 120.0])
    for made in (gym.make, gym.make_vec):
        with pytest.raises(TaskError, match="after the wrapper goal-relative"):
            wrap_for_rl(made(LADDER, level="unknown", split="dev"), ["closeness"])
    with pytest.raises(TaskError, match="expected ranges"):
        wrap_for_rl(gym.make(LADDER, level="epuck", split="dev"), CLOSE)


@pytest.mark.parametrize("made", [gym.make, gym.make_vec])
def test_what_a_robot_cannot_know_is_refused(few, made):
    """In one line that says what to do."""
    with pytest.raises(TaskError, match="leave out the wrapper 'guidance'"):
        wrap_for_rl(made(LADDER, level="unknown", split="dev"), ["guidance"])
    blind = few(observed=["goal", "ranges"])
    with pytest.raises(TaskError, match="expected observations with a goal, and a p"):
        wrap_for_rl(made(LADDER, level=blind, split="dev"))


def test_a_set_may_observe_less(few):
    """Wheel speeds that the set does not have are left out."""
    level = few(observed=["pose", "goal", "ranges"])
    env = wrap_for_rl(gym.make(LADDER, level=level, split="dev"))
    rays = env.unwrapped.observation_space["ranges"].shape[0]
    assert env.reset(seed=0)[0].shape == env.observation_space.shape == (3 + rays,)


def test_wheel_angles_add_up_to_a_pose():
    """The same pose as the odometry of the same steps."""
    reckoned, wheels = DeadReckoning(), WheelReckoning(0.057)
    angles = np.zeros(2)
    random = np.random.default_rng(4)
    for step in range(50):
        turned = random.uniform(-0.6, 0.6, 2) if step else np.zeros(2)
        angles = angles + turned
        left, right = 0.02 * turned
        odometry = [(left + right) / 2, (right - left) / 0.057]
        ahead = wheels.ahead(angles)
        pose = wheels.follow(angles, step)
        np.testing.assert_allclose(pose, reckoned.follow(odometry, step), atol=1e-12)
        if step:
            np.testing.assert_array_equal(pose, ahead)
    assert np.array_equal(wheels.follow(np.zeros(2), 0), np.zeros(3))


def test_a_policy_on_epuck_has_a_goal_and_eight_readings():
    """Alone and in a batch the same."""
    one = wrap_for_rl(gym.make("TDAC-Ladder-v0", level="epuck", split="dev"))
    many = wrap_for_rl(
        gym.make_vec("TDAC-Ladder-v0", num_envs=2, level="epuck", split="dev")
    )
    assert one.observation_space.shape == (3 + 8 + 2,)
    single, _ = one.reset(options={"index": 3})
    batch, _ = many.reset(options={"index": 3})
    for _ in range(20):
        np.testing.assert_allclose(batch[0], single, atol=1e-6)
        single = one.step(np.array([0.3, 0.5], np.float32))[0]
        batch = many.step(np.full((2, 2), (0.3, 0.5), np.float32))[0]
