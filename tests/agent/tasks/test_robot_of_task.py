"""Promises of tasks whose robot has a name."""

import json

import cv2
import numpy as np
import pytest
import yaml

from tdac_agent import load_task
from tdac_agent.builtin.provider import template_of
from tdac_agent.environments.map2d.prompt import facts_of
from tdac_agent.tasks.disturbance import PARTS, Disturbance
from tdac_agent.tasks.task import lay_out
from tdac_agent.tasks.task_file import TaskFile
from tdac_envs import load_robot
from tdac_envs.core.errors import TaskError
from tdac_envs.webots.stage import open_stage

BURGER = "turtlebot3-burger"


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
    return tmp_path


def task_of(folder, **keys):
    """A task in the room, in metres unless the keys say otherwise."""
    own = {"map": "room.yaml", "start": [2, 4], "goal": [10, 4], "frame": "metres"}
    file = folder / "task.yaml"
    file.write_text(yaml.safe_dump({**own, "robot": BURGER, **keys}))
    return load_task(file)


def test_a_name_stands_for_all_of_its_values(floor):
    """Body, limits and scanner; the control rate is the step, unless it is given."""
    task, file = task_of(floor), load_robot(BURGER)
    robot = task.setting.nominal.robot
    assert robot.radius * 0.05 == pytest.approx(file.radius)
    assert robot.max_acceleration * 0.05 == pytest.approx(2.5)
    assert robot.n_rays == 360
    assert task.nominal.dt == 0.1
    seen = task.setting.observed().reset(seed=0)[0]["ranges"]
    assert seen[90] == 3.5
    assert task_of(floor, dt=0.05).nominal.dt == 0.05
    other = task_of(floor, robot={"file": BURGER, "radius": 0.3})
    assert other.setting.nominal.robot.radius == pytest.approx(6.0)
    assert other.setting.nominal.robot.n_rays == 360


def test_pixels_and_metres_are_the_same_robot(floor):
    """A task in pixels on the same map has the same robot."""
    pixels = task_of(
        floor, frame="pixels", start=[39.5, 79.5], goal=[199.5, 79.5], profile="policy"
    )
    assert pixels.setting.nominal.robot == task_of(floor).setting.nominal.robot
    noise = pixels.own_disturbance().pose_noise
    assert noise == pytest.approx(0.03 / 0.05)
    options = pixels.disturbed_options(pixels.own_disturbance())
    metric = task_of(floor)
    same = metric.disturbed_options(metric.own_disturbance())
    assert options == pytest.approx(same)


def test_it_should_keep_its_stopping_distance(floor):
    """With and without the errors of its pose; `builtin` plans with these in addition.

    Plain tasks keep 5 % of the radius.
    """
    task = task_of(floor)
    for errors in ({}, task.disturbed_options(task.own_disturbance())):
        required = task.setting.make_env(**errors).required_gap * 0.05
        assert required == pytest.approx(0.032)
    planned = template_of(task.setting).facts["kept_gap"] * 0.05
    assert planned == pytest.approx(0.032 + 3 * 0.03)
    plain = task_of(floor, robot={"radius": 0.2})
    assert plain.setting.make_env().required_gap * 0.05 == pytest.approx(0.01)
    assert template_of(plain.setting).facts["kept_gap"] * 0.05 == pytest.approx(0.01)


def test_a_laid_out_task_is_the_same(floor, tmp_path):
    """Its file needs no robot file, and its hash and disturbances stay."""
    task = task_of(floor)
    again = load_task(lay_out(task, tmp_path / "out") / "task.yaml")
    assert again.sha256() == task.sha256()
    assert again.own_disturbance() == task.own_disturbance()
    assert again.setting.nominal.robot == task.setting.nominal.robot
    params = json.loads((tmp_path / "out" / "params.json").read_text())["robot"]
    assert params["range_min"] == 0.12
    assert params["scanner_offset"] == [-0.032, 0.0]
    assert params["ray_angles"][90] == pytest.approx(np.pi / 2)


def test_its_errors_disturb_confirmations(floor):
    """Those of the robot's file, then of the task file, then what is typed."""
    own = task_of(floor).own_disturbance()
    assert (own.pose_noise, own.pose_delay, own.delay) == (0.03, 2, 0)
    more = task_of(floor, disturbances={"message_drop": 0.1, "pose_delay": 1})
    assert more.own_disturbance(wheel_slip=0.0) == own.changed(
        {"message_drop": 0.1, "pose_delay": 1, "wheel_slip": 0.0}
    )
    env = more.disturbed_env(more.own_disturbance())
    assert env.setup.reception.pose_noise == pytest.approx(0.6)
    assert env.setup.reception.message_drop == 0.1
    assert more.sha256() != task_of(floor).sha256()


def test_a_task_without_them_has_the_usual_disturbance():
    """And its hash does not mention it."""
    assert load_task("maze").own_disturbance() == Disturbance()
    assert load_task("epuck").own_disturbance() == Disturbance()


