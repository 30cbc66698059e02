"""Planted failures are named as what they are."""

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from driving import drive

from tdac_agent.diagnosis import diagnose, side_of
from tdac_envs.map2d import Map2DEnv
from tdac_envs.task2d import Pose


def room(start=(60, 60, 0), goal=(170, 60), walls=(), radius=8.0, **arguments):
    """An open room of 200 x 120 px with single occupied pixels (x, y)."""
    cells = np.zeros((120, 200), bool)
    for x, y in walls:
        cells[y, x] = True
    return Map2DEnv(cells, start, goal, robot_radius=radius, **arguments)


def always(left, right):
    return lambda obs: (left, right)


def pattern(*actions):
    """Repeats (steps, left, right) blocks."""
    once = itertools.chain.from_iterable([a[1:]] * a[0] for a in actions)
    blocks = itertools.cycle(list(once))
    return lambda obs: next(blocks)


def first(steps, action, then):
    """One action for some steps, then a policy."""
    count = itertools.count()
    return lambda obs: action if next(count) < steps else then(obs)


def judged(env, policy, steps=None, **arguments):
    rollout = drive(env, policy, steps=steps, **arguments)
    return rollout, diagnose(rollout, env.nominal)


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
    assert re.search(r"path lay (1\.9|2\.0)\d rad to the right", found.text)
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
        ("time-out", {"error": "used 120 s of CPU time, all it may"}),
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
    assert len(texts.pop()) < 900


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5, math.pi])
def test_sides_turn_with_the_robot(heading):
    """Right is clockwise of the heading on the screen, as y points down."""
    pose = Pose(10.0, 20.0, heading)
    x, y = 10 - 5 * math.sin(heading), 20 + 5 * math.cos(heading)
    assert side_of(pose, x, y) == "right"
    assert side_of(pose, 20 - x, 40 - y) == "left"
