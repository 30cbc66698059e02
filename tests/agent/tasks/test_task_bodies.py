"""The `body` of a robot's file reaches the physics of the judge, and nothing else."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

import tdac_envs.robots
from tdac_agent import load_task
from tdac_agent.tasks.task import lay_out, read_task

pytest.importorskip("mujoco")
FILES = Path(tdac_envs.robots.__file__).parent / "files"
BODY = {"mass": 0.3, "height": 0.06, "torque": 0.004, "grip": 0.7}
PLACES: dict[str, dict[str, Any]] = {
    "turtlebot3-burger": {
        "map": "room.yaml", "start": [2, 4], "goal": [10, 4], "frame": "metres",
    },
    "e-puck": {"env": "TDAC-EPuck-v0", "world": "crates"},
}  # fmt: skip
ROS_MAP = (
    "image: room.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
)
"""An empty room of 12 x 8 m."""


def task_with(folder, robot, **own):
    """A task of a robot whose file is beside it, with some keys of its own."""
    values = yaml.safe_load((FILES / f"{robot}.yaml").read_text())
    values |= own
    sources = {f"body.{key}": "a balance" for key in own.get("body", {})}
    values["sources"] = {**values["sources"], **sources}
    folder.mkdir()
    cells = np.full((160, 240), 255, np.uint8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 0
    cv2.imwrite(str(folder / "room.png"), cells)
    (folder / "room.yaml").write_text(ROS_MAP)
    (folder / "robot.yaml").write_text(yaml.safe_dump(values))
    place = {**PLACES[robot], "robot": {"file": "robot.yaml"}}
    (folder / "task.yaml").write_text(yaml.safe_dump(place))
    return folder


def model_of(task):
    """What MuJoCo drives."""
    env = task.make_env(physics="mujoco")
    carried = getattr(env, "_carried", None) or env._movables
    return carried.body


@pytest.mark.parametrize("robot", PLACES)
def test_the_judge_drives_the_body_of_the_file(robot, tmp_path):
    """Also where the task has been laid out, as for a judge's process or in a run."""
    task = load_task(task_with(tmp_path / "task", robot, body=BODY))
    plain = load_task(task_with(tmp_path / "plain", robot))
    for each in (task, read_task(lay_out(task, tmp_path / "laid"))):
        body = model_of(each)._body
        assert (body.mass, body.top, body.torque, body.grip) == (0.3, 0.06, 0.004, 0.7)
        assert body.wheel_radius == model_of(plain)._body.wheel_radius
        # The exact step does not depend on it.
        assert each.sha256() == plain.sha256()


@pytest.mark.parametrize("robot", PLACES)
@pytest.mark.parametrize(
    ("body", "told"),
    [({"mass": -0.3}, "body.mass"), ({"mass": 1e-9, "wheel_mass": 1.0}, "mass")],
)
def test_a_wrong_body_is_one_line(robot, body, told, tmp_path, refused):
    """When the file is read, or before the drive that needs it."""
    place = task_with(tmp_path / "task", robot, body=body)
    controller = tmp_path / "c.py"
    controller.write_text("def policy(obs):\n    return 0.0, 0.0\n")
    words = "--profile", "policy", "--physics", "mujoco"
    assert told in refused("verify", controller, "--task", place, *words)


def test_a_world_without_ground_is_one_line(tmp_path, refused):
    """The exact step drives there; MuJoCo's robot would fall."""
    from tdac_envs.worlds.bundled import world_file

    text = world_file("crates").read_text()
    arena = "RectangleArena {\n  floorSize 1.6 1\n}\n"
    assert arena in text
    (tmp_path / "task").mkdir()
    (tmp_path / "task/void.wbt").write_text(text.replace(arena, ""))
    (tmp_path / "task/task.yaml").write_text("env: TDAC-EPuck-v0\nworld: void.wbt\n")
    controller = tmp_path / "c.py"
    controller.write_text("def policy(obs):\n    return 0.0, 0.0\n")
    words = "--profile", "policy", "--physics", "mujoco"
    said = refused("verify", controller, "--task", tmp_path / "task", *words)
    assert "there is no ground under the robot" in said
