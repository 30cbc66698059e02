"""`--metres` in what verify, evaluate, play and synth print, and the shortest path."""

import json
import re

import cv2
import numpy as np
import pytest
from script import AHEAD
from small import small_cells

from tdac_agent import load_task
from tdac_agent.tasks.task import lay_out
from tdac_agent.tasks.units import METRES, PIXELS
from tdac_agent.verification.diagnosis.measures import shortest_path_length
from tdac_envs.grid.map_units import MapFrame, MapUnits

# 0.1 m per px; the lower-left corner of the map is at (-2, -3) m.
FRAME = MapUnits(MapFrame(120, 0.1, (-2.0, -3.0, 0.0)))
ENDS = ("--start", "1.07", "6", "--goal", "11.05", "6", "--robot-radius", "0.6")


@pytest.fixture
def plan(tmp_path):
    """The small map with a `map.yaml`."""
    shown = np.where(small_cells(), 0, 254).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "plan.png"), shown)
    text = "image: plan.png\nresolution: 0.1\norigin: [-2, -3, 0]\n"
    (tmp_path / "plan.yaml").write_text(text)
    (tmp_path / "forward.py").write_text(AHEAD)
    return tmp_path / "plan.yaml"


@pytest.fixture
def folder(plan, tmp_path):
    """A folder like that of a run: a controller, and its task in pixels."""
    file = tmp_path / "task.yaml"
    file.write_text(
        f"map: {plan}\nstart: [30, 30]\ngoal: [130, 30]\nrobot: {{radius: 6}}\n"
        "profile: policy\nhorizon: 300\n"
    )
    lay_out(load_task(file), tmp_path / "run")
    (tmp_path / "run" / "controller.py").write_text(AHEAD)
    return tmp_path / "run"


def test_lengths_and_places_of_a_frame():
    """y points up and headings are counter-clockwise, also in a rotated frame."""
    units = PIXELS.in_metres(FRAME)
    assert units.far(12.0) == "1.20 m"
    assert units.length_text(12.0) == "1.2 m"
    assert units.point(29.5, 29.5) == "(1.00, 6.00)"
    assert units.pose(29.5, 29.5, 0.5) == "1.00 6.00 -29"
    low, high = np.array([29.5, 29.5]), np.array([39.5, 49.5])
    assert units.box(low, high) == "x 1.00 to 2.00, y 4.00 to 6.00"
    turned = PIXELS.in_metres(MapUnits(MapFrame(120, 0.1, (0.0, 0.0, 1.5))))
    assert turned.heading_of(0.0) == pytest.approx(1.5)
    assert (PIXELS.far(12.0), METRES.far(12.0)) == ("12.0 px", "12.0 mm")


def test_a_failed_verification(tdac, plan):
    """Tables, failures and diagnoses are in metres; the report stays in pixels."""
    words = ("verify", plan.parent / "forward.py", "--map", plan, "--metres", *ENDS)
    code, text, err = tdac(*words, "--profile", "policy", "--out", "seen", "--seed", 1)
    assert (code, err) == (1, "")
    told = " ".join(text.split())
    assert "Episodes as the environment recorded them (m)" in told
    assert re.search(
        r"collision in step \d+ \(\d+\.\d s\) at \(\d\.\d\d, 6\.00\)", told
    )
    assert re.search(r"must fall from \d+\.\d+ m to \d+\.\d+ m or less", told)
    assert "Path left: " in told
    assert "Last poses (step: x y in m, heading" in told
    assert not re.search(r"\bpx\b", told)
    report = json.loads((plan.parent / "here" / "seen" / "report.json").read_text())
    assert report["provenance"]["unit"] == "px"
    texts = [f["diagnosis"]["text"] for f in report["failures"] if f["diagnosis"]]
    assert any("px" in text for text in texts)
    assert not any(" m " in text for text in texts)
    assert all("shown" not in (f["diagnosis"] or {}) for f in report["failures"])


