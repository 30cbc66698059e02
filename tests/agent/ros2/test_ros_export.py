"""An exported package has the layout of ament_python and the file that was verified."""

import configparser
import hashlib
import json
import re
import runpy
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml
from floor_task import ROBOT, robot_file, write_task
from PIL import Image

from tdac_agent import load_task, synthesize
from tdac_agent.errors import RunError
from tdac_agent.ros2.export import (
    COPIED,
    PACKAGE,
    export_ros2,
    package_name,
    settings_of,
)
from tdac_agent.ros2.package_text import TRIED
from tdac_envs import preprocess
from tdac_envs.core.errors import TaskError

SCRIPTS = {"drive": "node", "watchdog": "watchdog"}
WITH_ROS = {"node.py", "running.py", "watchdog.py"}
"""Modules of a package that import ROS."""
# The rules of `ament_flake8`: its file ament_flake8.ini.
AMENT = """[flake8]
extend-ignore = B902,C816,D100,D101,D102,D103,D104,D105,D106,D107,D203,D212,D404,I202
import-order-style = google
max-line-length = 99
"""


def test_the_controller_is_that_of_the_run(run, package, settings):
    """Byte for byte, with its hash, and beside it what it reads."""
    source = (run / "controller.py").read_bytes()
    assert (package / "controller" / "controller.py").read_bytes() == source
    assert settings["controller_sha256"] == hashlib.sha256(source).hexdigest()
    for name in ("params.json", "occupancy.npy", "sensors.py"):
        there = (package / "controller" / name).read_bytes()
        assert there == (run / name).read_bytes()
    assert settings["verified"] is False


@pytest.mark.slow
def test_a_verified_controller(tmp_path):
    """It needs no flag; the package has its verdict, and what that does not cover."""
    task = load_task(write_task(tmp_path))
    assert synthesize(task, learner="builtin", out=tmp_path / "run").verified
    made = export_ros2(tmp_path / "run", tmp_path / "out")
    assert made.verified
    text = ET.parse(tmp_path / "out" / "package.xml").getroot().findtext("description")
    assert "Verified: arrives ≥ 95 %" in text
    readme = (tmp_path / "out" / "README.md").read_text()
    assert "not covered: other worlds" in readme
    record = json.loads((tmp_path / "run" / "confirmation.json").read_text())
    gap = record["smallest_gap"]["radii"] * ROBOT["radius"]
    assert 0.0 <= ROBOT["radius"] + gap - made.reach < 0.001
    assert f"reaches at most {made.reach:.3f} m from the middle of its axle" in readme


def test_the_modules_are_those_that_are_tested(package):
    """The package has the files of `tdac_agent.ros2.package`."""
    for name in COPIED:
        assert (package / "tdac_floor" / name).read_bytes() == (
            PACKAGE / name
        ).read_bytes()


