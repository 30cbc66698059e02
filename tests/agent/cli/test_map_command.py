"""`tdac map`, and the flags of maps that other commands share with it."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from small import small_cells

from tdac_agent import load_task
from tdac_agent.cli.coordinates import with_coordinates
from tdac_agent.cli.task_choice import chosen_task, kind_of_file
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.tasks.setting import tolerance_text
from tdac_agent.tasks.task import lay_out
from tdac_envs.core.errors import MapError, RefusedError, TaskError

# The small map is a ROS map of 0.1 m per px with its corner at (-2, -3) m.
START, GOAL, RADIUS = ("1.05", "5.95"), ("11.05", "5.95"), ("--robot-radius", "0.6")
COMMANDS = (
    *("map", "world", "synth", "verify", "play", "evaluate", "train", "campaign"),
    *("check-suite", "demo", "rules", "report", "runs", "webots", "webots run"),
    *("export", "export webots", "doctor", "warm", ""),
)


@pytest.fixture
def ros(tmp_path):
    """The small map with a `map.yaml`; y grows upwards from its lower-left corner."""
    cells = small_cells()
    cv2.imwrite(str(tmp_path / "plan.png"), np.where(cells, 0, 254).astype(np.uint8))
    origin = [-2.0, 9.0 - 0.1 * cells.shape[0], 0.0]
    text = f"image: plan.png\nresolution: 0.1\norigin: {origin}\n"
    (tmp_path / "plan.yaml").write_text(text)
    return tmp_path / "plan.yaml"


def test_metres_in_and_out(tdac, ros):
    """Size, table and parameters; the parameters are in px, as the environment's."""
    words = ("map", ros, "--metres", "--start", *START, "1.5", "--goal", *GOAL, *RADIUS)
    code, out, err = tdac(*words)
    assert (code, err) == (0, "")
    assert "(16 m x 12 m)" in out
    assert re.search(r"margin, m .*clearance, m .*path, m", out)
    assert "highest is best" in out
    params = json.loads(Path("plan-map/params.json").read_text())
    assert params["start"] == [30, 30]
    assert params["goal"] == [130, 30]
    assert params["heading"] == pytest.approx(-1.5)
    assert params["robot"]["radius"] == pytest.approx(6.0)


@pytest.mark.parametrize("command", ["map", "synth --map"])
@pytest.mark.parametrize(
    ("start", "reason"),
    [
        (
            ("-40", "-3"),
            r"start \(-40, -3\) lies outside the map; expected -2 <= x < 14",
        ),
        (
            ("5.35", "5.95"),
            r"move the start to \(\d+\.\d+, \d+\.\d+\), the nearest free place for a "
            r"robot of 0.6 m radius from which the goal can be reached: "
            r"start \(5.35, 5.95\) lies in an obstacle",
        ),
    ],
)
def test_refusals_are_in_metres(refused, ros, command, start, reason):
    words = ("--metres", "--start", *start, "--goal", *GOAL, *RADIUS)
    err = refused(*command.split(), ros, *words)
    assert re.search(f"(?m)^error: plan.yaml: {reason}", err), err
    assert " px" not in err
    assert err.endswith("; look at plan-map/refused.png\n")
    assert Path("plan-map/refused.png").is_file()


def test_a_map_replaces_the_picture_of_its_refusal(tdac, ros):
    """The folder does not show why an earlier attempt failed."""
    words = ("map", ros, "--metres", "--goal", *GOAL, *RADIUS)
    assert tdac(*words, "--start", "90", "5")[0] == 2
    assert Path("plan-map/refused.png").is_file()
    assert tdac(*words, "--start", "1.05", "5.95")[0] == 0
    assert not Path("plan-map/refused.png").exists()
    assert Path("plan-map/preview.png").is_file()


def test_a_task_in_metres_is_the_one_in_pixels(ros):
    """Start, heading, goal, radius and tolerance are converted; words stay metres."""
    flags = {"map_image": str(ros), "frame": "metres"}
    ends = {"start": (1.05, 5.95), "goal": (11.05, 5.95)}
    wanted = TaskFlags(**flags, **ends, heading=math.pi / 2, robot_radius=0.6)
    task = chosen_task(wanted)
    assert task.nominal.start == pytest.approx((30, 30, -math.pi / 2))
    assert task.nominal.goal == pytest.approx((130, 30))
    assert task.nominal.body_radius == pytest.approx(6.0)
    length = task.nominal.shortest
    assert task.setting.length_text(length) == f"{round(0.1 * length, 2):g} m"
    assert "metres" not in task.setting.portable()
    with pytest.raises(RefusedError, match=r"radius of \d\.\d+ m") as caught:
        chosen_task(TaskFlags(**flags, **ends, robot_radius=4.0))
    assert " px" not in str(caught.value)


