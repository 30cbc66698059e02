"""Each command of README and docs is run as it stands, one page after another.

What takes longer than `PATIENCE` is interrupted as with Ctrl-C, and must end as an
interrupted command does. Left out are commands that need a key, another program, a
person or a display: `LEFT_OUT` says which.
"""

import functools
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from test_site import CASES

from tdac_envs.mapping.bundled import bundled_map
from tdac_envs.worlds.bundled import world_file

pytestmark = pytest.mark.slow

PATIENCE = 30.0
"""Seconds until a command is interrupted."""
LEFT_OUT = {
    "needs a key": re.compile(r"(anthropic|openai):(?!.*--dry-run)(?!.*localhost)"),
    "needs a server of models": re.compile("localhost:"),
    "needs another program": re.compile("command:"),
    "needs a person": re.compile("manual:"),
    "needs the results of a clone": re.compile("results/"),
    "needs a second process": re.compile("tdac ros "),
    "needs the gallery's answers": re.compile("answers/"),
    "needs a display": re.compile("studio --open"),
}
NEEDS = {
    "stable_baselines3": re.compile(r"tdac train|\.zip"),
    "nicegui": "tdac studio",
    "mcp.server": "tdac mcp",
    "mcap": "--mcap|--recorded",
}
"""Extras, and the commands that need them."""

GO_TO_GOAL = """
import math


def policy(obs):
    if "pose" not in obs:
        return 0.3, 0.3
    x, y, heading = map(float, obs["pose"])
    goal_x, goal_y = map(float, obs["goal"])
    off = math.remainder(math.atan2(goal_y - y, goal_x - x) - heading, math.tau)
    return (0.5, -0.5) if off > 0.3 else (-0.5, 0.5) if off < -0.3 else (1.0, 1.0)
"""
WEBOTS = """
from controller import Robot

robot = Robot()
step = int(robot.getBasicTimeStep())
wheels = [robot.getDevice(f"{side} wheel motor") for side in ("left", "right")]
for wheel, speed in zip(wheels, (2.0, 1.5)):
    wheel.setPosition(float("inf"))
    wheel.setVelocity(speed)
while robot.step(step) != -1:
    pass
"""
TASK = """
map: ../../plan.png
start: [90, 302, -1.57]
goal: [178, 386]
robot: {radius: 12}
tolerance: 15
"""
CAMPAIGN = """
schema: 1
name: my
about: one run without a model
tasks: [maze]
learners: [builtin]
runs: 1
iterations: 2
"""
PREPARED = {
    r"maze-1\b(?<!ppo-maze-1)": "tdac synth",
    r"runs( |$)|office": "tdac synth --task office",
    "epuck-1": "tdac synth --task epuck",
    "depot": "tdac synth --map depot.yaml --start 0 2 --goal 6 3 "
    "--robot turtlebot3-burger",
    r"drive\.mcap": "tdac play runs/depot-1 --mcap drive.mcap",
    r"sim\.mcap": "tdac play runs/depot-1 --mcap sim.mcap",
    "unknown-1": "tdac synth --set unknown --episodes 8",
    "mine theirs": "tdac bench go-to-goal --set unknown -n 2 --out mine",
    "theirs": "tdac bench other.py --set unknown -n 2 --out theirs",
    "show arena": "tdac bench go-to-goal --set unknown -n 2 --out arena",
    "campaigns/my": "tdac campaign my.yaml",
    "demo-1": "tdac demo",
    "rules-1|--rules": "tdac synth --prompt underspecified --learner replay:rules "
    "--no-confirm --out runs/rules-1",
    "--rules": "tdac rules export runs/rules-1 --out rules.md",
    r"runs/ppo/|--from POLICY|falsify .*\.zip": "tdac train --set unknown --steps 4096 "
    "--out runs/ppo",
    r"\.zip|ppo-maze-1": "tdac train --task maze --steps 4096",
}
"""Commands that must have run before others, by what these name."""
LEARNED = "runs/ppo-maze-1/policy.zip"
"""This policy stands for all those that the pages name, but for one."""
FURTHER = "runs/ppo/policy.zip"
"""The one of a task set: a training begins with it, or a search for its failures."""


