"""Controllers in common styles run as they are, and do what they should."""

import json
import math

import pytest
from worlds_for_controllers import BLOCKED, LINE, NO_GOAL, OPEN, PLAIN

from tdac_envs.worlds.world import AXLE_LENGTH


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    "name",
    [
        "deprecated_getters",
        "supervisor_position",
        "robot_class",
        "gps_compass",
        "module_loop",
        "bug",
    ],
)
def test_reaches_the_goal(drive, name):
    """It gets to the goal of an open world without a contact."""
    report = drive(name, OPEN, steps=1500).report
    assert report.error is None, report.error
    assert report.passed, report
    assert report.outcome == "reached"
    assert report.d_min_euclidean <= 0.02
    assert report.collisions == 0


@pytest.mark.slow
def test_bug_goes_around_a_box(drive):
    """Where the straight way is blocked, a bug algorithm gets there all the same."""
    report = drive("bug", BLOCKED, steps=2500).report
    assert report.passed, report
    assert report.way > 0.85


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["deprecated_getters", "gps_compass"])
def test_straight_on_into_a_box(drive, name):
    """The same box is hit by controllers that do not look: counted, not passed."""
    report = drive(name, BLOCKED, steps=400).report
    assert not report.passed
    assert report.collisions > 0
    step, x, _ = report.first_contact
    assert 60 < step < 300
    assert -0.14 < x < -0.03


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["braitenberg", "wall_follower"])
def test_keeps_off_walls(drive, name):
    """Without a goal a run passes that drives on and touches nothing."""
    report = drive(name, NO_GOAL, steps=1200).report
    assert report.passed, report
    assert report.goal is None
    assert report.d_min is None
    assert report.way > 1.0


@pytest.mark.slow
def test_line_follower(drive):
    """Three ground sensors keep it on a dark line."""
    run = drive("line_follower", LINE, steps=560, webots_sensors=True)
    assert run.report.passed, run.report
    assert run.report.end[0] > 0.3
    off = [-math.sin(0.2) * x + math.cos(0.2) * y for x, y, _ in run.log.poses[200:]]
    assert max(map(abs, off)) < 0.012


def test_position_control_ends_where_it_should(drive):
    """A quarter turn, there and back by wheel angles: within encoder steps."""
    report = drive("position_control", OPEN).report
    assert report.outcome == "controller ended"
    assert report.error is None
    x, y, heading = report.end
    assert math.dist((x, y), (-0.4, 0.0)) < 3e-4
    assert abs(heading - math.pi / 2) < 0.01
    assert "done after True" in report.output


def test_odometry_agrees_with_the_judge(drive):
    """What it prints from its encoders is where it is, within half a millimetre."""
    run = drive("odometry", OPEN, steps=300)
    lines = [json.loads(line) for line in run.report.output[:3500].splitlines()[:-1]]
    assert len(lines) > 20
    for step, line in enumerate(lines, start=1):
        assert line["t"] == pytest.approx(0.032 * step, abs=1e-3)
        x, y, heading = run.log.poses[step]
        assert math.dist(line["pose"][:2], (x, y)) < 5e-4
        assert abs(math.remainder(line["pose"][2] - heading, 2 * math.pi)) < 0.01


def test_main_style_with_a_second_robot(drive):
    """Its main returns, a second Robot complains and still steps."""
    report = drive("main_style", OPEN, steps=400).report
    assert report.outcome == "controller ended"
    assert "{'steps': 120, 'time': 3.872}" in report.output
    assert "only one Robot instance" in report.output
    assert "32.0 0" in report.output


def test_blinking(drive):
    """Ten LEDs, a step of 100 ms that is four of 32, a circle of the right radius."""
    run = drive("led_blink", OPEN, steps=400)
    assert run.report.outcome == "out of time"
    assert run.report.output.splitlines()[-1] == "0010000000 99"
    assert "is not a multiple of WorldInfo.basicTimeStep" in run.report.output
    # 1.5 rad/s of the wheels ahead, 1 rad/s of difference.
    radius = 1.5 * AXLE_LENGTH
    for x, y, _ in run.log.poses:
        assert math.dist((x, y), (-0.4, radius)) == pytest.approx(radius, abs=1e-6)


def test_nobody_at_the_keyboard(drive):
    """No key is pressed: said once; it stands still and always sees the same."""
    report = drive("keyboard", PLAIN, steps=50).report
    assert "keys [-1] images 1" in report.output
    assert report.output.count("there is no keyboard") == 1
    assert report.way == 0.0