def test_a_map_with_a_resolution_is_in_metres_unless_pixels_are_chosen(ros):
    """Without --metres: 0.6 is a radius in metres, and with --frame pixels in px."""
    ends = {"start": (1.05, 5.95), "goal": (11.05, 5.95)}
    flags = TaskFlags(map_image=str(ros), robot_radius=0.6, **ends)
    task = chosen_task(flags)
    assert task.spec.frame == "metres"
    assert task.nominal.body_radius == pytest.approx(6.0)
    assert tolerance_text(task.setting) == "0.6 m (1.0 radii)"
    pixels = {"start": (30.0, 30.0), "goal": (130.0, 30.0), "robot_radius": 6.0}
    same = chosen_task(replace(flags, frame="pixels", **pixels))
    assert same.nominal.start[:2] == pytest.approx(task.nominal.start[:2])
    assert same.nominal.robot.range_max == task.nominal.robot.range_max == 35.0
    with pytest.raises(TaskError, match="give the body's radius in metres"):
        chosen_task(replace(flags, robot_radius=None))


def test_metres_of_a_task_file(ros):
    """The key `metres` means what the flag means."""
    file = ros.parent / "task.yaml"
    file.write_text(
        "map: plan.yaml\nframe: metres\nstart: [1.05, 5.95]\ngoal: [11.05, 5.95]\n"
        "tolerance: 0.5\nrobot: {radius: 0.6, range_max: 5.0}\n"
    )
    task = load_task(file)
    assert task.nominal.goal_tolerance == pytest.approx(5.0)
    assert task.nominal.robot.range_max == pytest.approx(50.0)
    assert task.nominal.robot.max_wheel_speed == pytest.approx(5.0)


def test_a_bundled_map_has_no_metres(tmp_path):
    file = tmp_path / "task.yaml"
    file.write_text("map: maze\nframe: metres\n")
    with pytest.raises(TaskError, match="the bundled map maze has no scale"):
        load_task(file)


def test_a_heading_of_the_map_command(tdac, ros):
    """Three numbers of `--start`, or `--heading`; it needs a start."""
    picture = ros.parent / "plan.png"
    ends = ("--goal", "130", "30", "--robot-radius", "6", "--json")
    for words in (("--start", "30", "30", "0.5"), ("--start", "30,30,0.5")):
        _, out, _ = tdac("map", picture, *words, *ends)
        assert json.loads(out)["params"]["heading"] == 0.5
    code, _, err = tdac("map", picture, "--heading", "0.5")
    assert (code, err) == (2, "error: --heading needs --start X Y\n")


def test_the_radius_of_a_named_robot(tdac, refused, ros):
    """`--robot` is enough; the table keeps its body away from walls."""
    ends = "--start", *START, "--goal", *GOAL
    words = "map", ros, *ends, "--robot", "turtlebot3-burger"
    code, out, _ = tdac(*words)
    assert code == 0
    assert "robot: turtlebot3-burger, radius 0.105 m" in out
    params = json.loads(tdac(*words, "--json")[1])["params"]
    assert params["robot"]["radius"] == pytest.approx(1.05)
    params = json.loads(tdac(*words, "--radius", "0.2", "--json")[1])["params"]
    assert params["robot"]["radius"] == pytest.approx(2.0)
    assert "no robot file" in refused("map", ros, *ends, "--robot", "no.yaml")
    grid = "map", ros.parent / "plan.png", "--robot", "turtlebot3-burger"
    assert "the map has no resolution" in refused(*grid)


def test_a_numpy_grid(tdac, done, refused, tmp_path):
    """What `gym.make` and `synth` read, `map` reads, too."""
    np.save(tmp_path / "grid.npy", small_cells())
    ends = ("--start", "30,30", "--goal=130,30", "--robot-radius", "6")
    out = done("map", tmp_path / "grid.npy", *ends)
    assert out.startswith("grid.npy, 160 x 120 px: obstacles are those of the grid")
    np.testing.assert_array_equal(np.load("grid-map/occupancy.npy"), small_cells())
    np.save(tmp_path / "whole.npy", small_cells().astype(np.int64))
    assert tdac("map", tmp_path / "whole.npy", *ends)[0] == 0
    np.testing.assert_array_equal(np.load("whole-map/occupancy.npy"), small_cells())
    np.save(tmp_path / "grey.npy", small_cells().astype(np.uint8) * 255)
    err = refused("map", tmp_path / "grey.npy", *ends)
    assert "(True = occupied) or integers 0 and 1, got uint8" in err


