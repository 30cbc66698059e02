"""Controllers in metres: what they are told, and that they drive as in pixels."""

import importlib.util
import json
import subprocess
import sys

import cv2
import numpy as np
import pytest
import yaml
from small import small_cells

from tdac_agent import load_task, verify
from tdac_agent.tasks.task import lay_out
from tdac_envs.core.errors import MapError, TaskError
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.mapping.params import MapParams

START, GOAL, RADIUS = (29.5, 29.5, 0.3), (130.0, 29.5), 6.0
MOVER = {"kind": "bounce", "start": [60.0, 90.0], "heading": 0.4, "speed": 15.0}
TO_GOAL = """
import math

import sensors

def policy(obs):
    x, y, heading = sensors.to_pixels(*map(float, obs["pose"]))
    goal_x, goal_y, _ = sensors.to_pixels(*map(float, obs["goal"]))
    error = math.remainder(math.atan2(goal_y - y, goal_x - x) - heading, math.tau)
    if abs(error) > 0.1:
        return math.copysign(0.2, error), math.copysign(0.2, -error)
    return 0.5, 0.5
"""
"""The same decisions in either frame."""


@pytest.fixture(params=[0.0, 0.7])
def files(request, tmp_path):
    """The same task in pixels and in metres of a frame, which may be rotated."""
    shown = np.where(small_cells(), 0, 254).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "plan.png"), shown)
    origin = [-2.0, -3.0, request.param]
    ros = {"image": "plan.png", "resolution": 0.1, "origin": origin}
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(ros))
    units = MapUnits(MapFrame(shown.shape[0], 0.1, tuple(origin)))
    shared = {"map": "plan.yaml", "profile": "policy", "horizon": 300}
    pixels = {
        "start": [*START], "goal": [*GOAL], "robot": {"radius": RADIUS},
        "movers": [MOVER],
    }  # fmt: skip
    mover = {
        "start": [*units.coordinates(*MOVER["start"])],
        "heading": units.heading(MOVER["heading"]),
        "speed": 1.5,
    }
    metres = {
        "frame": "metres",
        "start": [*units.coordinates(*START[:2]), units.heading(START[2])],
        "goal": [*units.coordinates(*GOAL)],
        "robot": {"radius": 0.1 * RADIUS},
        "movers": [{**MOVER, **mover}],
    }
    for name, own in (("pixels", pixels), ("metres", metres)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump({**shared, **own}))
    return tmp_path, units


@pytest.mark.slow
def test_one_controller_drives_the_same_in_either_frame(files, warm):
    folder, _ = files
    driven = []
    for name in ("pixels", "metres"):
        task = load_task(folder / f"{name}.yaml")
        out = folder / f"out-{name}"
        report = verify(TO_GOAL, task, seed=3, out=out, judge=warm)
        rows = [(e.name, e.outcome, e.steps) for e in report.episodes]
        with np.load(out / "trajectories" / "nominal.npz") as kept:
            driven.append((rows, kept["poses"]))
    assert driven[0][0] == driven[1][0]
    assert driven[0][1].shape[0] > 20
    assert np.array_equal(driven[0][1], driven[1][1])


def test_the_folder_of_a_task_is_the_same_task(files):
    """Its files are in metres, and give the same pixels to the bit."""
    folder, units = files
    task = load_task(folder / "metres.yaml")
    copy = load_task(lay_out(task, folder / "run"))
    assert copy.sha256() == task.sha256() != load_task(folder / "pixels.yaml").sha256()
    written = yaml.safe_load((folder / "run" / "task.yaml").read_text())
    assert written["frame"] == "metres"
    assert written["goal"] == pytest.approx(units.coordinates(*GOAL))
    assert written["robot"]["radius"] == pytest.approx(0.6)
    assert written["movers"][0]["speed"] == pytest.approx(1.5)
    params = json.loads((folder / "run" / "params.json").read_text())
    assert params["frame"] == "metres"
    assert params["goal"] == pytest.approx(units.coordinates(*GOAL))
    assert params["robot"]["radius"] == pytest.approx(0.6)
    assert params["origin"][2] == units.heading(0.0)
    assert MapParams.load(folder / "run" / "params.json") == task.params


def test_metres_without_a_resolution_are_refused(files):
    """The file is named."""
    folder, _ = files
    place = lay_out(load_task(folder / "metres.yaml"), folder / "damaged")
    params = json.loads((place / "params.json").read_text())
    (place / "params.json").write_text(json.dumps({**params, "resolution": None}))
    with pytest.raises(
        MapError, match=r"damaged/params\.json: the frame `metres` needs"
    ):
        load_task(place)


def kit_of(folder):
    """The module `sensors` of a folder."""
    spec = importlib.util.spec_from_file_location("kit", folder / "sensors.py")
    kit = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(kit)
    return kit


def test_what_sensors_convert(files):
    """Places and rays are those of the environment, in either frame."""
    folder, units = files
    for name in ("pixels", "metres"):
        task = load_task(folder / f"{name}.yaml").without_movers()
        kit = kit_of(lay_out(task, folder / f"kit-{name}"))
        env = task.setting.observed()
        seen, _ = env.reset(seed=0)
        x, y, heading = map(float, seen["pose"])
        turned = kit.to_pixels(x, y, heading)
        assert turned[:2] == pytest.approx(START[:2], abs=1e-4)
        assert turned[2] == pytest.approx(START[2], abs=1e-5)
        assert kit.to_cell(*kit.to_point(40, 90)) == (40, 90)
        expected = (40, 90) if name == "pixels" else units.coordinates(40, 90)
        assert kit.to_point(40, 90) == pytest.approx(expected)
        assert kit.to_cell(x + 1e-3, y) == (30, 30)
        robot = kit.load_params()["robot"]
        reach = robot["range_max"]
        fan = robot["n_rays"], robot["field_of_view_deg"], reach
        rays = kit.Ultrasonic(kit.load_occupancy(), *fan)
        own = rays.ranges(x, y, heading)
        assert own == pytest.approx(seen["ranges"], abs=1e-3 * reach)
        left = rays.angles[0]
        assert (left > 0) == (name == "metres")


@pytest.mark.slow
def test_the_folder_runs_by_itself(files):
    """`sensors.show` uses the frame of its params.json."""
    folder, _ = files
    place = lay_out(load_task(folder / "metres.yaml").without_movers(), folder / "own")
    text = f"{TO_GOAL}\n\nif __name__ == '__main__':\n    sensors.show(policy)\n"
    (place / "controller.py").write_text(text)
    done = subprocess.run(
        [sys.executable, "controller.py"], cwd=place, capture_output=True, text=True,
        env={"PATH": "/usr/bin", "HOME": str(folder)}, check=False,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1].startswith(("reached", "collided"))
    assert (place / "controller.mp4").exists()
    env = Map2DEnv(place, frame="metres")
    goal = json.loads((place / "params.json").read_text())["goal"]
    assert env.reset()[0]["goal"] == pytest.approx(goal, abs=1e-5)


@pytest.mark.parametrize("where", ["file", "flag"])
def test_the_functions_of_the_paper_need_pixels(files, where):
    folder, _ = files
    file = folder / "metres.yaml"
    if where == "file":
        file.write_text(file.read_text().replace("profile: policy", "profile: paper"))
    with pytest.raises(TaskError, match="profile `paper` use pixels"):
        load_task(file).with_profile("paper")


def test_metres_mean_the_profile_policy(files):
    """It need not be said."""
    folder, _ = files
    file = folder / "metres.yaml"
    file.write_text(file.read_text().replace("profile: policy\n", ""))
    assert load_task(file).spec.profile == "policy"
