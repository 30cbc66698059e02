"""Promises of robots and localisers of task sets."""

import gymnasium as gym
import numpy as np
import pytest
import yaml
from batches import actions, assert_alike

from tdac_envs import load_robot
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.set_file import find_set_file

BURGER = "turtlebot3-burger"
LOCALISER = {
    "pose_noise": 1.0,
    "heading_noise": 0.05,
    "pose_correlation": 0.5,
    "pose_jumps": 20.0,
    "pose_delay": 1,
    "scan_delay": 2,
    "message_drop": 0.2,
    "range_min": 3.0,
    "max_acceleration": 40.0,
    "wheel_radius_error": 0.05,
}


@pytest.fixture
def set_yaml(tmp_path):
    """Writes a `set.yaml` with these values and returns its path."""

    def write(**values):
        path = tmp_path / "mine.yaml"
        path.write_text(yaml.safe_dump({"worlds": [{"name": "aisles"}], **values}))
        return path

    return write


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("frame", ["start", "map"])
def test_a_batch_does_what_single_environments_do(set_yaml, frame, mode):
    """To the last bit, with all errors, in both frames of reference."""
    path = set_yaml(
        frame=frame,
        disturbances=LOCALISER,
        horizon={"factor": 1, "least": 25, "most": 25},
    )
    own, kwargs = {"level": str(path), "train_pool": 3}, {"autoreset_mode": mode}
    name = "TDAC-Ladder-v0"
    many = gym.make_vec(name, 2, "sync", vector_kwargs=kwargs, **own)
    batch = gym.make_vec(name, 2, "vector_entry_point", **kwargs, **own)
    list(assert_alike(many, batch, 1, 0.5 * actions(2, 60)))


def test_the_pose_has_errors_and_the_goal_has_none(set_yaml):
    """The frame of reference is that of the true start."""
    path = set_yaml(disturbances={"pose_noise": 2.0})
    env = gym.make("TDAC-Ladder-v0", level=str(path), split="dev").unwrapped
    plain = gym.make("TDAC-Ladder-v0", level=str(set_yaml()), split="dev").unwrapped
    first = [env.reset(seed=k)[0] for k in range(30)]
    exact = [plain.reset(seed=k)[0] for k in range(30)]
    places = np.array([seen["pose"][:2] for seen in first])
    assert places.std() == pytest.approx(2.0, rel=0.4)
    assert all(each["pose"][0] == 0.0 for each in exact)
    assert all(seen in env.observation_space for seen in first)


def test_a_named_robot_is_in_the_units_of_the_worlds(set_yaml):
    """With its rate and errors as defaults, which the set may override."""
    path = set_yaml(
        robot=BURGER,
        resolution=0.02,
        worlds=[{"name": "aisles", "width": 5, "height": 4}],
        movers=[{"kind": "bounce", "count": 2, "speed": [0.1, 0.2], "radius": 0.1}],
        disturbances={"pose_delay": 0, "range_min": 0.2},
    )
    file, robot = find_set_file(path), load_robot(BURGER)
    assert file.goal_tolerance == file.robot.radius
    assert (file.worlds[0].width, file.worlds[0].height) == (250, 200)
    assert file.movers[0].speed == pytest.approx((5.0, 10.0))
    assert file.disturbances.range_min == pytest.approx(10.0)
    assert file.robot.radius == pytest.approx(robot.radius / 0.02)
    assert file.robot.n_rays == 360
    assert file.dt == 0.1
    own = file.disturbances
    assert own.pose_noise == pytest.approx(1.5)
    assert (own.pose_delay, own.scan_delay) == (0, 1)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"robot": BURGER}, r"robot: .*give `resolution`"),
        ({"robot": BURGER, "resolution": -1}, r"robot: expected resolution"),
        ({"robot": "paper-disc", "resolution": 0.1}, "is in pixels: leave out"),
        ({"robot": BURGER, "resolution": 0.1, "goal_tolerance": "a"}, "goal_tol"),
        ({"robot": BURGER, "resolution": 0.1, "worlds": 3}, "worlds"),
        ({"robot": BURGER, "resolution": 0.1, "movers": [7]}, "movers"),
    ],
)
def test_a_set_in_metres_that_is_not_valid(set_yaml, keys, told):
    with pytest.raises(TaskError, match=told):
        find_set_file(set_yaml(**keys))


