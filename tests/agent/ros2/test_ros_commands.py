"""`tdac export ros2` and `tdac ros …`: what they print, and one line for bad input."""

import importlib.util
import json

import pytest
from floor_task import write_task

from tdac_agent.cli.main import main
from tdac_agent.ros2.answers import Answers, timed


@pytest.fixture
def tdac(monkeypatch, capsys):
    """Runs a command line; returns its exit code and what it printed."""

    def run(*words):
        monkeypatch.setattr("sys.argv", ["tdac", *map(str, words)])
        with pytest.raises(SystemExit) as done:
            main()
        return done.value.code, capsys.readouterr()

    return run


def refused(result, why):
    """Exit code 2, and one line that says why."""
    code, printed = result
    assert code == 2
    assert printed.err.count("\n") == 1
    assert why in printed.err
    assert "Traceback" not in printed.err


def test_export_says_what_it_wrote(tdac, run, tmp_path):
    """The verdict, the longest stop, and that no robot was driven."""
    code, printed = tdac("export", "ros2", run, "--out", tmp_path / "a", "--unverified")
    assert code == 0
    text = " ".join(printed.out.split())
    assert "(ROS 2 package tdac_floor)" in text
    assert "not verified: the package says so" in text
    assert "stops within 0.435 m" in text
    assert "but on no robot" in text
    assert "The map's unknown cells are walls." in text
    words = "export", "ros2", run, "--out", tmp_path / "b", "--unverified", "--json"
    record = json.loads(tdac(*words)[1].out)
    assert "but on no robot" in record["tried"]
    assert record["verified"] is False
    assert record["answers"]["count"] > 10
    assert record["answers"]["budget"] == 0.05


@pytest.mark.slow
def test_a_controller_that_is_slower_than_the_node_is_named(task):
    """The judge allows 10 s for an answer, the node half a period."""
    slow = (
        b"import time\n\ndef policy(obs):\n    time.sleep(0.08)\n    return 0.1, 0.1\n"
    )
    answers = timed(slow, task)
    assert answers.late == answers.count > 10
    assert answers.longest >= 0.08
    assert "answers took longer than 0.05 s" in answers.warning()
    assert Answers(10, 0, 0.01, 0.05).warning() == ""


def test_what_cannot_be_exported(tdac, run, tmp_path):
    """An unverified run, no run, and a folder with files."""
    out = tmp_path / "out"
    refused(tdac("export", "ros2", run, "--out", out), "give --unverified")
    refused(tdac("export", "ros2", tmp_path, "--out", out), "is not a run folder")
    assert not out.exists()
    words = "export", "ros2", run, "--out", tmp_path, "--unverified"
    (tmp_path / "mine").write_text("")
    refused(tdac(*words), "is not an empty folder")


def test_tasks_that_no_robot_drives(tdac, tmp_path):
    """A task in pixels, an e-puck, and robots that cannot stop as they say."""
    refused(tdac("ros", "sim", "--task", "maze"), "is a task in pixels")
    refused(tdac("ros", "sim", "--task", "epuck-crates"), "tdac export webots")
    robot = {"file": "robot.yaml", "stopping_distance": 0.001}
    refused(tdac("ros", "sim", write_task(tmp_path, robot=robot)), "impossible robot")
    text = (tmp_path / "robot.yaml").read_text()
    (tmp_path / "robot.yaml").write_text(text.replace("radius: 0.1\n", "radius: -1\n"))
    refused(tdac("ros", "sim", write_task_again(tmp_path)), "radius")


def write_task_again(folder):
    """The task with the robot file as it is now."""
    text = (folder / "task.yaml").read_text()
    begin = text.index("robot:")
    end = text.index("start:")
    text = text[:begin] + "robot: robot.yaml\n" + text[end:]
    (folder / "task.yaml").write_text(text)
    return folder / "task.yaml"


def test_flags_that_are_wrong(tdac, run):
    """Faults, a timer that is too long, and the name of a bag."""
    refused(tdac("ros", "sim", run, "--fault", "nan-scan@1+2"), "did you mean")
    refused(tdac("ros", "sim", run, "--dead-man", "0.5"), "dead_man: expected")
    refused(tdac("ros", "sim", run, "--mcap", "x.bag"), "must end in .mcap")
    refused(tdac("ros", "drive", run), "is not a package of tdac export ros2")


@pytest.mark.parametrize(
    ("flags", "why"),
    [
        (["--max-jump", "-1"], "max_jump: expected 0 or more, got -1"),
        (["--max-deviation", "-1"], "max_deviation: expected 0 or more, got -1"),
        (["--dead-man", "0.5"], "dead_man: expected"),
        (["--max-localiser-age", "9"], "max_localiser_age: expected 0.1 to 2 s"),
    ],
)
def test_settings_of_a_drive_that_are_impossible(tdac, package, flags, why):
    """They have the names of the node's parameters."""
    pytest.importorskip("cyclonedds", reason="no wheel of Cyclone DDS")
    refused(tdac("ros", "drive", package, "--domain", "17", *flags), why)


def test_the_extra_is_named(tdac, run, monkeypatch):
    """Without Cyclone DDS, one line says what to install."""
    found = importlib.util.find_spec

    def without(name, *rest):
        return None if name == "cyclonedds" else found(name, *rest)

    monkeypatch.setattr("importlib.util.find_spec", without)
    code, printed = tdac("ros", "sim", run)
    assert code == 2
    assert "[ros2]" in printed.err
