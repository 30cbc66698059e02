"""Planted failures are named as what they are."""

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from driving import always, judged, pattern

from tdac_agent.environments.map2d.surroundings import nearest_corner, nearest_touch
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.touch import side_of, where_on_the_wall
from tdac_envs.drive.task import Pose
from tdac_envs.map2d.env import Map2DEnv


def room(start=(60, 60, 0), goal=(170, 60), walls=(), radius=8.0, **arguments):
    """An open room of 200 x 120 px with single occupied pixels (x, y)."""
    cells = np.zeros((120, 200), bool)
    for x, y in walls:
        cells[y, x] = True
    return Map2DEnv(cells, start, goal, robot_radius=radius, **arguments)


def first(steps, action, then):
    """One action for some steps, then a policy."""
    count = itertools.count()
    return lambda obs: action if next(count) < steps else then(obs)


@pytest.mark.parametrize(
    ("heading", "wheel", "wall", "side"),
    [
        (0.0, 1.0, (80, 60), "front"),
        (0.0, 1.0, (80, 66), "front right"),
        (0.0, 1.0, (80, 54), "front left"),
        (0.0, 1.0, (80, 68), "right"),
        (0.0, 1.0, (80, 52), "left"),
        (0.0, -1.0, (40, 60), "rear"),
        (0.0, -1.0, (40, 66), "rear right"),
        (0.0, -1.0, (40, 54), "rear left"),
        (math.pi / 2, 1.0, (60, 80), "front"),
        (math.pi / 2, 1.0, (54, 80), "front right"),
        (math.pi, 1.0, (40, 54), "front right"),
        (-math.pi / 2, 0.7, (66, 40), "front right"),
        (-math.pi / 2, 0.7, (54, 40), "front left"),
    ],
)
def test_collision_side(heading, wheel, wall, side):
    """The side is the one a person would name, and the touched pixel is told."""
    env = room((60, 60, heading), walls=[wall])
    rollout, found = judged(env, always(wheel, wheel))
    assert (found.cause, found.side) == ("collision", side)
    assert found.step == rollout.trajectory.steps
    assert math.dist((found.x, found.y), wall) == pytest.approx(8.0, abs=0.8)
    assert f"the {side} of the body" in found.text


def test_collision_with_the_border():
    """Outside the map counts as wall; heading error and saturation are told."""
    _, found = judged(room((60, 60, -math.pi / 2)), always(1, 1))
    assert (found.cause, found.side) == ("collision", "front")
    assert found.y == pytest.approx(7.5, abs=0.1)
    assert found.wall == (60.0, -0.5)
    assert "touched the border of the map" in found.text
    assert re.search(r"the shortest path is 11\d° to the right", found.text)
    assert found.heading_error == pytest.approx(math.radians(115), abs=0.1)
    assert "limit in 100 % of the steps" in found.text


ODDLY = {
    "no motion": [
        always(0, 0),
        always(0.0005, -0.0005),
    ],
    "spinning": [
        always(0.5, -0.5),
        always(-1, 1),
        always(0.3, 0.6),
        first(30, (0.5, 0.5), always(-0.4, 0.4)),
    ],
    "oscillating": [
        pattern((1, 0.4, -0.4), (1, -0.4, 0.4)),
        pattern((6, 0.5, -0.5), (6, -0.5, 0.5)),
        pattern((8, 0.5, 0.5), (8, -0.5, -0.5)),
        first(30, (0.5, 0.5), pattern((3, 0.2, -0.2), (3, -0.2, 0.2))),
    ],
    "stuck": [
        first(40, (0.5, 0.5), always(0, 0)),
        first(15, (1, 1), always(0, 0)),
        first(30, (0.5, 0.5), pattern((60, 0.1, 0.1), (60, -0.1, -0.1))),
    ],
    "too slow": [
        always(0.03, 0.03),
        pattern((9, 0, 0), (1, 0.3, 0.3)),
        pattern((20, 0.05, 0.05), (20, 0.01, 0.01)),
    ],
}


@pytest.mark.parametrize(
    ("cause", "number"),
    [(cause, n) for cause, plants in ODDLY.items() for n in range(len(plants))],
)
def test_out_of_time(cause, number):
    """What kept a robot from arriving in an open room."""
    env = room(horizon=600)
    rollout, found = judged(env, ODDLY[cause][number])
    assert rollout.outcome == "out of time"
    assert found.cause == cause, found.text
    assert found.d0 == pytest.approx(110, abs=1)
    assert found.d_min <= found.d0


def test_zigzag_is_oscillation():
    """Progress by large swings is oscillating, not merely slow."""
    env = room(horizon=400)
    _, found = judged(env, pattern((1, 0.65, -0.55), (1, -0.55, 0.65)))
    assert found.cause == "oscillating", found.text


def test_missed_goal():
    """Passing by at a distance and going on is a missed goal, with its step."""
    env = room(goal=(120, 70), goal_tolerance=3.0, horizon=500)
    _, found = judged(env, first(90, (0.3, 0.3), always(0, 0)))
    assert found.cause == "missed goal", found.text
    assert found.x == pytest.approx(120, abs=4)
    assert found.d_min == pytest.approx(10, abs=1.5)


def test_standing_near_a_wall_says_where_and_what_it_had_reached():
    """What is near is told, and then how near the goal was."""
    env = room((60, 10, 0), walls=[(60, 20)])
    text = judged(env, always(0, 0))[1].text
    near = re.search(r"The nearest \w+ is \d\.\d px from the body, at its \w+\. ", text)
    assert near is not None
    assert "wallHeading" not in text
    assert text[near.end() :].startswith("Heading error")