def test_a_wrong_disturbance_is_named_with_the_known_ones(floor):
    with pytest.raises(TaskError, match=r"disturbances: .*did you mean 'wheel_slip'"):
        task_of(floor, disturbances={"wheel_slipp": 0.1})
    with pytest.raises(TaskError, match=r"disturbances: .*message drop from 0 to 1"):
        task_of(floor, disturbances={"message_drop": 2})


def test_an_e_puck_has_no_localiser_to_disturb():
    with pytest.raises(TaskError, match="no pose noise; leave out --pose-noise"):
        load_task("epuck").disturbed_options(Disturbance(pose_noise=0.1))


def test_one_table_has_all_parts():
    """A part without an entry would be neither checked nor reported."""
    assert set(PARTS) == set(Disturbance.__dataclass_fields__)
    sizes = {name: 1 if "delay" in name else 0.5 for name in PARTS}
    assert len(str(Disturbance(**sizes)).split(", ")) == 1 + len(PARTS)


def test_units_must_be_those_of_the_map(floor):
    with pytest.raises(TaskError, match="the map has no resolution"):
        load_task(TaskFile.model_validate({"map": "maze", "robot": BURGER}))
    with pytest.raises(TaskError, match="in pixels, and the task in metres"):
        task_of(floor, robot="paper-disc")
    with pytest.raises(TaskError, match="unknown robot 'turtelbot'"):
        task_of(floor, robot="turtelbot")


FIGURES = {
    "radius": 0.11,
    "axle_length": 0.17,
    "limits.max_turn_rate": 2.0,
    "limits.max_acceleration": 1.0,
    "scanner.first_angle": 1,
    "scanner.range_min": 0.1,
    "scanner.below_min": "range_max",
    "scanner.noise": 0.1,
    "scanner.rate": 1,
    "pose.noise": 0.1,
    "pose.latency": 0.5,
    "wheels.slip": 0.1,
    "control_rate": 20,
}


def test_the_hash_covers_the_robot_file(floor):
    """A changed figure makes another task, so that no verdict is about it."""
    name = floor / "mine.yaml"
    file = load_robot(BURGER).model_dump(mode="json", exclude_unset=True, by_alias=True)
    name.write_text(yaml.safe_dump(file))
    hashes = {task_of(floor, robot="mine.yaml").sha256()}
    for key, value in FIGURES.items():
        part, _, last = key.rpartition(".")
        own = {**file[part], last: value} if part else value
        name.write_text(yaml.safe_dump({**file, part or last: own}))
        hashes.add(task_of(floor, robot="mine.yaml").sha256())
    assert len(hashes) == 1 + len(FIGURES)


@pytest.mark.parametrize(
    "own", [{"range_max": 1e9}, {"axle": 1e9}, {"scanner_offset": [0.0, -1e9]}]
)
@pytest.mark.parametrize("named", [{"file": BURGER}, {"radius": 0.2}])
def test_a_length_may_be_too_large_in_pixels(floor, named, own):
    """It is in range in metres; one line names it."""
    with pytest.raises(TaskError, match=rf"lengths in px\): {next(iter(own))}"):
        task_of(floor, robot={**named, **own})


def test_a_model_is_told_of_limits_scanner_and_noise(floor):
    """In units of the task; an exact robot is called exact, as before."""
    told = " ".join(facts_of(task_of(floor))["robot_lines"])
    for said in ("0.22 m/s", "2.84 rad/s", "2.5 m/s²", "0.12 m", "reads 0", "behind"):
        assert said in told
    assert "pose noise 0.03" in told
    assert facts_of(load_task("maze"))["robot_lines"] == []


def test_the_command_line_lists_and_shows_robots(tdac, floor):
    """With a source for each figure; a wrong name offers the closest."""
    code, out, err = tdac("robots")
    assert (code, err) == (0, "")
    assert BURGER in out
    code, out, _ = tdac("robots", "show", BURGER)
    assert code == 0
    assert "0.105 m" in out
    assert "acc_lim_x" in out
    code, out, _ = tdac("robots", "show", "jackal", "--json")
    assert json.loads(out)["limits"]["max_turn_rate"] == 4.0
    code, _, err = tdac("robots", "show", "jackel")
    assert code == 2
    assert "did you mean 'jackal'" in err


def test_a_flag_names_the_robot(tdac, floor):
    """`--robot` replaces the task's robot; `--dry-run` shows what a model is told."""
    ends = ("--start", "2", "4", "--goal", "10", "4", "--metres")
    words = ("--map", str(floor / "room.yaml"), *ends, "--dry-run")
    code, out, err = tdac("synth", *words, "--robot", BURGER)
    assert code == 0, err
    assert '"radius": 0.105' in out
    assert "turns at most 2.84 rad/s" in out
    code, _, err = tdac("synth", "--robot", BURGER, "--dry-run")
    assert code == 2
    assert "the map has no resolution" in err