@pytest.mark.slow
def test_a_run_folder_in_metres(tdac, rejected, folder):
    """Its task is in pixels; with `--metres`, only what is printed is converted."""
    text = rejected("verify", folder, "--seed", 1)
    assert "recorded them (px)" in text
    text = rejected("verify", folder, "--seed", 1, "--metres")
    assert "recorded them (m)" in text
    assert not re.search(r"\d px", text)
    text = rejected("verify", folder / "controller.py", "--metres", "--seed", 1)
    assert "recorded them (m)" in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--task", "maze"), "--metres needs a map with a resolution, as in map.yaml"),
        (("--task", "epuck"), "--metres is for maps; a world is in metres anyway"),
        ((), "--metres needs a --map with a resolution, as in map.yaml"),
    ],
)
def test_metres_of_what_has_none(refused, plan, words, message):
    err = refused("verify", plan.parent / "forward.py", "--metres", *words)
    assert message in err


@pytest.mark.slow
def test_an_evaluation_in_metres(tdac, plan, folder):
    """Of a map, or of a task in pixels; JSON keeps pixels and says so."""
    words = ("evaluate", "random", "--episodes", "1", "--metres")
    code, text, err = tdac(*words, "--map", plan, *ENDS)
    assert (code, err) == (0, "")
    assert "gap m" in text
    assert "goal within 0.6 m (1.0 radii)" in " ".join(text.split())
    code, text, _ = tdac(*words, "--task", folder)
    assert "gap m" in text
    code, text, _ = tdac(*words, "--task", folder, "--json")
    assert json.loads(text)["tasks"][0]["unit"] == "px"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--task", "plan.png"), "plan.png is a map, not a task: give --map plan.png"),
        (("--task", "plan.yaml"), "plan.yaml is a map, not a task: give --map plan.ya"),
        (("--task", "a.wbt"), "a.wbt is a world, not a task: give --world a.wbt"),
        (("--map", "plan.yaml"), "needs --start X Y and --goal X Y"),
        (
            ("--start", "1", "2", "--task", "maze", "--task", "office"),
            "--start changes one task: give one --task",
        ),
    ],
)
def test_a_map_is_no_task(refused, plan, monkeypatch, words, message):
    """One line that names the right flag."""
    monkeypatch.chdir(plan.parent)
    (plan.parent / "a.wbt").write_text("#VRML_SIM R2023b utf8\n")
    err = refused("evaluate", "random", *words)
    assert message in err


def test_a_picture_without_a_scale_says_how_to_use_metres(done, refused, plan):
    """Where its places are asked for; a map with a resolution needs no such hint."""
    picture, hint = plan.with_suffix(".png"), "for metres, add --resolution METRES"
    assert hint in refused("synth", str(picture), "--dry-run")
    assert hint not in refused("synth", str(plan), "--dry-run")
    out = ("--out", str(plan.parent / "grid"))
    assert hint in done("map", str(picture), *out)
    assert hint not in done("map", str(plan), *out)


def test_a_place_is_quoted_as_typed(tdac, plan):
    """Not at the centre of its pixel, as suggestions are."""
    words = ("--goal", "11.05", "6", "--robot-radius", "0.6", "--metres")
    _, _, err = tdac("map", plan, "--start", "5.37", "5.999", *words)
    assert "start (5.37, 5.999) lies in an obstacle" in err
    _, text, _ = tdac("map", plan, "--start", "5.37", "5.999", *words, "--snap")
    assert re.search(r"start moved from \(5.37, 5.999\) to \(\d.\d5, \d.\d5\)", text)


@pytest.mark.slow
def test_one_shortest_path(tdac, done, plan):
    """The same length in `map` and `synth`, and that of `tdac evaluate`."""
    ends = ("--start", "30", "30", "--goal", "130", "30", "--robot-radius", "6")
    ends = (*ends, "--frame", "pixels")
    _, text, _ = tdac("map", plan, *ends)
    [printed] = re.findall(r"shortest path (\d+) px", text)
    file = plan.parent / "task.yaml"
    file.write_text(
        f"map: {plan}\nstart: [30, 30]\ngoal: [130, 30]\nrobot: {{radius: 6}}\n"
    )
    nominal = load_task(file).nominal
    assert int(printed) == round(shortest_path_length(nominal))
    assert nominal.shortest > 1.02 * shortest_path_length(nominal)
    text = done("synth", "--map", plan, *ends)
    assert f"shortest path {printed} px" in " ".join(text.split())


def test_the_robot_of_a_map_in_metres(tdac, plan):
    """Its default speed is one of a real robot, and it is printed."""
    _, text, _ = tdac("map", plan, "--metres", *ENDS)
    assert "robot: radius 0.6 m, full speed 0.5 m/s" in text
    assert "--max-speed" in text