def test_stuck_says_where_and_since_when():
    """The place and the step at which progress ended."""
    _, found = judged(room(horizon=600), first(15, (1, 1), always(0, 0)))
    assert found.cause == "stuck"
    assert found.step == pytest.approx(15, abs=1)
    assert found.x == pytest.approx(60 + 15 * 3.7795, abs=4)


def test_late_arrival_is_too_slow():
    """An episode that reached the goal can only have been slow."""
    rollout, found = judged(room(), always(0.2, 0.2))
    assert rollout.reached
    assert found.cause == "too slow"


@pytest.mark.parametrize(
    ("cause", "changes"),
    [
        ("error", {"error": "ZeroDivisionError: division by zero"}),
        ("time-out", {"error": "policy() did not end within 5 s", "timed_out": True}),
        ("time-out", {"error": "used up its limit of 120 s of CPU time"}),
        ("contract", {"error": "policy must return two finite numbers, got None"}),
        ("error", {"error": "the nominal episode failed", "outcome": "not run"}),
    ],
)
def test_errors(cause, changes):
    """What the controller did wrong is passed on, sorted by kind."""
    rollout, _ = judged(room(), always(0.2, 0.2), steps=5)
    found = diagnose(replace(rollout, **{"outcome": "error"} | changes), room().nominal)
    assert found.cause == cause
    assert changes["error"] in found.text


def test_held_out_tells_nothing():
    """Of a held-out episode neither figures nor the cause."""
    env = room(walls=[(80, 60)])
    _, found = judged(env, always(1, 1), name="jitter 4", held_out=True)
    assert found.cause == "held out"
    assert found.model_dump(exclude={"cause", "text"}, exclude_none=True) == {}
    assert not any(letter.isdigit() for letter in found.text)


def test_text_is_bounded_and_repeatable():
    """The same episode gives the same words, few enough for a prompt."""
    texts = {judged(room(horizon=600), always(0.3, 0.6))[1].text for _ in range(2)}
    assert len(texts) == 1
    assert len(texts.pop()) < 700


@pytest.mark.parametrize(
    ("degrees", "side"),
    [
        (0, "front"),
        (22, "front"),
        (23, "front right"),
        (90, "right"),
        (112, "right"),
        (113, "rear right"),
        (180, "rear"),
        (-180, "rear"),
        (-90, "left"),
        (-23, "front left"),
        (-158, "rear"),
        (-157, "rear left"),
    ],
)
def test_sides(degrees, side):
    """Eight sides of 45° each; positive is clockwise on the screen, to the right."""
    assert side_of(math.radians(degrees)) == side


@pytest.mark.parametrize(
    ("at", "corner"),
    [
        ((50, 42), (49.5, 39.5)),
        ((69, 59), (69.5, 59.5)),
        ((60, 40), None),
        ((103, 90), (99.5, 89.5)),
        ((148, 91), (149.5, 91.5)),
        ((125, 90), None),
        ((175, 42), None),
        ((189.5, 40), None),
    ],
)
def test_corners(at, corner):
    """Outer corners of walls and the ends of thin ones; no inner corner, no post."""
    cells = np.zeros((120, 200), bool)
    cells[40:60, 50:70] = True
    cells[90:92, 100:150] = True
    cells[20:60, 160:200] = True
    cells[24:56, 164:196] = False
    rows, columns = np.ogrid[:120, :200]
    cells |= (columns - 180) ** 2 + (rows - 40) ** 2 < 9.5**2
    env = Map2DEnv(cells, (20, 20), (20, 100), robot_radius=8)
    assert nearest_corner(env.nominal, at, 8.0) == corner


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (Pose(55.0, 31.5, 0.0), "5.5 px past the corner at (49.5, 39.5)"),
        (Pose(55.0, 31.5, math.pi), "5.5 px before the corner at (49.5, 39.5)"),
        (Pose(41.5, 45.0, 0.0), "5.5 px beside the corner at (49.5, 39.5)"),
        (Pose(44.0, 33.7, 0.5), "at the corner at (49.5, 39.5)"),
        (Pose(60.0, 31.5, 0.0), ""),
    ],
)
def test_where_on_the_wall(pose, words):
    """Past and before are meant along the motion, whatever side the wall is on."""
    cells = np.zeros((120, 200), bool)
    cells[40:60, 50:71] = True
    env = Map2DEnv(cells, (20, 20), (20, 100), robot_radius=8)
    touch = nearest_touch(env.nominal, pose, 12.0)
    assert touch.gap == pytest.approx(0.0, abs=0.1)
    assert where_on_the_wall(touch, pose.heading) == words


def test_nothing_within_reach():
    """Far from all walls there is nothing to touch."""
    task = room().nominal
    assert nearest_touch(task, Pose(100.0, 60.0, 0.0), 20.0) is None
    assert nearest_touch(task, Pose(100.0, 10.0, 0.0), 20.0).border


def test_turning_away_from_the_path_is_told():
    """A robot that turns to the wrong side is told to check the sign of its turn."""
    start = (60, 60, 0.6)
    _, wrong = judged(room(start), always(0.25, 0.2))
    assert "check the sign of the turn" in wrong.text
    _, right = judged(room(start, horizon=60), always(0.2, 0.25))
    assert "sign of the turn" not in right.text