@pytest.mark.parametrize(
    ("typed", "understood"),
    [
        ("--start 90,302", "--start 90 302"),
        ("--start=90,302 --goal=178,386", "--start 90 302 --goal 178 386"),
        ("--start 90, 302 --goal (178,386)", "--start 90 302 --goal 178 386"),
        ("--start -40,-3,1.5 --snap", "--start -40 -3 --heading 1.5 --snap"),
        ("--start 1 2 .5 --goal 3,4 x", "--start 1 2 --heading .5 --goal 3 4 x"),
        ("--out a=b --json", "--out a=b --json"),
    ],
)
def test_places_as_people_type_them(typed, understood):
    assert with_coordinates(typed.split()) == understood.split()


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("--start 1 --goal 2 3", "--start 1: expected two numbers X Y, or three X Y Y"),
        ("--start -1 abc --goal 2 3", "--start -1 abc: expected two numbers"),
        ("--start=1, --snap", "--start 1,: expected two numbers"),
        ("--start 1,2,3,4", "--start 1,2,3,4: expected two numbers"),
        ("--start", "--start: expected two numbers"),
        (
            "--goal 1,2,3",
            "--goal 1,2,3: expected two numbers X Y, as in --goal 178 386",
        ),
        ("--goal 1 2 3", "--goal 1 2 3: expected two numbers X Y"),
        (
            "--start 1 2 3 --heading 1",
            "--start 1 2 3 already has a heading, 3: leave o",
        ),
        ("--heading=1 --start 1,2,3", "--start 1 2 3 already has a heading"),
    ],
)
def test_places_that_are_none(typed, message):
    """Quoted as typed, with what is expected."""
    with pytest.raises(TaskError, match=f"^{re.escape(message)}"):
        with_coordinates(typed.split())


@pytest.mark.parametrize("start", ["30 30 --heading 90", "30 30 90", "30,30,90"])
def test_a_heading_in_degrees(refused, ros, start):
    """More than a full turn is refused with the radians that may be meant."""
    ends = ("--start", *start.split(), "--goal", "130", "30")
    err = refused("map", ros.parent / "plan.png", *ends)
    assert "90 is more than a full turn: did you mean 1.571 (90 degrees)?" in err


def test_a_number_that_is_none(refused):
    """The flag, the word as typed, and what is expected."""
    for words, message in (
        ("map x.png --robot-radius abc", "--robot-radius abc: expected a number"),
        ("evaluate random --episodes 1.5x", "--episodes 1.5x: expected a whole number"),
        ("evaluate random --episodes 0", "greater than or equal to 1, got 0"),
    ):
        err = refused(*words.split())
        assert message in err


def test_a_place_in_one_word():
    assert with_coordinates(["--start", "90, 302", "c.py"]) == [
        "--start",
        "90",
        "302",
        "c.py",
    ]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--map office", "--task already defines the task: leave out --map"),
        ("--world maze", "--task already defines the task: leave out --world"),
        ("--set known", "--set brings its own tasks; leave out --task"),
        ("office", "give office or --task, not both"),
        ("--ignore Tree", "not of TDAC-EPuck-v0: leave out --ignore"),
        ("--robot-image no.png", "no robot image"),
        ("--rays 5000", "--rays: "),
        ("--fov 400", "--fov: "),
        ("--max-speed -1", "--max-speed: "),
        ("--resolution 0.1 --map maze", "leave out --map"),
    ],
)
def test_flags_that_do_not_fit_a_task(refused, words, message):
    """One line names the flag."""
    err = refused("synth", "--task", "maze", *words.split())
    assert message in err


@pytest.mark.parametrize(
    ("file", "field"),
    [
        *(("plan.png", "map_image"), ("plan.yaml", "map_image"), ("a.wbt", "world")),
        *(("task.yaml", "task"), ("set.yaml", "set_name"), ("run", "task")),
        *(("set", "set_name"), ("office", "task"), ("unknown", "set_name")),
        *(("a.py", None), ("nosuch", None), (".", None)),
    ],
)
def test_a_file_is_what_it_looks_like(ros, monkeypatch, file, field):
    """A map, a world, a task or a task set, also by name, needs no flag."""
    monkeypatch.chdir(ros.parent)
    for name, text in (("task", "map: plan.png\n"), ("set", "name: a\nworlds: []\n")):
        Path(f"{name}.yaml").write_text(text)
        folder = Path("run" if name == "task" else name)
        folder.mkdir()
        (folder / f"{name}.yaml").write_text(text)
    (ros.parent / "empty").mkdir()
    monkeypatch.chdir(ros.parent / "empty" if file == "." else ros.parent)
    assert kind_of_file(file) == field