def runs_here(line):
    """Whether a command needs nothing that a test cannot have."""
    return not any(re.search(pattern, line) for pattern in LEFT_OUT.values())


def run(line, folder, patience):
    """Exit code and output of a command, interrupted when patience is over."""
    words = [Path(sys.executable).with_name("tdac")]
    if re.match(r"tdac play (?!.*--(video|mcap))", line):
        line = f"{line.partition('#')[0]} --video window.mp4"  # there is no screen
    process = subprocess.Popen(
        [*words, *shlex.split(line, comments=True)[1:]], cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        text, _ = process.communicate(timeout=patience)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
        text, _ = process.communicate(timeout=120)
    return process.returncode, text


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the files and runs that the pages name."""
    folder = tmp_path_factory.mktemp("site")
    patch = pytest.MonkeyPatch()
    patch.setenv("XDG_STATE_HOME", str(folder / "state"))
    shutil.copy(bundled_map("maze").image, folder / "plan.png")
    room = np.full((100, 200), 254, np.uint8)
    cv2.imwrite(str(folder / "depot.png"), room)
    ros = "image: depot.png\nresolution: 0.05\norigin: [-2, 0, 0]\n"
    (folder / "depot.yaml").write_text(ros)
    for name in ("controller.py", "mine.py", "other.py"):
        (folder / name).write_text(GO_TO_GOAL)
    (folder / "plans" / "kitchen").mkdir(parents=True)
    (folder / "plans" / "kitchen" / "task.yaml").write_text(TASK)
    (folder / "my.yaml").write_text(CAMPAIGN)
    (folder / "my.hex").write_text(bytes(range(32)).hex())
    template = "Write controller.py. {{ env_description }} {{ rules_block }}"
    (folder / "mine.j2").write_text(template)
    for name, world in (("maze", "maze"), ("my", "arena")):
        shutil.copy(world_file(world), folder / f"{name}.wbt")
    arena, _, _ = world_file("arena").read_text().partition("WoodenBox {")
    (folder / "empty.wbt").write_text(arena)
    (folder / "my_controller.py").write_text(WEBOTS)
    yield folder
    patch.undo()


@functools.cache
def run_once(first, folder):
    """Runs a command that others need."""
    code, text = run(first, folder, 600)
    assert code in (0, 1), f"{first}\n{text}"
    assert "Traceback" not in text, text


def prepare(line, folder):
    """Runs, once, the commands that one needs to have been run."""
    if "LegoTallWall" in line:  # a node that is not modelled
        world = folder / "my.wbt"
        world.write_text(world.read_text() + "LegoTallWall {\n}\n")
    if "export ros2" in line:  # several pages write the same package
        shutil.rmtree(folder / "depot_drive", ignore_errors=True)
    for pattern, first in PREPARED.items():
        if re.search(pattern, line):
            run_once(first, folder)
    for name in re.findall(r"[\w/-]+\.zip", line):
        on_set = re.search("--from|falsify", line)
        if on_set or not (folder / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(folder / (FURTHER if on_set else LEARNED), folder / name)


def test_what_is_left_out():
    """Few commands are, and most of them for want of a key."""
    left_out = [line for _, line in CASES if not runs_here(line)]
    assert len(left_out) < len(CASES) / 4


LINES = [(page, line) for page, line in CASES if runs_here(line)]


@pytest.mark.parametrize(
    ("page", "line"), LINES, ids=[f"{p.stem}:{line[:50]}" for p, line in LINES]
)
def test_a_command_runs(page, line, place):
    """It does what it says, or is interrupted cleanly; no usage error, no traceback."""
    for package, pattern in NEEDS.items():
        if re.search(pattern, line):
            pytest.importorskip(package)
    prepare(line, place)
    code, text = run(line, place, PATIENCE)
    assert "Traceback" not in text, text
    assert code in (0, 1, 130), f"exit {code}\n{text}"
