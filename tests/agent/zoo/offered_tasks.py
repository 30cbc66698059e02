"""Task files that somebody else offers."""

from __future__ import annotations

import os
from pathlib import Path

import yaml
from offered_maps import draw, link, pipe, text
from offers import Maker, Offer

WORDS = ("synth", "--task", "task.yaml", "--dry-run")
GOOD = {
    "schema": 1,
    "map": "plan.png",
    "robot": {"radius": 6},
    "start": [20, 50, 0.0],
    "goal": [110, 50],
    "tolerance": 8,
}


def task(**changes: object) -> Maker:
    """A task on `plan.png` with some fields written otherwise."""

    def make(here: Path) -> None:
        draw(here)
        (here / "task.yaml").write_text(yaml.safe_dump(GOOD | changes))

    return make


def more(line: str) -> Maker:
    """The good task with a line more."""

    def make(here: Path) -> None:
        task()(here)
        with (here / "task.yaml").open("a") as file:
            file.write(line)

    return make


def robot(**changes: object) -> Maker:
    """The good task with another robot."""
    return task(robot={"radius": 6} | changes)


def _offer(name: str, make: Maker, says: str, endless: bool = False) -> Offer:
    return Offer("tasks", name, WORDS, make, says, endless=endless)


def _robot_pipe(here: Path) -> None:
    robot(image="robot.png")(here)
    os.mkfifo(here / "robot.png")


_LAUGHS = "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10) if n else 'x'}]\n" for n in range(10)
)

OFFERS = [
    _offer("endless", link("task.yaml", "/dev/zero"), "not a regular file", True),
    _offer("pipe", pipe("task.yaml"), "not a regular file", True),
    _offer("folder", lambda here: (here / "task.yaml").mkdir(), "no task"),
    _offer("large", task(instructions="x" * 1_000_000), "larger than 1 MB"),
    _offer("map_endless", task(map="/dev/zero"), "not a regular file", True),
    _offer("robot_endless", robot(image="/dev/zero"), "robot image", True),
    _offer("robot_pipe", _robot_pipe, "robot image", True),
    _offer("deep", text("task.yaml", "[" * 3000), "nested deeper than 64 levels"),
    _offer("date", more("name: 2001-99-99"), "not valid YAML"),
    _offer("digits", more(f"horizon: {'9' * 5000}"), "more than 100 digits"),
    _offer("base_60", more(f"horizon: 1{':59' * 100_000}"), "more than 100 digits"),
    _offer("laughs", more(_LAUGHS), "more than 20000 values"),
    _offer("code", more("name: !!python/object/apply:os.system [true]"), "YAML"),
    _offer("tag", more("name: !!timestamp x"), "not valid YAML"),
    _offer("surrogate", more('name: "\\ud800"'), "surrogate"),
    _offer("escape", task(name="a\x1b[2Jverified"), "name: expected printable"),
    _offer("climbs", task(name="../../x"), "name: expected printable .* no /"),
    _offer("long_name", task(name="a" * 201), "at most 200 characters"),
    _offer("many_rays", robot(n_rays=10**9), "robot.n_rays"),
    _offer("large_body", robot(radius=1e300), "robot.radius"),
    _offer("thin_axle", robot(axle=1e-300), "robot.axle"),
    _offer("fast", robot(max_wheel_speed=float("inf")), "not a finite number"),
    _offer("endless_step", task(dt=289155059), "shorter dt or slower wheels"),
    _offer("crawl", robot(max_wheel_speed=1e-9), "a horizon of at most"),
    _offer("far_start", task(start=[1e300, 50]), "start"),
    _offer("far_heading", task(start=[20, 50, 1e300]), "start"),
    _offer("nan_goal", task(goal=[float("nan"), 50]), "not a finite number"),
    _offer("wide_goal", task(tolerance=1e300), "tolerance"),
    _offer("long", task(horizon=10**18), "horizon"),
    _offer("longer", task(horizon=2**70), "more than 64 bits"),
    _offer("short_steps", task(dt=1e-300), "dt"),
    _offer("long_steps", task(dt=1e300), "dt"),
    _offer("no_time", task(progress={"steps": 10**18}), "progress.steps"),
    _offer("map_of_null", task(map="a\0b"), "no such file"),
    _offer("map_name", task(map="a" * 5000), "File name too long"),
    _offer(
        "world_pipe",
        text("task.yaml", "{env: TDAC-EPuck-v0, world: /dev/zero}"),
        "not a regular file",
        True,
    ),
]