def test_a_picture_with_a_resolution(ros):
    """It is the ROS map with this resolution, but for its origin."""
    ends = {"start": (3.05, 8.95), "goal": (13.05, 8.95), "robot_radius": 0.6}
    flags = TaskFlags(map_image=str(ros.parent / "plan.png"), metres=True, **ends)
    with pytest.raises(MapError, match="no resolution"):
        chosen_task(flags)
    task = chosen_task(replace(flags, resolution=0.1))
    assert task.nominal.start[:2] == pytest.approx((30, 30))
    assert task.nominal.body_radius == pytest.approx(6.0)
    with pytest.raises(MapError, match=r"plan.yaml gives 0.1 m per px"):
        chosen_task(replace(flags, map_image=str(ros), resolution=0.2))
    typed = replace(flags, resolution=0.1, metres=False)
    assert chosen_task(typed).sha256() == task.sha256()
    file = ros.parent / "task.yaml"
    file.write_text(
        "map: plan.png\nresolution: 0.1\nframe: metres\nstart: [3.05, 8.95]\n"
        "goal: [13.05, 8.95]\nrobot: {radius: 0.6}\n"
    )
    assert load_task(file).sha256() == task.sha256()
    again = lay_out(task, ros.parent / "run")
    assert load_task(again).sha256() == task.sha256()


@pytest.mark.parametrize("command", COMMANDS)
def test_no_help_names_a_python_type(tdac, command):
    _, out, _ = tdac(*command.split(), "--help")
    assert not re.search(
        r"<(bool|boolean|text|path|float|integer)>", out, re.IGNORECASE
    )


def test_the_grid_as_a_ros_map(tdac, done, tmp_path):
    """It is the same map, and says its resolution, which somebody has to state."""
    text = done("map", "office", "--yaml", "--resolution", 0.05)
    assert "office-map/map.yaml (0.05 m per px)" in text
    again = tdac("map", "office-map/map.yaml", "--json")
    cells = np.load("office-map/occupancy.npy")
    assert again[0] == 0
    assert json.loads(again[1])["params"]["resolution"] == 0.05
    np.testing.assert_array_equal(np.load("map-map/occupancy.npy"), cells)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["office", "--yaml"], "gives no resolution; add --resolution METRES"),
        (["office", "--metres"], "metres"),
        (["office", "--yaml", "--resolution", 0], "expected metres per pixel, got 0"),
    ],
)
def test_a_ros_map_without_a_scale(refused, words, message):
    errors = refused("map", *words)
    assert message in errors


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--robot-radius 3", "not of TDAC-Map2D-v0: leave out --robot-radius"),
        ("--movers crowd:3", "leave out --movers"),
        ("--metres", "--metres is for maps; a world is in metres anyway"),
        ("--map office", "--world defines an e-puck task: leave out --map"),
        ("--heading 1", "--heading needs --start X Y"),
    ],
)
def test_flags_that_do_not_fit_a_world(refused, words, message):
    assert message in refused("synth", "--world", "arena", *words.split())


def test_flags_of_the_robot(tmp_path):
    """Each is a key of the task file, also next to a task with movers."""
    flags = TaskFlags(
        max_speed=40.0, rays=9, fov=90.0, range_max=100.0, tolerance=5.0, dt=0.1
    )
    for task in (chosen_task(flags), chosen_task(replace(flags, task="maze"))):
        robot, nominal = task.nominal.robot, task.nominal
        assert (robot.max_wheel_speed, robot.n_rays) == (40.0, 9)
        assert (robot.field_of_view_deg, robot.range_max) == (90.0, 100.0)
        assert (nominal.goal_tolerance, nominal.dt) == (5.0, 0.1)
    (tmp_path / "task.yaml").write_text("map: office\nmovers: bounce:2\n")
    file = str(tmp_path / "task.yaml")
    plain = chosen_task(TaskFlags(task=file))
    assert chosen_task(TaskFlags(task=file, rays=18)).sha256() == plain.sha256()
