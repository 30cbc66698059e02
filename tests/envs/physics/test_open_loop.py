"""Promises of the body in MuJoCo without obstacles: it drives the exact arc."""

import math

import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.physics.body import BodySpec, disc_body, e_puck_body
from tdac_envs.physics.engine import MujocoBody
from tdac_envs.physics.moved import arc_between, rim_speeds
from tdac_envs.physics.scene import Scene
from tdac_envs.worlds.world import AXLE_LENGTH, MAX_WHEEL_SPEED, ROBOT_MASS

pytest.importorskip("mujoco")
DT = 0.032
PROGRAMMES = {
    "straight": ([(1.0, 1.0, 1.0)], 3.0, 0.1),
    "back": ([(-1.0, -1.0, 1.0)], 3.0, 0.1),
    "spin": ([(-1.0, 1.0, 1.0)], 0.1, 3.0),
    "wide arc": ([(1.0, 0.5, 5.0)], 6.0, 3.0),
    "narrow arc": ([(0.3, 1.0, 5.0)], 6.0, 3.0),
    "start and stop": ([(1.0, 1.0, 0.5), (0.0, 0.0, 0.5)] * 10, 3.0, 0.1),
}
"""Fractions of the full speed and seconds; largest errors, mm and degrees."""


def exact(programme, speed, axle):
    """The end of the exact arcs: x, y (m), unwrapped heading (rad)."""
    x = y = heading = 0.0
    for left, right, seconds in programme:
        time = round(seconds / DT) * DT
        turn = (right - left) * speed * time / axle
        forward, half = (left + right) / 2 * speed * time, turn / 2
        chord = forward * (math.sin(half) / half if half else 1.0)
        x += chord * math.cos(heading + half)
        y += chord * math.sin(heading + half)
        heading += turn
    return x, y, heading


def errors(body, programme, speed, axle=AXLE_LENGTH):
    """Distance (mm) and angle (degrees) between MuJoCo's end and the exact one."""
    robot, heading, last = MujocoBody(Scene(()), body), 0.0, 0.0
    for left, right, seconds in programme:
        for _ in range(round(seconds / DT)):
            moved = robot.step(left * speed, right * speed, DT)
            assert not moved.touched
            heading += math.remainder(moved.pose[2] - last, math.tau)
            last = moved.pose[2]
    x, y, wanted = exact(programme, speed, axle)
    off = math.dist(moved.pose[:2], (x, y))
    return 1e3 * off, abs(math.degrees(heading - wanted))


@pytest.mark.slow_after(4)
@pytest.mark.parametrize("version", ["1", "2"])
@pytest.mark.parametrize("name", PROGRAMMES)
def test_an_e_puck_drives_the_exact_arc(name, version):
    programme, most_mm, most_degrees = PROGRAMMES[name]
    body = e_puck_body(ROBOT_MASS[version], AXLE_LENGTH)
    off, turned = errors(body, programme, MAX_WHEEL_SPEED[version] * 0.02)
    assert off <= most_mm
    assert turned <= most_degrees


def test_a_wrong_axle_is_seen():
    """The distance of the joints, 52 mm, is not the effective axle: the turn tells."""
    wrong = e_puck_body(0.16, 0.052)
    programme, _, most_degrees = PROGRAMMES["spin"]
    _, turned = errors(wrong, programme, 0.1256)
    assert turned > 5 * most_degrees


def test_a_weak_motor_is_late():
    programme, most_mm, _ = PROGRAMMES["straight"]
    weak = e_puck_body(0.16, AXLE_LENGTH).changed(torque=0.0008)
    off, _ = errors(weak, programme, 0.1256)
    assert off > 3 * most_mm


def test_a_smooth_floor_makes_the_start_late():
    programme, most_mm, _ = PROGRAMMES["straight"]
    ice = e_puck_body(0.16, AXLE_LENGTH).changed(grip=0.05)
    off, _ = errors(ice, programme, 0.1256)
    assert off > 3 * most_mm


def test_a_larger_robot_with_slower_starts_drives_the_arc_to_one_percent():
    """A disc of 0.25 m at 0.5 m/s: what it loses at the start is v² / 2 g and more."""
    body, speed = disc_body(0.25, 0.4), 0.5
    off, turned = errors(body, [(1.0, 0.8, 5.0)], speed, 0.4)
    assert 1e-3 * off <= 0.03 * speed * 5
    assert turned <= 4.0


def test_a_robot_at_rest_stays():
    robot = MujocoBody(Scene(()), e_puck_body(0.16, AXLE_LENGTH))
    robot.reset((0.3, -0.2, 2.0))
    for _ in range(60):
        moved = robot.step(0.0, 0.0, DT)
    assert math.dist(moved.pose[:2], (0.3, -0.2)) < 1e-6
    assert moved.pose[2] == pytest.approx(2.0, abs=1e-6)
    assert robot.tilt() < 1e-4


def test_wheels_turn_as_commanded():
    robot = MujocoBody(Scene(()), e_puck_body(0.16, AXLE_LENGTH))
    turned = [robot.step(0.1, -0.05, DT).turned for _ in range(100)]
    total = [sum(side) for side in zip(*turned, strict=True)]
    wanted = 100 * DT * 0.1 / 0.02, -100 * DT * 0.05 / 0.02
    assert total == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize(
    ("forward", "turn"), [(0.1, 0.0), (0.1, 0.4), (-0.03, 1.2), (0.0, -0.7)]
)
def test_an_arc_has_the_speeds_that_drive_it(forward, turn):
    """And an arc is found again between its ends."""
    left, right = rim_speeds(forward, turn, 0.057, 0.032)
    assert (left + right) / 2 * 0.032 == pytest.approx(forward)
    assert (right - left) * 0.032 / 0.057 == pytest.approx(turn)
    half = turn / 2
    chord = forward * (math.sin(half) / half if half else 1.0)
    begin = 1.0, 2.0, 3.0
    end = (
        1.0 + chord * math.cos(3.0 + half),
        2.0 + chord * math.sin(3.0 + half),
        3.0 + turn,
    )
    assert arc_between(begin, end) == pytest.approx((forward, turn), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"mass": -1.0}, "mass above 0"),
        ({"mass": 0.009}, "mass above that of two wheels"),
        ({"torque": 0.0}, "torque above 0"),
        ({"grip": -0.1}, "grip"),
        ({"top": 0.001}, "top above bottom"),
        ({"axle_length": math.nan}, "axle_length to be a finite number"),
    ],
)
def test_an_impossible_body_is_refused_in_one_line(change, problem):
    with pytest.raises(TaskError, match=f"^body: .*{problem}|{problem}") as refused:
        e_puck_body(0.16, AXLE_LENGTH).changed(**change)
    assert "\n" not in str(refused.value)


def test_the_motor_is_as_strong_as_the_tyres_hold():
    body = BodySpec(0.1, 0.01, 0.2, 2.0, 0.05, 0.04, 0.1, 0.2)
    assert body.most_torque == pytest.approx(2.0 * 9.81 * 0.04 / 2)
    assert body.changed(torque=0.3).most_torque == 0.3