def test_the_layout_is_that_of_ament_python(package):
    """The files that the ROS documentation lists for a Python package."""
    name = "tdac_floor"
    for file in ("package.xml", "setup.py", "setup.cfg", f"resource/{name}"):
        assert (package / file).is_file()
    root = ET.parse(package / "package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    assert root.findtext("name") == name
    assert root.findtext("export/build_type") == "ament_python"
    assert root.find("maintainer").get("email")
    assert TRIED in root.findtext("description")
    depends = {each.text for each in root.findall("exec_depend")}
    used = {
        line.split()[1].split(".")[0]
        for module in WITH_ROS
        for line in (package / name / module).read_text().splitlines()
        if line.startswith(("import ", "from ")) and " . " not in line
    }
    ours = {
        "__future__",
        "collections",
        "json",
        "math",
        "pathlib",
        "sys",
        "time",
        "typing",
    }
    assert used - ours <= depends
    assert {"rviz2", "nav2_bringup", "nav2_velocity_smoother"} <= depends
    config = configparser.ConfigParser()
    config.read(package / "setup.cfg")
    assert config["develop"]["script_dir"] == f"$base/lib/{name}"
    assert config["install"]["install_scripts"] == f"$base/lib/{name}"


def test_setup_installs_each_file(package, monkeypatch):
    """`setup.py` names the node, and every file that the node reads."""
    given = {}
    monkeypatch.setattr("setuptools.setup", given.update)
    monkeypatch.chdir(package)
    runpy.run_path("setup.py")
    scripts = [f"{n} = tdac_floor.{m}:main" for n, m in SCRIPTS.items()]
    assert given["entry_points"] == {"console_scripts": scripts}
    assert given["packages"] == ["tdac_floor"]
    placed = {file for _, files in given["data_files"] for file in files}
    expected = {"package.xml", "README.md", "resource/tdac_floor"}
    for folder in ("launch", "config", "rviz", "maps", "controller"):
        expected |= {f"{folder}/{each.name}" for each in (package / folder).iterdir()}
    expected.discard("controller/__pycache__")
    assert placed == expected


def test_the_style_is_that_of_ros(package, tmp_path):
    """`flake8` with the rules of ament finds nothing outside the controller."""
    rules = tmp_path / "ament.ini"
    rules.write_text(AMENT + "application-import-names = tdac_floor\n")
    command = [sys.executable, "-m", "flake8", "--config", rules]
    assert _printed(*command, "--exclude", "controller", package) == ""
    bad = tmp_path / "bad.py"
    bad.write_text('"""nothing"""\nimport sys\nimport os\nx = "a"\n')
    assert {"Q000", "I100", "F401", "D400"} <= set(_printed(*command, bad).split())


def _printed(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def test_no_module_but_the_nodes_knows_ros(package):
    """All but the nodes and what runs them import the standard library and numpy."""
    for name in set(COPIED) - WITH_ROS:
        text = (package / "tdac_floor" / name).read_text()
        imported = {
            line.split()[1].partition(".")[0]
            for line in text.splitlines()
            if line.startswith(("import ", "from "))
        }
        assert imported - set(sys.stdlib_module_names) <= {"numpy", ""}


def test_the_map_is_that_of_the_task(package, task):
    """`map.yaml` is read as the same cells at the same place."""
    grid, _ = preprocess(package / "maps" / "map.yaml", robot_radius=0.1 / 0.05)
    own = task.setting.nominal.terrain.grid
    assert np.array_equal(grid.cells, own.cells)
    assert (grid.resolution, grid.origin) == (own.resolution, own.origin)


def test_the_parameters_are_those_of_the_node(package):
    """`drive.yaml` has each parameter of the node, and no timer yet."""
    written = yaml.safe_load((package / "config" / "drive.yaml").read_text())
    own = written["/**"]["ros__parameters"]
    scope = {}
    text = (package / "tdac_floor" / "node.py").read_text()
    begin = text.index("DEFAULTS:")
    exec(
        text[begin : text.index("}", begin) + 1].replace(": dict[str, Any]", ""), scope
    )
    assert own == scope["DEFAULTS"]
    assert own["dead_man"] == 0.0


def test_the_readme_says_what_was_not_run(package):
    """Nobody can take the wrapper for tested."""
    text = (package / "README.md").read_text()
    assert TRIED in text
    assert "ros2 service call /drive/start" in text
    assert "| a scan or a pose is late, lost or old | 0.195 |" in text
    assert "AMCL needs the map as SLAM wrote it" in text
    assert "The map's unknown cells are walls." in text
    assert "/drive/stop" in text
    assert "the task floor over ROS 2" in text


def test_unknown_cells_that_count_as_free_are_named(tmp_path):
    """By the thresholds of the map, grey 205 may be free: the package says so."""
    task = load_task(write_task(tmp_path))
    file = tmp_path / "map.yaml"
    own = yaml.safe_load(file.read_text())
    image = next(each for each in tmp_path.iterdir() if each.name == own["image"])
    with Image.open(image) as picture:
        cells = np.array(picture.convert("L"))
    assert settings_of(task)["unknown"] == "The map's unknown cells are walls."
    cells[5:10, 50:55] = 205
    Image.fromarray(cells).save(image)
    file.write_text(yaml.safe_dump({**own, "free_thresh": 0.25}))
    said = settings_of(load_task(tmp_path / "task.yaml"))["unknown"]
    assert said.startswith("The map's unknown cells count as FREE by its free_thresh")


def test_the_smoother_has_the_limits_of_the_robot(package, settings):
    """Its launch file is Python, and names the speeds of the robot file."""
    text = (package / "launch" / "smoother.launch.py").read_text()
    compile(text, "smoother", "exec")
    assert "'max_velocity': [0.3, 0.0, 3.0]" in text
    assert "'velocity_timeout': 0.18" in text
    assert "executable='watchdog'" in text
    assert "{'stamped': stamped, 'silent': 0.3}" in text
    rviz = yaml.safe_load((package / "rviz" / "drive.rviz").read_text())
    shown = rviz["Visualization Manager"]["Displays"]
    topics = {each.get("Topic", {}).get("Value") for each in shown}
    assert {"/drive/path", "/drive/goal"} <= topics


def test_no_file_names_a_place_of_the_machine(run, package):
    """Who gets the package learns nothing of the folders of its exporter."""
    for file in package.rglob("*"):
        if file.is_file() and "__pycache__" not in file.parts:
            data = file.read_bytes()
            for place in (run, package, Path.home(), Path(sys.prefix)):
                assert str(place).encode() not in data, (file, place)


HOSTILE = "a`$(touch x)`</description><b>'\"; import os # {{ 7*7 }} [x](http:y) ü"


def test_a_hostile_name_of_a_task_stays_text(run, tmp_path):
    """It ends up in no code, no XML, no shell command and no Markdown."""
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    spec = yaml.safe_load((folder / "task.yaml").read_text())
    spec["name"] = HOSTILE.replace("/", "|")
    (folder / "task.yaml").write_text(yaml.safe_dump(spec))
    made = export_ros2(folder, tmp_path / "out", unverified=True)
    assert re.fullmatch("[a-z0-9_]+", made.name)
    for file in made.folder.rglob("*"):
        if file.is_file() and file.name != "settings.json":
            data = file.read_bytes()
            for part in (b"$(touch", b"<b>", b"import os #", b"7*7", b"](http:y"):
                assert part not in data or file.suffix in {".npy", ".png", ".py"}, file
    for file in (*made.folder.glob("*.py"), *(made.folder / "launch").iterdir()):
        compile(file.read_text(), str(file), "exec")
    ET.parse(made.folder / "package.xml")
    yaml.safe_load((made.folder / "config" / "drive.yaml").read_text())
    settings = json.loads((made.folder / "controller" / "settings.json").read_text())
    assert settings["task"] == spec["name"]


@pytest.mark.parametrize("name", ["test", "config", "class", "json", "numpy", "rclpy"])
def test_names_that_would_hide_others_are_refused(run, tmp_path, name):
    """Of Python, of the package's own folders, of what it imports."""
    with pytest.raises(RunError, match=f"has this name; try tdac_{name}"):
        export_ros2(run, tmp_path / "out", name=name, unverified=True)
    assert not (tmp_path / "out").exists()


def test_what_is_not_verified_needs_a_flag(run, package, tmp_path):
    """Then the description, the README and the settings say so."""
    out = tmp_path / "out"
    with pytest.raises(
        RunError, match=r"is not verified \(passed\); give --unverified"
    ):
        export_ros2(run, out)
    assert not out.exists()
    text = ET.parse(package / "package.xml").getroot().findtext("description")
    assert text.startswith("NOT VERIFIED. ")
    assert "**Not verified.**" in (package / "README.md").read_text()


def test_a_run_of_others_is_only_a_claim(run, tmp_path):
    """What its files say of a verdict is not believed."""
    folder = tmp_path / "run"
    folder.mkdir()
    for file in run.iterdir():
        if file.is_file():
            (folder / file.name).write_bytes(file.read_bytes())
    record = json.loads((run / "run.json").read_text())
    record.update(status="verified", confirm=True)
    (folder / "run.json").write_text(json.dumps(record))
    with pytest.raises(RunError, match="only what its files claim; give --unverified"):
        export_ros2(folder, tmp_path / "out")


def test_a_folder_with_files_is_refused(run, tmp_path):
    """Nothing is written over."""
    (tmp_path / "mine").write_text("")
    with pytest.raises(RunError, match="is not an empty folder"):
        export_ros2(run, tmp_path, unverified=True)
    with pytest.raises(RunError, match="--name 'Bad__Name': a ROS package"):
        export_ros2(run, tmp_path / "out", name="Bad__Name", unverified=True)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"robot": {"radius": 0.1, "max_wheel_speed": 0.3}}, "no stopping distance"),
        ({"robot": {"file": "robot.yaml", "stopping_distance": 0.01}}, "impossible"),
    ],
)
def test_a_robot_that_cannot_stop_is_refused(tmp_path, changes, why):
    """One line says what is missing or impossible."""
    task = load_task(write_task(tmp_path, **changes))
    with pytest.raises(TaskError, match=why):
        settings_of(task)


def test_tasks_without_metres_are_refused():
    """A controller in pixels, or of an e-puck, drives no robot over ROS 2."""
    with pytest.raises(TaskError, match="is a task in pixels"):
        settings_of(load_task("maze"))
    with pytest.raises(TaskError, match="tdac export webots"):
        settings_of(load_task("epuck-crates"))


@pytest.mark.parametrize("task", ["Büro 2", "A--b__c", "!!!", "tb3_sandbox"])
def test_names_of_packages(task):
    """Lower-case letters, digits and single underscores."""
    name = package_name(task)
    assert name.isascii()
    assert name == name.lower()
    assert "__" not in name
    assert name[0].isalpha()
    assert not name.endswith("_")


def test_it_is_written_for_python_3_10(package):
    """Humble has Python 3.10."""
    import ast

    for file in Path(package).rglob("*.py"):
        if file.parent.name != "controller":
            ast.parse(file.read_text(), feature_version=(3, 10))


def test_a_robot_file_is_complete():
    """The test's own robot file has a source of each figure."""
    assert robot_file()["sources"]["scanner.rays"] == "assumed"
