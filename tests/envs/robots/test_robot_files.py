"""Promises of robots that have a name."""

import math

import cv2
import gymnasium as gym
import numpy as np
import pytest
import yaml
from batches import assert_same
from gymnasium.utils.env_checker import check_env

from tdac_envs import bundled_robots, load_robot
from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.env import Map2DEnv

BURGER = "turtlebot3-burger"
ON_MAPS = [name for name in bundled_robots() if load_robot(name).drives == "disc"]
METRIC = [name for name in ON_MAPS if load_robot(name).units == "metres"]


@pytest.fixture
def floor(tmp_path):
    """A ROS map of an empty room of 12 x 8 m with cells of 5 cm."""
    cells = np.full((160, 240), 255, np.uint8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 0
    cv2.imwrite(str(tmp_path / "room.png"), cells)
    (tmp_path / "room.yaml").write_text(
        "image: room.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    return tmp_path / "room.yaml"


def in_room(floor, **options):
    """A robot in the middle of the room, facing +x, in metres."""
    own = {"start": (6.0, 4.0, 0.0), "goal": (11.0, 4.0), "frame": "metres"}
    return Map2DEnv(floor, **{**own, **options})


def test_they_come_with_the_package():
    assert set(bundled_robots()) == {
        *("turtlebot3-burger", "turtlebot3-burger-lds02", "create3-rplidar"),
        "jackal",
        *("e-puck", "e-puck2", "paper-disc"),
    }


@pytest.mark.parametrize("name", bundled_robots())
def test_every_figure_has_a_source(name):
    """It says whether it was read; the stopping distance is that of its limits.

    The disc of the paper has none, as the default robot, whose equal it is.
    """
    file = load_robot(name)
    kinds = {source.partition(":")[0] for source in file.sources.values()}
    if name != "paper-disc":
        assert kinds <= {"read", "quoted", "computed", "assumed"}
    assert file.name == name
    assert file.sources.keys() == file.figures().keys()
    speed, brakes = file.limits.max_wheel_speed, file.limits.max_acceleration
    speed = min(speed, file.limits.max_speed or speed)
    least = speed / file.control_rate + (speed**2 / (2 * brakes) if brakes else 0.0)
    expected = 0.0 if name == "paper-disc" else least
    assert file.stopping_distance == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("name", METRIC)
def test_a_robot_sets_the_environment(name, floor):
    """Body, limits, scanner and rate are those of the file, in metres."""
    file, env = load_robot(name), in_room(floor, robot=name)
    robot = env.nominal.robot
    assert robot.radius * 0.05 == pytest.approx(file.radius)
    assert robot.axle_length * 0.05 == pytest.approx(file.axle_length)
    assert robot.range_max * 0.05 == pytest.approx(file.scanner.range_max)
    assert env.nominal.dt == 1 / file.control_rate
    seen = env.reset(seed=0)[0]
    assert seen["ranges"].shape == (file.scanner.rays,)
    assert env.setup.limits.max_speed * 0.05 == pytest.approx(file.limits.max_speed)


def test_ranges_are_in_the_order_of_the_scanner(floor):
    """The burger's begin ahead and go counter-clockwise, from its scanner."""
    env = in_room(floor, robot=BURGER, range_max=10.0, start=(5.0, 3.0, 0.0))
    seen = env.reset(seed=0)[0]["ranges"]
    back = 0.032
    walls = [12 - 0.05 - 5 + back, 8 - 0.05 - 3, 5 - back - 0.05, 3 - 0.05]
    np.testing.assert_allclose(seen[[0, 90, 180, 270]], walls, atol=0.01)
    pixels = in_room(
        floor, robot=BURGER, frame="pixels", start=(99.5, 99.5, 0), goal=(200, 99)
    )
    flipped = pixels.reset(seed=0)[0]["ranges"] * 0.05
    most = np.minimum(seen, 3.5)
    np.testing.assert_allclose(flipped, most, atol=0.06)


def test_the_paper_disc_is_the_default():
    """To the last bit: observations and hashes of its robot."""
    plain, named = Map2DEnv(), Map2DEnv(robot="paper-disc")
    assert plain.nominal.robot == named.nominal.robot
    assert plain.nominal.dt == named.nominal.dt
    assert_same(plain.reset(seed=1)[0], named.reset(seed=1)[0])


def test_its_errors_are_on_when_asked_for(floor):
    """Limits always hold; noise and latency with `disturbed`; typed values win."""
    exact, noisy = (in_room(floor, robot=BURGER, disturbed=on) for on in (False, True))
    assert exact.setup.reception.is_exact
    assert exact.setup.limits == noisy.setup.limits
    assert noisy.setup.reception.pose_noise * 0.05 == pytest.approx(0.03)
    assert noisy.setup.reception.pose_delay == 2
    assert noisy.setup.range_noise == 0.0175
    calm = in_room(floor, robot=BURGER, disturbed=True, pose_noise=0, pose_jumps=0)
    assert calm.setup.reception.pose_noise == 0.0
    other = in_room(floor, robot=BURGER, n_rays=8, field_of_view=90, robot_radius=0.2)
    assert other.reset(seed=0)[0]["ranges"].shape == (8,)
    assert other.nominal.robot.radius == pytest.approx(4.0)


def test_near_surfaces_read_zero_as_of_its_scanner(floor):
    """Nearer than 12 cm the LDS-01 reads 0."""
    env = in_room(floor, robot=BURGER, start=(0.2, 4.0, 0.0))
    seen = env.reset(seed=0)[0]["ranges"]
    # The scanner is 3.2 cm behind the centre, and the wall 11.8 cm behind it.
    assert seen[180] == 0.0
    assert seen[150] > 0.12


def test_its_turn_accelerates_no_faster(floor):
    """3.2 rad/s² at most, and 2.5 m/s² of a wheel, however it is commanded."""
    env = in_room(floor, robot=BURGER)
    env.reset(seed=0)
    before = np.zeros(2)
    turns, wheels = [], []
    for action in ([1, -1], [-1, 1], [1, 1], [-1, 1], [1, 0.2], [-1, -1]) * 3:
        after = env.step(np.array(action, np.float32))[0]["wheel_speeds"] * 0.22
        turns.append(abs(np.diff(after - before)[0]) / 0.16 / 0.1)
        wheels.append(np.abs(after - before).max() / 0.1)
        before = after
    assert max(turns) == pytest.approx(3.2, rel=1e-4)
    assert max(wheels) <= 2.5 * (1 + 1e-5)


def test_gymnasium_has_nothing_to_say(floor):
    options = {"robot": BURGER, "disturbed": True, "frame": "metres"}
    ends = {"start": (2.0, 4.0, 0.0), "goal": (11.0, 4.0)}
    env = gym.make("TDAC-Map2D-v0", map=str(floor), **ends, **options).unwrapped
    check_env(env, skip_render_check=True)
    two = gym.make_vec("TDAC-Map2D-v0", 2, map=str(floor), **ends, **options)
    one = gym.make("TDAC-Map2D-v0", map=str(floor), **ends, **options).unwrapped
    many, single = two.reset(seed=3)[0], one.reset(seed=3)[0]
    for _ in range(5):
        assert_same({key: value[0] for key, value in many.items()}, single)
        many = two.step(np.full((2, 2), 0.5, np.float32))[0]
        single = one.step(np.full(2, 0.5, np.float32))[0]


def test_units_must_be_those_of_the_map(floor):
    """One line says what to do."""
    with pytest.raises(TaskError, match="is in metres, and the map has no resolution"):
        Map2DEnv("maze", robot=BURGER)
    with pytest.raises(TaskError, match="is in pixels, and the task in metres"):
        in_room(floor, robot="paper-disc")
    with pytest.raises(TaskError, match="drives in Webots worlds, not on maps"):
        Map2DEnv("maze", robot="e-puck")


def test_a_wrong_name_offers_the_closest():
    with pytest.raises(TaskError, match="did you mean 'turtlebot3-burger'"):
        load_robot("turtlebot-burger")


def test_a_file_of_ones_own(tmp_path, floor):
    """It is as good as a bundled one; a wrong key is named with the known ones."""
    file = load_robot(BURGER).model_dump(exclude_unset=True, by_alias=True)
    path = tmp_path / "mine.yaml"
    file |= {"name": "mine", "radius": 0.2}
    path.write_text(yaml.safe_dump(_plain(file)))
    assert in_room(floor, robot=str(path)).nominal.robot.radius == pytest.approx(4.0)
    path.write_text(yaml.safe_dump(_plain({**file, "radios": 1})))
    with pytest.raises(TaskError, match=r"did you mean 'radius'.*known: radius"):
        load_robot(path)
    without = {k: v for k, v in file["sources"].items() if k != "radius"}
    path.write_text(yaml.safe_dump(_plain({**file, "sources": without})))
    with pytest.raises(TaskError, match="sources: no source of radius"):
        load_robot(path)
    with pytest.raises(TaskError, match="no robot file"):
        load_robot(tmp_path / "other.yaml")


def _plain(value):
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, tuple) else value


def test_angles_are_those_of_the_scanner():
    """Counter-clockwise from the first one; a fan reaches its last angle."""
    angles = load_robot(BURGER).scanner.angles
    assert angles[:2] == (0.0, pytest.approx(math.radians(1)))
    assert angles[270] == pytest.approx(-math.pi / 2)
    jackal = load_robot("jackal").scanner.angles
    assert jackal[0] == pytest.approx(-math.radians(135))
    assert jackal[-1] == pytest.approx(math.radians(135))
