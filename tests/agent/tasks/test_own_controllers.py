"""The controllers of `docs/own-controllers.md` and `examples` do what they say."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tdac_agent import load_task, verify
from tdac_envs.core.errors import TaskError
from tdac_envs.worlds.bundled import world_file

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/own-controllers.md").read_text("utf-8")
FIRST = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1]
PLANNER = (ROOT / "examples/plan_and_follow.py").read_text("utf-8")
ROOM = "image: room.png\nresolution: 0.05\norigin: [-2, 0, {turned}]\n"
TASKS = {
    "pixels": "map: room.png\nprofile: policy\nstart: [40, 60]\ngoal: [160, 30]\n"
    "robot: {radius: 4}\n",
    "metres": "map: map.yaml\nframe: metres\nstart: [0, 2]\ngoal: [6, 3]\n"
    "robot: {radius: 0.2}\n",
    "turned": "map: turned_map.yaml\nframe: metres\nstart: [-3, 2]\ngoal: [-4, 8]\n"
    "robot: {radius: 0.2}\n",
    "world": "env: TDAC-EPuck-v0\nworld: empty.wbt\nprofile: policy\n",
}
"""Tasks without obstacles, in every frame; the last map is turned by 90 degrees."""


@pytest.fixture
def folder(tmp_path):
    """A folder with the tasks and with what they name."""
    wall = np.full((100, 200), 254, np.uint8)
    wall[:2] = wall[-2:] = 0
    cv2.imwrite(str(tmp_path / "room.png"), wall)
    wall[:70, 90:110] = 0
    cv2.imwrite(str(tmp_path / "wall.png"), wall)
    (tmp_path / "map.yaml").write_text(ROOM.format(turned=0))
    (tmp_path / "turned_map.yaml").write_text(ROOM.format(turned=1.5707963))
    empty, _, _ = world_file("arena").read_text().partition("WoodenBox {")
    (tmp_path / "empty.wbt").write_text(empty)
    for name, text in TASKS.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path


@pytest.mark.parametrize("frame", TASKS)
def test_the_controller_of_the_page_turns_to_the_right_side(frame, folder, warm):
    """In pixels, in metres and in a world, from all starts of the suite."""
    report = verify(FIRST, load_task(folder / f"{frame}.yaml"), judge=warm)
    assert report.passed, report


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("frame", ["metres", "pixels", "turned"])
def test_the_example_plans_around_a_wall(frame, folder, warm):
    """The controller of the page touches the wall, and the example does not."""
    (folder / "wall.png").replace(folder / "room.png")
    task = load_task(folder / f"{frame}.yaml")
    assert not verify(FIRST, task, judge=warm).passed
    report = verify(PLANNER, task, judge=warm)
    assert report.passed, report


def test_the_example_on_a_bundled_map(warm):
    """As its own text says."""
    report = verify(PLANNER, load_task("clutter"), profile="policy", judge=warm)
    assert report.passed, report


def test_no_profile_of_the_paper_in_metres(folder):
    """Its functions use pixels: the file cannot ask for them, and no argument can."""
    with pytest.raises(TaskError, match=r"profile `paper` use pixels; in metres"):
        verify(FIRST, load_task(folder / "metres.yaml"), profile="paper")