SMALL = {
    "robot": BURGER,
    "resolution": 0.025,
    "worlds": [{"name": "clutter", "width": 4, "height": 4, "gaps": [1.5, 2.2]}],
    "horizon": {"factor": 1, "least": 25, "most": 25},
}


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("frame", ["start", "map"])
def test_a_batch_in_metres_does_what_single_environments_do(set_yaml, frame):
    path = set_yaml(
        **SMALL, frame=frame, observed=["pose", "goal", "ranges", "odometry"]
    )
    own, kwargs = {"level": str(path), "train_pool": 3}, {"autoreset_mode": "SameStep"}
    name = "TDAC-Ladder-v0"
    many = gym.make_vec(name, 2, "sync", vector_kwargs=kwargs, **own)
    batch = gym.make_vec(name, 2, "vector_entry_point", **kwargs, **own)
    list(assert_alike(many, batch, 1, 0.5 * actions(2, 60)))


@pytest.mark.parametrize("frame", ["start", "map"])
def test_a_set_with_a_resolution_is_observed_in_metres(set_yaml, frame):
    """As in ROS: y to the left or up, turns to the left are positive."""
    keys = {**SMALL, "disturbances": dict.fromkeys(LOCALISER, 0), "frame": frame}
    keys["disturbances"] |= {"range_noise": 0, "wheel_slip": 0}
    env = gym.make("TDAC-Ladder-v0", level=str(set_yaml(**keys)), split="dev").unwrapped
    size, driven = 0.025, []
    seen, _ = env.reset(options={"index": 0})
    start, height = env.task.start, env.task.terrain.grid.cells.shape[0]
    for action in [(0.1, 0.4)] * 12:
        seen, *_ = env.step(np.array(action, np.float32))
        assert seen in env.observation_space
        x, y, heading = env.pose().tolist()
        if frame == "map":
            place = (x + 0.5) * size, (height - 0.5 - y) * size
            turned = -heading
        else:
            away = size * complex(x - start.x, y - start.y)
            away *= np.exp(-1j * start.heading)
            place, turned = (away.real, -away.imag), start.heading - heading
        assert seen["pose"][:2] == pytest.approx(place, abs=1e-5)
        apart = np.exp(1j * (float(seen["pose"][2]) - turned))
        assert apart == pytest.approx(1.0, abs=1e-5)
        assert seen["ranges"] == pytest.approx(size * env.robot.ranges, abs=1e-5)
        driven.append(float(seen["pose"][2]))
    if frame == "start":
        assert driven[-1] > 0.2  # the right wheel was faster: a turn to the left


def test_a_robot_file_is_beside_the_set(set_yaml, tmp_path, monkeypatch):
    """Its path is relative to the file that names it, wherever a command runs."""
    keys = load_robot(BURGER).model_dump(mode="json", exclude_unset=True, by_alias=True)
    (tmp_path / "wide.yaml").write_text(yaml.safe_dump({**keys, "radius": 0.2}))
    path = set_yaml(robot="wide.yaml", resolution=0.02)
    monkeypatch.chdir("/")
    assert find_set_file(path).robot.radius == pytest.approx(10.0)


@pytest.mark.parametrize("resolution", [0, -1, True, "x", [1]])
def test_a_wrong_resolution_is_named(set_yaml, resolution):
    """In one line, also where a robot in metres needs it."""
    with pytest.raises(TaskError, match=r"resolution|radius"):
        find_set_file(set_yaml(robot=BURGER, resolution=resolution))


def test_errors_of_a_pose_need_the_pose(set_yaml):
    keys = {"observed": ["goal", "ranges"], "disturbances": {"pose_noise": 1.0}}
    with pytest.raises(TaskError, match="errors of the pose need `pose`"):
        find_set_file(set_yaml(**keys))


def test_an_e_puck_of_a_set_has_no_localiser(set_yaml):
    keys = {
        "robot": {"kind": "epuck"},
        "worlds": [{"name": "plates"}],
        "observed": ["goal", "ps", "pose"],
        "goal_tolerance": 0.03,
        "disturbances": {"pose_noise": 0.1},
    }
    with pytest.raises(TaskError, match=r"disturbances.pose_noise: an e-puck has no"):
        find_set_file(set_yaml(**keys))


def test_unused_keys_do_not_change_a_hash(set_yaml):
    """New disturbances of size 0 are not part of it; others are."""
    plain = find_set_file(set_yaml()).sha256()
    zeros = dict.fromkeys(LOCALISER, 0)
    assert find_set_file(set_yaml(disturbances=zeros)).sha256() == plain
    some = find_set_file(set_yaml(disturbances={"scan_delay": 1})).sha256()
    assert some != plain
