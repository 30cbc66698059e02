"""Driving faults that are planted on purpose, and what a diagnosis must say of each.

`python tests/agent/planted.py` prints what was planted, what was expected, and what it
was named; with `--texts` the paragraphs, too.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from driving import drive
from faulty import (
    Fault,
    always,
    brake,
    ease,
    follower,
    hug,
    orbit,
    patrol,
    repeat,
    seeded_twitch,
    seldom,
    shuttle,
    swapped,
    switch,
)
from rich.console import Console
from rich.table import Table

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.report import Cause, Diagnosis
from tdac_agent.verification.suite.starts import spread_starts
from tdac_envs.drive.task import Pose
from tdac_envs.map2d.env import Map2DEnv


@dataclass(frozen=True)
class Plant:
    """A fault and what it must be called.

    Attributes:
        fault: What was planted.
        map: Bundled map, or `room` for an empty one of 300 x 200 px.
        policy: Makes the faulty policy for a task.
        cause: What the diagnosis must name.
        jitter: Number of the jittered start; 0 for the nominal one.
        env: Further arguments of the environment.
        side: Of the body, for a collision.
        at: Where the robot was, x, y and how exact, px.
        step: When, and how exact.
        corner: Where the nearest corner is, x, y and how exact, px.
        error: Heading error and how exact, degrees, right positive.
        says: What the paragraph must hold.
    """

    fault: str
    map: str
    policy: Fault
    cause: Cause
    jitter: int = 0
    env: dict[str, Any] = field(default_factory=dict)
    side: str | tuple[str, ...] | None = None
    at: tuple[float, float, float] | None = None
    step: tuple[int, int] | None = None
    corner: tuple[float, float, float] | None = None
    error: tuple[float, float] | None = None
    says: tuple[str, ...] = ()


def room_cells() -> np.ndarray:
    """An empty room of 300 x 200 px behind walls of one pixel."""
    cells = np.zeros((200, 300), bool)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = True
    return cells


def thin_wall_cells() -> np.ndarray:
    """The room with a wall of two pixels at x = 200, open at its lower end."""
    cells = room_cells()
    cells[:150, 200:202] = True
    return cells


MAPS = {"room": room_cells, "thin wall": thin_wall_cells}


def fail(plant: Plant) -> tuple[Map2DEnv, Rollout]:
    """Drives the faulty policy in the real environment."""
    made = MAPS.get(plant.map)
    env = Map2DEnv(made() if made else plant.map, **plant.env)
    start = env.nominal.start
    if plant.jitter:
        start = spread_starts(env.nominal, 0, 5)[plant.jitter - 1]
    name = f"jitter {plant.jitter}" if plant.jitter else "nominal"
    act = plant.policy(env.nominal.moved(Pose(*start)))
    return env, drive(env, act, start=start, name=name)


COLLISIONS = (
    Plant(
        "drives straight on",
        "office",
        always(1, 1),
        "collision",
        side="front",
        at=(578.5, 100.0, 0.1),
        step=(21, 0),
        error=(152.0, 15.0),
    ),
    Plant(
        "reverses for ever",
        "office",
        always(-0.5, -0.5),
        "collision",
        side="rear",
        at=(421.5, 100.0, 0.1),
        step=(42, 0),
        says=("No ray points there: it is 180°",),
    ),
    Plant(
        "drifts to the left",
        "warehouse",
        always(0.98, 1.0),
        "collision",
        side="left",
        at=(745.0, 206.5, 0.3),
        step=(50, 0),
    ),
    Plant(
        "drifts to the right",
        "warehouse",
        always(1.0, 0.98),
        "collision",
        side="right",
        at=(745.0, 235.5, 0.3),
        step=(50, 0),
    ),
    Plant(
        "drives in an arc",
        "rooms",
        always(1.0, 0.6),
        "collision",
        side="front left",
        at=(181.3, 503.5, 0.5),
        step=(48, 0),
    ),
    Plant(
        "reverses at once",
        "maze",
        always(-1, -1),
        "collision",
        side="rear",
        at=(173.0, 305.0, 3.0),
        step=(5, 1),
    ),
    Plant(
        "reverses after a while",
        "office",
        switch(15, always(1, 1), always(-1, -1)),
        "collision",
        side="rear",
        at=(421.5, 100.0, 0.1),
        step=(51, 0),
    ),
    Plant(
        "leaves the map",
        "spiral",
        always(1, 1),
        "collision",
        env={"start": (60, 60, -math.pi / 2)},
        side="front",
        at=(60.0, 9.5, 0.1),
        step=(14, 0),
        says=("border of the map",),
    ),
    Plant(
        "plans for a point",
        "office",
        follower(margin=-11.0),
        "collision",
        side=("front", "front right"),
        corner=(436.5, 160.5, 2.0),
        says=("the corner at",),
    ),
    Plant(
        "plans for a body 5 px too small",
        "maze",
        follower(margin=-5.0, lookahead=25.0),
        "collision",
        side=("right", "front right"),
        corner=(207.0, 249.0, 5.0),
        says=("the corner at",),
    ),
    Plant(
        "looks too far ahead",
        "clutter",
        follower(margin=1.0, lookahead=45.0),
        "collision",
        jitter=1,
        side=("left", "front left", "front"),
        corner=(243.0, 447.0, 6.0),
        says=("the corner at",),
    ),
    Plant(
        "wheels swapped, never slows down",
        "rooms",
        follower(wheels=swapped, pivot=9.0),
        "collision",
    ),
    Plant(
        "wheels swapped, slow",
        "spiral",
        follower(wheels=swapped, pivot=9.0, speed=0.3, gain=1.0),
        "collision",
        says=("check the sign of the turn",),
    ),
    Plant(
        "heading counted upwards",
        "cave",
        follower(heading=lambda heading: -heading, pivot=9.0),
        "collision",
        jitter=2,
    ),
    Plant(
        "brakes 10 px from a wall, measured from its centre",
        "office",
        brake(10.0),
        "collision",
        side="front",
        at=(578.5, 100.0, 0.1),
        step=(35, 0),
    ),
    Plant(
        "heads straight for the goal",
        "light_on_dark",
        patrol((610.0, 265.0)),
        "collision",
        jitter=1,
        side="front",
        at=(774.5, 264.0, 8.0),
    ),
    Plant(
        "heads straight for the goal, thin walls",
        "thin_walls",
        patrol((350.0, 350.0)),
        "collision",
        jitter=2,
        side=("front", "front left", "front right"),
    ),
    Plant(
        "does not see that it passes the goal",
        "rooms",
        always(0.5, 0.5),
        "collision",
        env={"start": (300, 428, 0.0)},
        side="front",
        at=(503.5, 428.0, 0.1),
        step=(108, 0),
        says=("passed the goal",),
    ),
)

STANDING = (
    Plant("returns zeros", "maze", always(0, 0), "no motion", at=(173.0, 289.0, 0.1)),
    Plant(
        "fractions taken for px/s",
        "clutter",
        always(1e-5, -1e-5),
        "no motion",
        jitter=1,
    ),
    Plant(
        "gives up after 120 steps",
        "office",
        switch(120, follower(), always(0, 0)),
        "stuck",
        step=(120, 1),
    ),
    Plant(
        "gives up after 200 steps",
        "spiral",
        switch(200, follower(), always(0, 0)),
        "stuck",
        jitter=1,
        step=(200, 1),
    ),
    Plant(
        "stops before a wall and has no way on",
        "office",
        brake(30.0),
        "stuck",
        at=(561.0, 100.0, 2.5),
        step=(27, 1),
        says=("at its front",),
    ),
    Plant(
        "slows down before a wall that is in the way",
        "clutter",
        ease(30.0),
        "stuck",
        at=(381.5, 350.0, 3.0),
        says=("at its front",),
    ),
    Plant(
        "trembles on the spot",
        "cave",
        switch(100, follower(), seeded_twitch),
        "stuck",
        step=(100, 2),
    ),
    Plant(
        "plan ends too early",
        "rooms",
        follower(goal=(560.0, 200.0)),
        "stuck",
        at=(560.0, 200.0, 4.0),
    ),
    Plant(
        "x and y of the goal swapped",
        "office",
        follower(goal=(370.0, 500.0)),
        "wrong goal",
        at=(370.0, 500.0, 4.0),
        says=("x and y swapped",),
    ),
    Plant(
        "y of the goal counted from below",
        "maze",
        follower(goal=(245.0, 144.0)),
        "wrong goal",
        jitter=2,
        at=(245.0, 144.0, 4.0),
        says=("from the lower side",),
    ),
    Plant(
        "x of the goal counted from the right",
        "light_on_dark",
        follower(goal=(389.0, 265.0)),
        "wrong goal",
        at=(389.0, 265.0, 4.0),
        says=("from the right side",),
    ),
    Plant(
        "stops 35 px before the goal",
        "warehouse",
        follower(stop=35.0),
        "missed goal",
        says=("it stood still from step",),
    ),
    Plant(
        "stops 40 px beside the goal",
        "rooms",
        follower(goal=(400.0, 440.0)),
        "missed goal",
        jitter=1,
        at=(400.0, 440.0, 4.0),
        says=("it stood still from step",),
    ),
    Plant(
        "stands behind the wall at the goal",
        "thin wall",
        follower(goal=(192.0, 60.0)),
        "missed goal",
        env={"start": (100, 100, 0.0), "goal": (209, 60), "robot_radius": 6},
        says=("a wall is in between",),
    ),
)

DRIVING = (
    Plant(
        "circles the goal",
        "rooms",
        orbit(42.0),
        "missed goal",
        jitter=2,
        says=("it circled the goal",),
    ),
    Plant(
        "passes the goal and drives on",
        "rooms",
        switch(300, follower(goal=(400.0, 445.0)), follower(goal=(620.0, 400.0))),
        "missed goal",
        says=("passed by",),
    ),
    Plant(
        "two headings in turn",
        "cave",
        repeat((3, 0.6, -0.6), (3, -0.6, 0.6)),
        "oscillating",
        at=(370.0, 180.0, 1.0),
        says=("every 3.0 steps",),
    ),
    Plant(
        "backs off a wall and drives on",
        "office",
        brake(45.0, back=-0.6),
        "oscillating",
        says=("driving direction every 1.0 steps", "at its front"),
    ),
    Plant(
        "a little forward, a little back",
        "thin_walls",
        switch(48, follower(), repeat((1, 0.1, 0.1), (1, -0.1, -0.1))),
        "oscillating",
        jitter=3,
        step=(48, 2),
    ),
    Plant(
        "looks about, slowly",
        "rooms",
        switch(100, follower(), repeat((25, 0.5, -0.5), (25, -0.5, 0.5))),
        "oscillating",
        jitter=2,
        step=(100, 3),
    ),
    Plant(
        "to and fro on planned ways",
        "street",
        shuttle((432.0, 595.0), (288.0, 480.0)),
        "oscillating",
        jitter=2,
        says=("back and forth",),
    ),
    Plant(
        "to and fro between two places",
        "warehouse",
        patrol((700.0, 221.0), (450.0, 221.0)),
        "oscillating",
        says=("back and forth",),
    ),
    Plant(
        "to and fro, backwards",
        "room",
        repeat((40, 0.9, 0.9), (40, -0.9, -0.9)),
        "oscillating",
        env={"start": (60, 100, 0.0), "goal": (250, 170), "robot_radius": 8},
        says=("back and forth",),
    ),
    Plant(
        "wheels swapped, turns in place",
        "clutter",
        follower(wheels=swapped),
        "oscillating",
        jitter=1,
        says=("every 1.0 steps",),
    ),
    Plant(
        "spins at once",
        "maze",
        always(0.5, -0.5),
        "spinning",
        at=(173.0, 289.0, 1.0),
        says=("to the right in place",),
    ),
    Plant(
        "never reads its heading again",
        "maze",
        follower(heading=lambda heading: -math.pi / 2),
        "spinning",
        jitter=1,
        says=("to the right in place",),
    ),
    Plant(
        "heading converted to radians twice",
        "maze",
        follower(heading=math.radians),
        "spinning",
        says=("to the left in place",),
    ),
    Plant(
        "drives small circles",
        "rooms",
        always(0.3, 0.6),
        "spinning",
        says=("to the left on a circle of radius 45 px",),
    ),
    Plant(
        "one wheel stands",
        "rooms",
        switch(20, follower(), always(0.0, 0.05)),
        "spinning",
        jitter=1,
        says=("to the left on a circle of radius 15 px",),
    ),
    Plant(
        "spins slowly",
        "street",
        switch(60, follower(), always(-0.06, 0.06)),
        "spinning",
        step=(60, 2),
        says=("to the left in place",),
    ),
    Plant("a twentieth of the speed", "maze", follower(speed=0.05), "too slow"),
    Plant("a tenth of the speed", "cave", follower(speed=0.1), "too slow", jitter=2),
    Plant(
        "half the speed in too little time",
        "office",
        follower(speed=0.5),
        "too slow",
        env={"horizon": 300},
        says=("px/s was needed",),
    ),
    Plant(
        "moves in one step of eight",
        "maze",
        seldom(8, follower()),
        "too slow",
        jitter=1,
        says=("stood still in 87 % of the steps",),
    ),
    Plant(
        "rounds in the first room",
        "rooms",
        patrol((90.0, 330.0), (230.0, 330.0), (230.0, 460.0), (90.0, 460.0)),
        "looping",
        jitter=1,
        says=("in loops",),
    ),
    Plant(
        "rounds about the block",
        "office",
        switch(
            40,
            patrol((458.0, 130.0), (458.0, 197.0)),
            patrol((770.0, 197.0), (770.0, 500.0), (225.0, 500.0), (225.0, 197.0)),
        ),
        "looping",
        says=("in loops",),
    ),
    Plant(
        "follows the wall on its left",
        "street",
        hug(24.0, -1.0, speed=0.6),
        "looping",
        jitter=1,
        says=("in loops",),
    ),
    Plant(
        "follows the walls of a dead end and of what is beyond it",
        "warehouse",
        hug(24.0, -1.0, speed=0.7),
        "looping",
        env={"horizon": 6000},
        says=("in loops",),
    ),
    Plant(
        "follows the wall on its right",
        "clutter",
        hug(26.0, 1.0),
        "looping",
        says=("in loops",),
    ),
)
PLANTS = (*COLLISIONS, *STANDING, *DRIVING)


def wrong_facts(plant: Plant, found: Diagnosis) -> list[str]:
    """What a diagnosis should have said, and did not."""
    sides = (plant.side,) if isinstance(plant.side, str) else plant.side
    wrong = [] if found.cause == plant.cause else [f"cause {found.cause}"]
    if sides is not None and found.side not in sides:
        wrong.append(f"side {found.side}")
    if (
        plant.at is not None
        and math.dist((found.x, found.y), plant.at[:2]) > (plant.at[2])
    ):
        wrong.append(f"at ({found.x}, {found.y})")
    if plant.step is not None and abs(found.step - plant.step[0]) > plant.step[1]:
        wrong.append(f"step {found.step}")
    if plant.corner is not None and (
        found.corner is None
        or math.dist(found.corner, plant.corner[:2]) > plant.corner[2]
    ):
        wrong.append(f"corner {found.corner}")
    if plant.error is not None:
        error = math.degrees(found.heading_error)
        if abs(math.remainder(error - plant.error[0], 360.0)) > plant.error[1]:
            wrong.append(f"heading error {error:.0f}")
    return wrong + [f"not {text!r}" for text in plant.says if text not in found.text]


def show(texts: bool) -> None:
    """Prints the table, and the paragraphs if they are wanted."""
    console = Console(width=150)
    table = Table("planted", "map", "start", "expected", "named", "wrong")
    right = 0
    for plant in PLANTS:
        env, rollout = fail(plant)
        found = diagnose(rollout, env.nominal)
        right += found.cause == plant.cause
        wrong = ", ".join(wrong_facts(plant, found))
        row = (plant.fault, plant.map, rollout.name, plant.cause, found.cause, wrong)
        table.add_row(*row)
        if texts:
            console.print(f"{plant.fault} ({plant.map})\n{found.text}\n", markup=False)
    console.print(table)
    console.print(f"{right} of {len(PLANTS)} named right")


if __name__ == "__main__":
    show("--texts" in sys.argv[1:])