def test_the_sensors_of_a_controller_are_those_of_the_robot(floor, tmp_path):
    """`Ultrasonic` predicts what it observes: from its scanner, in its order."""
    import importlib.util

    task = task_of(floor, goal=[10, 6])
    folder = lay_out(task, tmp_path / "out")
    spec = importlib.util.spec_from_file_location(
        "sensors_of_burger", folder / "sensors.py"
    )
    sensors = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sensors)
    env = task.setting.observed()
    seen = env.reset(seed=0, options={"start": (1.5, 1.7, 0.4)})[0]
    robot = sensors.load_params()["robot"]
    rays = sensors.Ultrasonic(
        sensors.load_occupancy(),
        robot["n_rays"],
        robot["field_of_view_deg"],
        robot["range_max"],
    )
    predicted = rays.ranges(*seen["pose"].tolist())
    assert predicted.min() > robot["range_min"]
    np.testing.assert_allclose(predicted, seen["ranges"], atol=1e-3)


def world_task(folder, **keys):
    """A task in a bundled world."""
    file = folder / "task.yaml"
    file.write_text(yaml.safe_dump({"env": "TDAC-EPuck-v0", "world": "crates", **keys}))
    return load_task(file)


def test_an_e_puck_has_the_values_of_its_version(tmp_path):
    """In the task, in the world that is exported, and after it is laid out."""
    task = world_task(tmp_path, robot="e-puck2")
    robot = task.nominal.ground.world.robot
    assert (robot.version, robot.mass, robot.axle_length) == ("2", 0.14, 0.057)
    assert task.nominal.max_wheel_speed == 7.536
    assert task.setting.make_env().required_gap == 0.005
    assert template_of(task.setting).facts["kept_gap"] == 0.005
    again = load_task(lay_out(task, tmp_path / "out") / "task.yaml")
    assert again.sha256() == task.sha256()
    assert again.setting.make_env().required_gap == 0.005
    params = json.loads((tmp_path / "out" / "params.json").read_text())["robot"]
    assert params["max_wheel_speed"] == 7.536
    assert 'version "2"' in (tmp_path / "out" / "world.wbt").read_text()
    exported = open_stage(tmp_path / "out" / "world.wbt").make_env(steps=10)
    assert exported.nominal.max_wheel_speed == 7.536
    assert exported.nominal.ground.world.robot.mass == 0.14


def test_its_errors_disturb_confirmations_in_worlds(tmp_path):
    """As those of a robot on maps; a plain world has the usual ones."""
    own = load_robot("e-puck").model_dump(by_alias=True, exclude_unset=True)
    own |= {"name": "own", "wheels": {"slip": 0.05}}
    own["sources"]["wheels.slip"] = "measured"
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(own))
    task = world_task(tmp_path, robot="own.yaml")
    assert task.own_disturbance() == Disturbance.none().changed({"wheel_slip": 0.05})
    assert task.disturbed_env(task.own_disturbance()).disturbances.wheel_slip == 0.05
    assert world_task(tmp_path, robot="e-puck").own_disturbance() == Disturbance()


@pytest.mark.parametrize(
    ("robot", "reason"),
    [
        ("jackal", "robot: jackal drives on maps, not in Webots worlds"),
        ({"radius": 0.05}, "robot.radius: only valid with env: TDAC-Map2D-v0"),
        ({"file": "e-puck", "n_rays": 5}, "robot.n_rays: only valid with env: TDAC-M"),
        ("e-pukc", "unknown robot 'e-pukc'.*did you mean 'e-puck'"),
    ],
)
def test_what_is_no_e_puck_is_refused_in_worlds(tmp_path, robot, reason):
    """In one line."""
    with pytest.raises(TaskError, match=reason) as caught:
        world_task(tmp_path, robot=robot)
    assert "\n" not in str(caught.value)


def test_the_ends_of_rays_are_on_the_walls(floor, tmp_path):
    """`ray_ends` starts them at the scanner; prompts of such robots name it."""
    import importlib.util

    task = task_of(floor, goal=[10, 6])
    folder = lay_out(task, tmp_path / "out")
    spec = importlib.util.spec_from_file_location(
        "sensors_with_rays", folder / "sensors.py"
    )
    sensors = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sensors)
    env = task.setting.observed()
    seen = env.reset(seed=0, options={"start": (1.5, 1.7, 0.4)})[0]
    near = seen["ranges"] < 3.4
    ends = sensors.ray_ends(seen["ranges"], seen["pose"])[near]
    # The room's walls are one cell thick.
    walls = np.abs(ends[:, [0, 0, 1, 1]] - (0.05, 11.95, 0.05, 7.95)).min(axis=1)
    assert near.sum() > 100
    assert walls.max() < 1e-3
    own = sensors.ray_ends(seen["ranges"])[0]
    assert own == pytest.approx((seen["ranges"][0] - 0.032, 0.0), abs=1e-6)
    told = facts_of(task)
    assert "def ray_ends" in told["sensors_text"]
    assert "Rays start at the centre" not in told["observation_table"]
    plain = facts_of(task_of(floor, robot={"radius": 0.2}))
    assert "def ray_ends" not in plain["sensors_text"]
    assert "Rays start at the centre" in plain["observation_table"]
