"""Contacts with movers: which one, from where, and for how long it had been seen."""

import math
import re
from itertools import count

import numpy as np
import pytest
from driving import drive

from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.surroundings import surroundings_of
from tdac_envs.drive.task import Pose
from tdac_envs.map2d.env import Map2DEnv

FULL = 75.59
# A post out of the way, so that the others have the number 1.
POST = {"kind": "route", "points": [[20, 100]]}


def room(*movers, start=(60, 60, 0), goal=(250, 60), walls=(), **arguments):
    """A room of 300 x 120 px with single occupied squares of 4 px at (x, y)."""
    cells = np.zeros((120, 300), bool)
    for x, y in walls:
        cells[y - 2 : y + 2, x - 2 : x + 2] = True
    movers = [{"radius": 8.0, **mover} for mover in (POST, *movers)]
    return Map2DEnv(cells, start, goal, robot_radius=8.0, movers=movers, **arguments)


def judged(env, left, right=None):
    """Constant wheel speeds until the end, and the diagnosis."""
    right = left if right is None else right
    rollout = drive(env, lambda _: (left, right))
    assert rollout.outcome == "collision"
    return rollout, diagnose(rollout, env.nominal)


def disc(x, y, heading, speed):
    return {"kind": "bounce", "start": [x, y], "heading": heading, "speed": speed}


BEHIND = disc(15, 60, 0.0, 45)


@pytest.mark.parametrize(
    ("mover", "wheel", "side"),
    [
        (disc(105, 15, math.pi / 2, 45), 0.6, "the left"),
        (disc(105, 105, -math.pi / 2, 45), 0.6, "the right"),
        (disc(200, 60, math.pi, 30), 0.6, "ahead"),
        (disc(100, 60, 0.0, 20), 0.6, "ahead"),
        ({"kind": "route", "points": [[120, 60]]}, 0.6, "ahead"),
    ],
)
def test_where_it_came_from(mover, wheel, side):
    """The side of the robot, also if it stood or was driven into."""
    _, found = judged(room(mover), wheel)
    assert (found.cause, found.thing) == ("collision", "mover 1")
    assert f"of the body touched mover 1, which came from {side} and " in found.text
    assert f"the robot drove at {wheel:g} of its speed." in found.text
    assert "wall" not in found.text


def test_where_it_was_touched():
    """Side of the body and place of the contact, at the edge of both discs."""
    rollout, found = judged(room({"kind": "route", "points": [[120, 66]]}), 0.6)
    assert found.side in ("front", "front right")
    x, y, _ = rollout.trajectory.poses[-1]
    assert math.dist((x, y), found.wall) == pytest.approx(8.0, abs=0.02)
    assert math.dist((120, 66), found.wall) == pytest.approx(8.0, abs=0.02)


def test_how_long_it_was_seen():
    """From when it was in range until the contact."""
    env = room({"kind": "route", "points": [[200, 60]]}, range_max=60.0)
    _, found = judged(env, 0.6)
    seconds = float(re.search(r"in sight for ([\d.]+) s", found.text)[1])
    # From 68 px between the centres to 16 px.
    assert seconds == pytest.approx((68 - 16) / (0.6 * FULL), abs=0.1)


def test_walls_hide_movers():
    """One that a wall hides is not in sight."""
    mover = disc(130, 15, math.pi / 2, 45)
    hidden = room(mover, walls=[(x, 40) for x in range(70, 118, 4)])
    times = []
    for env in (room(mover), hidden):
        _, found = judged(env, 0.8)
        times.append(float(re.search(r"in sight for ([\d.]+) s", found.text)[1]))
    assert times[1] < times[0] - 0.2


def test_a_part_of_a_mover_is_in_sight():
    """Not its centre decides, but whether any of it can be seen."""
    seen = []
    for half in (2, 6, 10):
        walls = [(130, y) for y in range(60 - half, 61 + half, 2)]
        around = surroundings_of(room(walls=walls, range_max=200.0).nominal)
        seen.append(around.in_sight(Pose(60.0, 60.0, 0.0), (200.0, 60.0), 8.0))
        assert not around.in_sight(Pose(60.0, 60.0, 0.0), (200.0, 60.0), 1.0)
        assert not around.in_sight(Pose(60.0, 60.0, 2.0), (200.0, 60.0), 8.0)
    assert seen == [True, False, False]


def test_one_from_behind_is_never_seen():
    """The rays look ahead."""
    _, found = judged(room(BEHIND, start=(130, 60, 0)), 0.2)
    assert found.side == "rear"
    assert "came from behind and was never in sight; the robot drove" in found.text


def test_one_that_was_seen_before():
    """The robot turned away from it: it is told how long ago it was in sight."""
    steps = count()
    env = room(disc(120, 60, math.pi, 20))
    rollout = drive(env, lambda _: (0.3, -0.3) if next(steps) < 22 else (0.0, 0.0))
    found = diagnose(rollout, env.nominal)
    words = r"behind and had been in sight until ([\d.]+) s before; the robot stood"
    seconds = float(re.search(words, found.text)[1])
    # It turns by 2.83 rad/s; the rays cover 55 degrees to each side.
    turned = math.radians(55) / 2.83
    assert seconds == pytest.approx(0.05 * rollout.trajectory.steps - turned, abs=0.1)


def test_a_robot_that_stood():
    """Then nobody asks for its speed."""
    _, found = judged(room(disc(200, 60, math.pi, 40)), 0.0)
    assert "came from ahead and had been in sight for" in found.text
    assert found.text.count("; the robot stood.") == 1


def test_a_wall_among_movers():
    """The nearest mover has nothing to do with it."""
    env = room(disc(200, 20, 0.0, 0.0), start=(60, 60, math.pi))
    _, found = judged(env, 1.0)
    assert found.thing == "border of the map"
    assert "mover" not in found.text
