"""The core never moves a robot on late, impossible or missing data."""

import dataclasses
import hashlib
import math
import sys
from types import ModuleType

import numpy as np
import pytest
from floor_task import Ready, drive, forward, see
from hypothesis import given
from hypothesis import strategies as st

from tdac_agent.ros2.export import core_settings
from tdac_agent.ros2.package.core import Command, Core, SettingsError
from tdac_agent.ros2.package.motion import (
    Driven,
    Wheels,
    check_pose_parameters,
    compose,
    other_map,
    wrapped,
    yaw_of,
)
from tdac_agent.ros2.package.scans import Guard, Layout, LayoutError, Scanner, mounted
from tdac_agent.ros2.package.worker import Worker
from tdac_agent.ros2.robot import Robot

ANGLES = st.floats(-10, 10)
PLACES = st.floats(-100, 100)


def test_drives_as_verified(package, settings, robot, steps, here):
    """The exported controller needs as many commands as the verified episode has."""
    # What another controller of this process has imported is not this one's.
    sys.modules["sensors"] = ModuleType("sensors")
    worker = Worker(package / "controller", settings["controller_sha256"])
    core = Core(core_settings(settings, dead_man=0.3), worker)
    # On a busy machine the first plan may take some periods more.
    last = drive(core, robot, 0.1 * (steps + 50), wait=60.0)[-1]
    assert robot.reached, last
    assert not robot.contact
    assert core.commands == steps
    see(core, robot, robot.time)
    last = core.tick(robot.time, 1.0)
    assert (last.v, last.omega, last.state) == (0.0, 0.0, "reached")


def test_no_motion_before_the_first_plan(make_core, robot):
    """Until the first answer is there, every command is zero."""
    core = make_core()
    core._policy.waits = True
    commands = drive(core, robot, 1.0)
    assert {(c.v, c.omega, c.state) for c in commands} == {(0.0, 0.0, "planning")}
    core._policy.waits = False
    assert drive(core, robot, 0.1)[0].state == "driving"


@pytest.mark.parametrize("missing", ["scan", "pose"])
def test_stands_when_data_are_old(make_core, robot, missing):
    """Without a scan or a pose, it stands within the stated distance."""
    core = make_core()
    drive(core, robot, 0.5)
    before = robot.way
    drive(core, robot, 1.0, lambda *a: see(*a, **{missing: False}))
    assert robot.stands
    assert (
        robot.way - before
        <= core.settings.stops_within()["a scan or a pose is late, lost or old"]
    )
    last = core.tick(robot.time, 0.0)
    assert last.state == "stopped"
    assert missing in last.reason
    assert drive(core, robot, 0.2)[-1].state == "driving"


def test_stands_when_the_controller_is_late(make_core, robot):
    """A late answer stops the robot; it drives on with the next one, not with it."""
    core = make_core()
    drive(core, robot, 0.5)
    core._policy.waits = True
    before = robot.way
    commands = drive(core, robot, 0.5)
    assert {(c.v, c.reason) for c in commands} == {(0.0, "the controller is late")}
    assert (
        robot.way - before
        <= core.settings.stops_within()[
            "the controller is late, raises or is not finite"
        ]
    )
    asked = len(core._policy.observations)
    core._policy.waits = False
    assert drive(core, robot, 0.1)[0].state == "driving"
    assert len(core._policy.observations) == asked + 1


@pytest.mark.parametrize("why", ["raises", "nan", "inf", "three", "exits"])
def test_ends_when_the_controller_fails(tmp_path, settings, robot, why, here):
    """What raises or answers no two finite numbers ends the drive for good."""
    returns = {
        "raises": "1 / 0",
        "nan": "(float('nan'), 0.0)",
        "inf": "(1.0, float('inf'))",
        "three": "(1, 1, 1)",
        "exits": "exit(3)",
    }
    file = tmp_path / "controller.py"
    file.write_text(f"def policy(obs):\n    return {returns[why]}\n")
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    own = core_settings(settings, dead_man=0.3)
    core = Core(own, Worker(tmp_path, sha256))
    commands = drive(core, robot, 0.5, wait=10.0)
    assert {(c.v, c.omega) for c in commands} == {(0.0, 0.0)}
    assert commands[-1].state == "failed"
    assert "the controller failed" in commands[-1].reason
    assert robot.way == 0.0


def test_a_changed_controller_is_refused(tmp_path):
    """The hash of the exported file decides, before anything runs."""
    (tmp_path / "controller.py").write_text("raise SystemExit\n")
    with pytest.raises(ValueError, match="is not the exported file"):
        Worker(tmp_path, "0" * 64)


def test_stops_before_what_is_ahead(make_core, robot):
    """Full speed towards a wall ends without a contact, near the wall."""
    core = make_core(any_start=True)
    drive(core, robot, 20.0)
    assert not robot.contact
    assert robot.stands
    assert "something is ahead" in core.tick(robot.time, 0.0).reason
    ahead = min(r for r in (*robot.read().ranges[:8], *robot.read().ranges[-7:]))
    assert ahead < 0.1 + 0.045 + 0.03 + 0.03 + 0.03


def drive_late(core, robot, seconds, see=see):
    """Drives with wheels that obey each command a control period later."""
    late = Command(0.0, 0.0, "")
    for _ in range(round(seconds / robot.dt)):
        see(core, robot, robot.time)
        robot.obey(late.v, late.omega)
        late = core.tick(robot.time, 0.0)
        robot.step()
    return late


def test_late_wheels_do_not_touch_a_wall(make_core, robot):
    """A latency of one control period is covered at full speed towards a wall."""
    core = make_core(any_start=True)
    last = drive_late(core, robot, 20.0)
    assert "something is ahead" in last.reason
    assert robot.stands
    assert not robot.contact


@pytest.mark.parametrize("missing", ["scan", "pose"])
def test_late_wheels_stand_within_the_stated_distance(make_core, robot, missing):
    """With old data, too, the distance holds for wheels that obey a period late."""
    core = make_core()
    drive_late(core, robot, 0.5)
    before = robot.way
    drive_late(core, robot, 1.5, lambda *a: see(*a, **{missing: False}))
    assert robot.stands
    stated = core.settings.stops_within()["a scan or a pose is late, lost or old"]
    assert robot.way - before <= stated


def test_turns_away_from_what_is_ahead(make_core, robot):
    """Only what a command leads to stops it: a turn on the spot is free."""
    turns = False

    def policy(_):
        return "action", ((-0.5, 0.5) if turns else (1.0, 1.0))

    core = make_core(policy, any_start=True)
    drive(core, robot, 20.0)
    turns = True
    assert drive(core, robot, 0.5)[-1].state == "driving"


def test_a_foot_before_the_scanner_stays(settings):
    """What was near and cannot be measured any more still stops the robot."""
    guard, angles = Guard(settings["robot"], 0.1), np.array([0.0])
    args = 0.3, 0.0, 0.3, (0.0, 0.0, 0.0)
    guard.see(np.array([2.0]), angles)
    assert not guard.blocked(*args)
    guard.see(np.array([0.15]), angles)
    assert guard.blocked(*args)
    guard.see(np.array([np.nan]), angles)
    assert guard.blocked(*args)
    guard.see(np.array([np.inf]), angles)
    assert not guard.blocked(*args)


@given(
    v=st.floats(-0.3, 0.3),
    omega=st.floats(-3, 3),
    x=st.floats(-0.3, 0.3),
    y=st.floats(-0.3, 0.3),
    stop=st.sampled_from([0.045, 0.4, 2.0]),
)
def test_the_guard_sees_what_it_would_touch(v, omega, x, y, stop):
    """Compared with 5000 places along the arc: nothing that comes nearer is missed."""
    robot = {"radius": 0.1, "stopping_distance": stop}
    x, y = x * (1.0 + 5.0 * stop), y * (1.0 + 5.0 * stop)
    guard = Guard(robot, 0.1)
    angle, away = math.atan2(y, x), math.hypot(x, y)
    guard.see(np.array([away]), np.array([angle]))
    pose, least = (0.0, 0.0, 0.0), away
    way = stop * abs(v) / 0.3 + 0.1 * abs(v)
    for _ in range(5000):
        time = way / 5000 / abs(v) if v else 0.0
        half = 0.5 * omega * time
        pose = compose(
            pose, (v * time * math.cos(half), v * time * math.sin(half), 2 * half)
        )
        least = min(least, math.dist(pose[:2], (x, y)))
    touches = least < 0.1 - 1e-3 and least < away - 1e-3
    free = least > 0.1 + 1e-3 or least >= away - 1e-5
    blocked = guard.blocked(v, omega, 0.3, (0.0, 0.0, 0.0))
    assert blocked or not touches
    assert not (blocked and free)


def test_a_thin_pole_beside_a_long_way_is_seen(settings):
    """A robot that needs 2 m to stop sees what it would graze on the way."""
    robot = {**settings["robot"], "radius": 0.2, "stopping_distance": 2.0}
    guard = Guard(robot, 0.1)
    for x in np.linspace(0.3, 2.0, 40):
        guard.see(np.array([math.hypot(x, 0.195)]), np.array([math.atan2(0.195, x)]))
        assert guard.blocked(1.0, 0.0, 1.0, (0.0, 0.0, 0.0)), x


def test_what_is_too_near_to_be_measured_is_ahead(settings):
    """A range between 0 and the smallest one, or -inf, is no free way."""
    for least in (0.05, -math.inf):
        scanner = Scanner({**settings["robot"], "below_min": "range_min"})
        scanner.use(Layout(60, 0.0, math.tau / 60, 0.1, 3.0))
        guard = Guard(settings["robot"], 0.1)
        guard.see(scanner.read([2.0] * 60)[1], scanner.guard_angles())
        assert not guard.blocked(0.3, 0.0, 0.3, (0.0, 0.0, 0.0))
        guard.see(scanner.read([least] + [2.0] * 59)[1], scanner.guard_angles())
        assert guard.blocked(0.3, 0.0, 0.3, (0.0, 0.0, 0.0))
        assert not guard.blocked(-0.3, 0.0, 0.3, (0.0, 0.0, 0.0))


def test_the_goal_ends_the_drive(make_core, settings):
    """Within the tolerance of the goal, the command is zero, for good."""
    core = make_core(any_start=True)
    core.scan(0.0, Layout(60, 0.0, math.tau / 60, 0.1, 3.0), [3.0] * 60)
    core.pose(0.0, *settings["goal"], 0.0)
    assert core.tick(0.0, 0.0).state == "reached"
    core.pose(0.1, 0.0, 0.0, 0.0)
    assert core.tick(0.1, 0.0).v == 0.0


def test_a_signal_ends_the_drive(make_core, robot):
    """After SIGTERM there is only zero."""
    core = make_core()
    drive(core, robot, 0.3)
    assert core.end("SIGTERM").v == 0.0
    assert {c.v for c in drive(core, robot, 0.5)} == {0.0}


def test_a_second_publisher_stops_it_until_it_is_started(make_core, robot):
    """A person who took over is near: the robot stands, also when the other is gone."""
    core = make_core()
    drive(core, robot, 0.5)
    core.publishers = 2
    assert "2 publishers" in drive(core, robot, 0.3)[-1].reason
    assert robot.stands
    assert core.start(robot.time)[1] == ("2 publishers of the commands: end the others")
    core.publishers = 1
    before = robot.way
    last = drive(core, robot, 5.0)[-1]
    assert (robot.way, last.state) == (before, "stopped")
    assert last.reason.endswith("call the service start to drive on")
    assert core.start(robot.time) == (True, "the drive goes on")
    assert drive(core, robot, 0.1)[0].state == "driving"


def test_commands_that_nobody_sees_move_nothing(make_core, robot):
    """Under another name than the topic has, other publishers were not seen either."""
    core = make_core()
    core.publishers = 0
    assert "0 publishers" in drive(core, robot, 0.5)[-1].reason
    assert robot.way == 0.0


@pytest.mark.parametrize(("seconds", "latches"), [(1.5, False), (2.5, True)])
@pytest.mark.parametrize("missing", ["scan", "pose", "ticks"])
def test_data_that_were_missing_for_long(make_core, robot, missing, seconds, latches):
    """Short gaps end by themselves; after 2 s, or a frozen node, only `start` does."""
    core = make_core()
    drive(core, robot, 0.5)
    if missing == "ticks":
        for _ in range(round(seconds / 0.1)):
            robot.step()
    else:
        drive(core, robot, seconds, lambda *a: see(*a, **{missing: False}))
    assert robot.stands
    before = robot.way
    last = drive(core, robot, 3.0)[-1]
    assert (robot.way == before) == latches
    assert (core.latched != "") == latches
    if latches:
        assert "without fitting data for more than 2 s" in last.reason
        assert core.start(robot.time)[0]
        assert drive(core, robot, 0.1)[0].state == "driving"


def test_data_that_vanish_after_the_call_begin_nothing_later(make_core, robot):
    """A call counts for its moment, also while the controller plans."""
    core = make_core(start_on="service")
    drive(core, robot, 0.3)
    assert core.start(robot.time - robot.dt)[0]
    core._policy.waits = True
    drive(core, robot, 0.2)
    drive(core, robot, 60.0, lambda *_: None)
    core._policy.waits = False
    assert {each.v for each in drive(core, robot, 2.0)} == {0.0}
    assert core.start(robot.time - robot.dt) == (True, "the drive begins")
    assert drive(core, robot, 0.1)[-1].state == "driving"


def test_stop_stops_until_it_is_started(make_core, robot):
    """At any time; before the drive, too."""
    core = make_core()
    drive(core, robot, 0.5)
    assert core.stop() == (
        "stopped: the service stop was called; call the service start to drive on"
    )
    before = robot.way
    assert {each.v for each in drive(core, robot, 3.0)} == {0.0}
    assert (
        robot.way - before
        <= core.settings.stops_within()[
            "something is ahead, the goal, /drive/stop, SIGTERM, a second publisher"
        ]
    )
    assert core.start(robot.time - robot.dt) == (True, "the drive goes on")
    assert drive(core, robot, 0.1)[0].state == "driving"
    core = make_core()
    core.stop()
    assert drive(core, robot, 0.3)[-1].v == 0.0
    core.end("SIGTERM")
    assert core.stop() == "ended: SIGTERM"


def test_a_controller_that_is_mostly_late_stops_for_good(make_core, robot):
    """Of the last twenty periods, eleven without an answer in time."""
    core = make_core()
    drive(core, robot, 0.5)
    core._policy.waits = True
    drive(core, robot, 1.2)
    core._policy.waits = False
    last = drive(core, robot, 2.0)[-1]
    assert "late in most of the last 20 control periods" in last.reason
    assert core.start(robot.time - robot.dt)[0]
    assert drive(core, robot, 0.1)[0].state == "driving"


def test_with_recover_nothing_stops_for_good(make_core, robot):
    """As `tdac ros drive --recover` and a recorded drive."""
    core = make_core(recover=True)
    drive(core, robot, 0.5)
    core.publishers = 2
    drive(core, robot, 3.0)
    core.publishers = 1
    assert drive(core, robot, 0.1)[0].state == "driving"


def test_a_largest_speed_is_kept(make_core, robot):
    """For first drives; the curve stays the same."""
    core = make_core(lambda _: ("action", (1.0, 0.5)), max_speed=0.1, any_start=True)
    last = drive(core, robot, 1.0)[-1]
    assert math.isclose(last.v, 0.1, abs_tol=1e-9)
    usual = make_core(lambda _: ("action", (1.0, 0.5)), any_start=True)
    own = drive(usual, robot, 1.0)[-1]
    assert math.isclose(last.omega / last.v, own.omega / own.v)


def test_the_goal_counts_although_the_robot_has_gone(make_core, robot):
    """The last pose was there; scans and poses ended before the node saw both."""
    core = make_core(any_start=True)
    drive(core, robot, 0.3)
    x, y, yaw = robot.read().pose
    near = dataclasses.replace(core.settings, goal=(x + 0.001, y))
    core.settings = near
    core.pose(robot.time, x, y, yaw)
    assert core.tick(robot.time + 5.0, 0.0).state == "reached"


def test_waits_at_the_start(make_core, robot):
    """It begins only where verified drives began; `any_start` says otherwise."""
    far = dataclasses.replace(make_core().settings, start=(1.0, 1.0, 0.0))
    core = Core(far, Ready(forward))
    command = drive(core, robot, 0.2)[-1]
    assert command.state == "waiting"
    assert "from the verified start" in command.reason
    core = Core(dataclasses.replace(far, any_start=True), Ready(forward))
    assert drive(core, robot, 0.2)[-1].state == "driving"


def test_a_robot_that_is_carried_away_while_it_plans_does_not_drive(make_core, robot):
    """The start counts until the first motion; back at the start, it begins."""
    core = make_core()
    core._policy.waits = True
    drive(core, robot, 0.3)

    def elsewhere(core, robot, now):
        x, y, yaw = robot.read().pose
        core.pose(now, x + 0.5, y, yaw)
        core.scan(now, robot.layout, robot.read().ranges)

    drive(core, robot, 2.0, elsewhere)
    core._policy.waits = False
    commands = drive(core, robot, 1.0, elsewhere)
    assert {(c.v, c.omega) for c in commands} == {(0.0, 0.0)}
    assert "0.50 m and 0.00 rad from the verified start" in commands[-1].reason
    assert drive(core, robot, 1.5)[-1].state == "driving"


def test_a_call_counts_for_its_moment(make_core, robot):
    """If the drive must not begin in the next period, it needs another call."""
    core = make_core(start_on="service")
    drive(core, robot, 0.3)
    assert core.start(robot.time - robot.dt)[0]
    core.publishers = 2
    drive(core, robot, 0.1)
    core.publishers = 1
    commands = drive(core, robot, 1.0)
    assert {(c.v, c.omega, c.state) for c in commands} == {(0.0, 0.0, "waiting")}
    assert "call the service start" in commands[-1].reason
    assert core.start(robot.time - robot.dt)[0]
    assert drive(core, robot, 0.1)[-1].state == "driving"


def test_the_drive_is_held_until_it_is_started(make_core, robot):
    """With `service`, nothing moves before the call; an early call begins nothing."""
    core = make_core(start_on="service")
    assert core.start(0.0) == (False, "no scan yet")
    commands = drive(core, robot, 0.5)
    assert {(c.v, c.omega, c.state) for c in commands} == {(0.0, 0.0, "waiting")}
    assert core._policy.observations == []
    assert "call the service start" in commands[-1].reason
    assert core.start(robot.time - robot.dt) == (True, "the drive begins")
    assert drive(core, robot, 0.1)[-1].state == "driving"
    core.end("SIGTERM")
    assert core.start(robot.time) == (False, "ended: SIGTERM")
    with pytest.raises(SettingsError, match="start_on: expected pose or service"):
        make_core(start_on="now")


@pytest.mark.parametrize(
    ("values", "got"),
    [([], "no number"), ([None], "no number"), ([0.5], "0.5"), ([0.0], "0")],
)
def test_a_timer_that_is_missing_or_too_long_ends_the_drive(make_core, values, got):
    """What the robot's driver answers may be empty, too."""
    core = make_core()
    core.check_timer("cmd_vel_timeout of /base", [0.3])
    assert core.final is None
    core.check_timer("cmd_vel_timeout of /base", values)
    assert core.final.reason == (
        "cmd_vel_timeout of /base: expected above 0 and at most dead_man, 0.3 s, "
        f"got {got}"
    )


def test_a_timer_that_is_longer_than_declared_ends_the_drive(make_core):
    """The stated distances are those of the declared one."""
    core = make_core(dead_man=0.1)
    core.check_timer("cmd_vel_timeout of /base", [0.2])
    assert "at most dead_man, 0.1 s, got 0.2" in core.final.reason


def test_a_clock_that_goes_back_ends_the_drive(make_core, robot):
    """A simulation that begins again, or a clock that is set: never again a motion."""
    core = make_core()
    drive(core, robot, 0.5)
    for step in range(20):  # beyond the time at which it went back
        see(core, robot, 0.1 * step)
        command = core.tick(0.1 * step, 0.0)
        assert (command.v, command.omega, command.state) == (0.0, 0.0, "failed")
    assert command.reason == "the clock went back by 0.4 s: start the node again"
    assert core.start(0.0) == (False, f"failed: {command.reason}")


def test_a_clock_that_is_slewed_by_less_than_a_period_ends_nothing(make_core, robot):
    """Meanwhile time stands still, so that no data look newer than they are."""
    core = make_core()
    drive(core, robot, 0.5)
    see(core, robot, 0.5)
    assert core.tick(0.5, 0.0).state == "driving"
    assert core.tick(0.42, 0.0).state == "driving"
    see(core, robot, 0.6)
    assert core.tick(0.6, 0.0).state == "driving"


@pytest.mark.parametrize("missing", ["scan", "pose"])
def test_one_stamp_of_the_future_blocks_no_later_data(make_core, robot, missing):
    """The robot stands because of it, and goes on with the next scan and pose."""
    core = make_core()
    drive(core, robot, 0.5)
    late = robot.time + 1000.0
    see(core, robot, late, **{"scan": False, "pose": False, missing: True})
    command = core.tick(robot.time, 0.0)
    assert command.v == 0.0
    assert f"the {missing} is more than 0.3 s ahead of the clock" in command.reason
    # The pose did not move as commanded in 1000 s, so it must be steady first.
    drive(core, robot, 1.5)
    assert missing == "scan" or core.start(robot.time - robot.dt)[0]
    assert drive(core, robot, 0.1)[-1].state == "driving"


def test_a_clock_that_differs_is_named(make_core, robot):
    """Stamps of another clock move nothing."""
    core = make_core()
    see(core, robot, 100.0)
    assert "ahead of the clock" in core.tick(0.0, 0.0).reason


def test_scan_and_pose_must_be_of_one_time(make_core, robot):
    """Each may be new enough, but not far from the other."""
    core = make_core(max_age=0.2)
    see(core, robot, 10.0, pose=False)
    see(core, robot, 10.35, scan=False)
    assert "apart" in core.tick(10.17, 0.0).reason


def test_the_horizon_ends_the_drive(make_core, robot):
    """It was verified for so many commands."""
    core = make_core(lambda _: ("action", (0.1, -0.1)), horizon=5)
    commands = drive(core, robot, 1.0)
    assert commands[4].state == "driving"
    assert commands[5].state == "failed"


@pytest.mark.parametrize("dead_man", [0.0, 0.31, math.nan, -1.0])
def test_the_timer_of_the_robot_is_required(settings, dead_man):
    """A robot that does not stop by itself within three periods is not driven."""
    with pytest.raises(SettingsError, match="dead_man: expected"):
        core_settings(settings, dead_man=dead_man)


@pytest.mark.parametrize(
    "changes",
    [
        {"dt": math.nan},
        {"horizon": 0},
        {"goal_tolerance": math.inf},
        {"start": (math.nan, 0.0, 0.0)},
        {"goal": (0.0, 1e9)},
    ],
)
def test_a_task_of_impossible_numbers_is_refused(make_core, changes):
    """`settings.json` may have been edited."""
    with pytest.raises(SettingsError, match="expected"):
        make_core(**changes)


@pytest.mark.parametrize(
    ("source", "origin", "why"),
    [
        ("odometry", (0, 0, 0), "pose_source: expected tf or odom"),
        ("odom", (0.0, 0.0), "origin: expected x, y, yaw"),
        ("odom", (0.0, math.nan, 0.0), "origin: expected x, y, yaw"),
    ],
)
def test_parameters_of_the_pose_that_are_impossible(source, origin, why):
    """The node ends at its start, with one line."""
    with pytest.raises(ValueError, match=why):
        check_pose_parameters(source, origin)
    check_pose_parameters("odom", [1.0, 2.0, 0.5])


MAP = {"size": [60, 40], "resolution": 0.05, "origin": [-1.0, -1.0, 0.0]}


@pytest.mark.parametrize(
    ("size", "resolution", "origin"),
    [
        ((61, 40), 0.05, (-1.0, -1.0, 0.0)),
        ((40, 60), 0.05, (-1.0, -1.0, 0.0)),
        ((60, 40), 0.051, (-1.0, -1.0, 0.0)),
        ((60, 40), math.nan, (-1.0, -1.0, 0.0)),
        ((60, 40), 0.05, (-1.01, -1.0, 0.0)),
        ((60, 40), 0.05, (math.nan, -1.0, 0.0)),
        ((60, 40), 0.05, (-1.0, -1.0, 0.01)),
        ((60, 40), 0.05, (-1.0, -1.0, math.nan)),
    ],
)
def test_a_localiser_with_another_map_ends_the_drive(
    make_core, robot, size, resolution, origin
):
    """A map that was scanned again has another size or origin; `any_map` takes it."""
    core = make_core(own_map=MAP)
    core.localiser_map(size, resolution, origin)
    command = drive(core, robot, 0.2)[-1]
    assert (command.v, command.state) == (0.0, "failed")
    assert "the localiser has another map: " in command.reason
    assert "verified with 60 x 40 cells of 0.05 m from (-1, -1, 0)" in command.reason
    core = make_core(own_map=MAP, any_map=True)
    core.localiser_map(size, resolution, origin)
    assert drive(core, robot, 0.2)[-1].state == "driving"


def test_the_map_of_the_verification_is_taken(make_core, settings):
    """With the resolution of a message, which is float32."""
    assert settings["map"] == MAP
    core = make_core()
    core.localiser_map((60, 40), float(np.float32(0.05)), (-1.0, -1.0, 1e-17))
    assert core.final is None
    big = {"size": [4000, 4000], "resolution": 0.05, "origin": [0.0, 0.0, math.pi]}
    turned = (0.0, 0.0, -math.pi)
    assert other_map(big, (4000, 4000), float(np.float32(0.05)), turned) == ""


@pytest.mark.parametrize(
    ("place", "turn", "why"),
    [
        ((0.0, 0.0), (0.0, 0.0, 0.0, 1.0), "the robot file has (-0.03, 0)"),
        ((math.nan, 0.0), (0.0, 0.0, 0.0, 1.0), "the robot file has"),
        ((-0.03, 0.0), (1.0, 0.0, 0.0, 0.0), "tilted or upside down"),
        ((-0.03, 0.0), (0.0, 0.0, 0.0, 0.0), "tilted or upside down"),
    ],
)
def test_a_scanner_that_is_not_where_the_robot_file_says(settings, place, turn, why):
    """Its place and that it is level; it may be turned."""
    with pytest.raises(LayoutError) as error:
        mounted(settings["robot"], place, turn)
    assert why in str(error.value)
    turned = mounted(settings["robot"], (-0.03, 0.0), (0.0, 0.0, 1.0, 0.0))
    assert turned == pytest.approx(math.pi)


def test_a_scan_of_another_robot_is_refused(make_core, settings):
    """The message says what the scan has and what the robot file has."""
    core = make_core()
    core.scan(0.0, Layout(720, -math.pi, math.tau / 720, 0.1, 3.0), [3.0] * 720)
    command = core.tick(0.0, 0.0)
    assert command.state == "failed"
    assert "the scan has 720 rays from -3.14" in command.reason
    assert "the robot file 60 from 0" in command.reason


def test_a_short_or_backward_scan_is_refused(settings):
    """So is one that reaches less far, or turns the other way."""
    scanner = Scanner(settings["robot"])
    with pytest.raises(LayoutError, match="the scan reaches 2 m"):
        scanner.use(Layout(60, 0.0, math.tau / 60, 0.1, 2.0))
    with pytest.raises(LayoutError, match="clockwise"):
        scanner.use(Layout(60, 0.0, -math.tau / 60, 0.1, 3.0))


def test_the_rays_of_the_simulated_turtlebot_are_taken(settings):
    """Gazebo's 360 rays from 0 to 6.28 rad are those of the LDS-01."""
    robot = {
        "ray_angles": [math.radians(i) for i in range(360)],
        "is_scanner": True,
        "radius": 0.105,
        "range_max": 3.5,
        "range_min": 0.12,
        "below_min": "zero",
    }
    scanner = Scanner(robot)
    scanner.use(Layout(360, 0.0, 6.28 / 359, 0.12, 3.5))
    assert scanner.read([1.0] * 360)[0].tolist() == [1.0] * 360


def test_a_fan_reads_the_nearest_return_of_each_sector():
    """Seven sectors of 10 degrees, from 70 rays of 1 degree."""
    robot = {
        "ray_angles": [math.radians(a) for a in range(30, -31, -10)],
        "range_max": 5.0,
        "range_min": None,
    }
    scanner = Scanner(robot)
    scanner.use(Layout(360, -math.pi, math.tau / 360, 0.05, 10.0))
    ranges = np.full(360, 4.0)
    ranges[180 + 27] = 2.0  # 27 degrees to the left
    ranges[180 - 14] = 1.0
    ranges[180] = np.inf
    ranges[180 + 60] = 0.5  # outside the fan
    task, guard = scanner.read(ranges)
    assert task.tolist() == [2.0, 4.0, 4.0, 4.0, 1.0, 4.0, 4.0]
    assert guard[180 + 60] == 0.5
    with pytest.raises(LayoutError, match="does not see 30 degrees"):
        scanner.use(Layout(41, -0.35, 0.0175, 0.05, 10.0))


def test_a_mounted_scanner_is_turned_back():
    """A scanner that looks backwards on the robot gives the same readings."""
    robot = {"ray_angles": [math.pi / 2, 0.0, -math.pi / 2], "range_max": 9.0}
    scanner = Scanner(robot)
    scanner.use(Layout(4, 0.0, math.pi / 2, 0.1, 9.0, mount=math.pi))
    # From behind, counter-clockwise: behind, right, ahead, left.
    assert scanner.read([1.0, 2.0, 3.0, 4.0])[0].tolist() == [4.0, 3.0, 2.0]


def test_ranges_without_a_value():
    """inf reads the largest range; NaN the nearer neighbour; most NaN: no scan.

    Too near reads the smallest range, as the robot file says nothing else.
    """
    robot = {"ray_angles": [0.3, 0.2, 0.1, 0.0, -0.1, -0.2], "range_max": 5.0}
    scanner = Scanner(robot)
    scanner.use(Layout(6, 0.3, -0.1, 0.1, 5.0))
    nan, inf = math.nan, math.inf
    assert scanner.read([1, nan, 3, inf, 9, 5])[0].tolist() == [1, 1, 3, 5, 5, 5]
    assert scanner.read([1, nan, nan, 4, 5, 6])[0] is None
    assert scanner.read([1, 2])[0] is None
    near = scanner.read([0.05, 2, 3, -inf, 5, 4])[0]
    assert np.allclose(near, [0.1, 2, 3, 0.1, 5, 4])


ZEROS = [slice(None), slice(0, 14), slice(None, None, 2), slice(14, 47)]


@pytest.mark.parametrize("part", ZEROS)
def test_zeros_that_say_nothing_are_missing(make_core, robot, part):
    """A scanner that is covered and reads 0 stops the robot, as one that reads NaN."""
    core = make_core()

    def covered(core, robot, now):
        reading = robot.read()
        reading.ranges[part] = 0.0
        core.pose(now, *reading.pose)
        core.scan(now, robot.layout, reading.ranges)

    assert drive(core, robot, 0.5)[-1].state == "driving"
    before = robot.way
    commands = drive(core, robot, 1.0, covered)
    assert commands[-1].state == "stopped"
    assert "the last scan is older" in commands[-1].reason
    stated = core.settings.stops_within()["a scan or a pose is late, lost or old"]
    assert robot.way - before <= stated


@given(
    x=st.floats(-0.15, 0.15),
    y=st.floats(-0.15, 0.15),
    least=st.floats(0.02, 0.3),
)
def test_a_zero_counts_where_something_can_be_near(x, y, least):
    """In these directions, a point at the smallest range is outside the body."""
    robot = {
        "ray_angles": np.linspace(-3.0, 3.0, 40),
        "radius": 0.22,
        "scanner_offset": (x, y),
        "below_min": "zero",
        "range_min": least,
        "range_max": 5.0,
    }
    for angle, near in zip(
        robot["ray_angles"], Scanner(robot).zero_is_near, strict=True
    ):
        away = math.hypot(x + least * math.cos(angle), y + least * math.sin(angle))
        assert near == (away > 0.22) or abs(away - 0.22) < 1e-9


def test_a_wall_that_is_too_near_is_no_missing_scan(settings):
    """A third of the rays behind the burger read 0 beside a wall: the scan counts."""
    burger = {
        "ray_angles": [math.radians(i) for i in range(360)],
        "radius": 0.105,
        "scanner_offset": (-0.032, 0.0),
        "below_min": "zero",
        "range_min": 0.12,
        "range_max": 3.5,
    }
    scanner = Scanner(burger)
    scanner.use(Layout(360, 0.0, math.radians(1), 0.12, 3.5))
    ranges = np.full(360, 2.0)
    ranges[120:240] = 0.0
    assert scanner.read(ranges)[0].tolist() == ranges.tolist()
    front = np.full(360, 2.0)
    front[:40] = front[-40:] = 0.0
    assert scanner.read(front)[0] is None
    assert scanner.read(np.zeros(360))[0] is None


LDS_02 = {
    "ray_angles": [math.tau * i / 240 for i in range(240)],
    "is_scanner": True,
    "radius": 0.105,
    "stopping_distance": 0.032,
    "scanner_offset": (-0.032, 0.0),
    "below_min": "range_min",
    "range_min": 0.16,
    "range_max": 8.0,
}


def scan_of_lds_02(random, away, blind=()):
    """A scan as the driver of the LDS-02 makes it: from the first return to the last.

    Args:
        random: Draws the number of rays and the angle of the first one.
        away: Range in a direction, rad.
        blind: Directions without a return, degrees: first, last.
    """
    count = int(random.integers(230, 270))
    step = math.tau / count
    angles = random.uniform(0, step) + step * np.arange(count)
    ranges = np.array([away(angle) for angle in angles])
    for first, last in blind:
        turn = np.degrees(angles)
        ranges[(turn >= first) & (turn <= last)] = np.nan
    known = np.flatnonzero(~np.isnan(ranges))
    kept = slice(known[0], known[-1] + 1)
    own = ranges[kept]
    layout = Layout(len(own), float(angles[known[0]]), step, 0.0, 100.0)
    return layout, own


@given(seed=st.integers(0, 1000))
def test_scans_of_the_lds_02_are_resampled(seed):
    """Each ray reads the distance of a wall ahead, whatever the scan begins with."""
    random = np.random.default_rng(seed)
    scanner = Scanner(LDS_02, resample=True)
    angles = np.array(LDS_02["ray_angles"])

    def wall(angle):
        return min(2.0 / max(math.cos(angle), 1e-9), 7.0)

    scanner.use(scan_of_lds_02(random, wall)[0])
    layout, ranges = scan_of_lds_02(random, wall)
    scanner.use(layout)
    task, guard = scanner.read(ranges)
    true = np.array([wall(angle) for angle in angles])
    # Two steps of the scan: a ray may see less than its sector, or beyond it.
    least = np.array(
        [min(wall(a + t) for t in np.linspace(-0.06, 0.06, 9)) for a in angles]
    )
    most = np.array(
        [max(wall(a + t) for t in np.linspace(-0.06, 0.06, 9)) for a in angles]
    )
    assert (task >= least - 1e-5).all()
    assert (task <= most + 1e-5).all()
    assert abs(task[0] - true[0]) < 0.01
    assert np.allclose(task, guard)
    with pytest.raises(LayoutError, match="or set resample_scan if only the number"):
        Scanner(LDS_02).use(dataclasses.replace(layout, count=layout.count + 60))


def test_directions_that_a_scan_does_not_have_are_missing():
    """A scan that begins at 20 degrees: filled if little is missing, else none."""
    random, scanner = np.random.default_rng(0), Scanner(LDS_02, resample=True)
    layout, ranges = scan_of_lds_02(random, lambda _: 1.0, [(0, 20), (350, 360)])
    assert layout.first > math.radians(20)
    scanner.use(layout)
    task, guard = scanner.read(ranges)
    assert np.allclose(task, 1.0)
    assert np.isnan(guard[:10]).all()
    layout, ranges = scan_of_lds_02(random, lambda _: 1.0, [(0, 50), (320, 360)])
    scanner.use(layout)
    assert scanner.read(ranges)[0] is None


def test_what_was_near_stays_when_the_number_of_rays_changes(settings):
    """A foot that the next scan cannot measure still stops the robot."""
    settings = {**settings, "robot": {**settings["robot"], **LDS_02}}
    own = core_settings(settings, dead_man=0.3, resample_scan=True, any_start=True)
    core, random = Core(own, Ready(forward)), np.random.default_rng(1)
    assert core.tick(0.0, 0.0).reason == "no scan yet"
    core.scan(0.0, Layout(200, 0.0, 0.0, 0.0, 100.0), [1.0] * 200)
    assert "no scan yet: the header" in core.tick(0.0, 0.0).reason

    def see(now, away, blind=()):
        core.scan(now, *scan_of_lds_02(random, away, blind))
        core.pose(now, 0.0, 0.0, 0.0)
        return core.tick(now, 0.0)

    def foot(angle):
        return 0.17 if math.cos(angle) > 0.98 else 3.0

    assert see(0.1, lambda _: 3.0).state == "driving"
    core.drove(0.0, 0.0)
    assert "something is ahead" in see(0.2, foot).reason
    gone = [(0, 12), (348, 360)]
    assert "something is ahead" in see(0.3, lambda _: 3.0, gone).reason
    assert see(0.4, lambda _: 3.0).state == "driving"


def test_a_header_of_a_scan_that_is_impossible_is_refused():
    """Angles and ranges of a header are numbers in order."""
    scanner = Scanner({**LDS_02, "is_scanner": False})
    for bad in (
        Layout(240, math.nan, 0.02, 0.0, 100.0),
        Layout(240, 0.0, 1e300, 0.0, 100.0),
        Layout(240, 1e9, 0.02, 0.0, 100.0),
        Layout(240, 0.0, 0.0, 0.0, 100.0),
        Layout(240, 0.0, 0.026, math.nan, 100.0),
        Layout(240, 0.0, 0.026, 0.0, math.nan),
        Layout(240, 0.0, 0.026, 9.0, 8.0),
        Layout(240, 0.0, 0.026, -1.0, 8.0),
        Layout(0, 0.0, 0.026, 0.0, 8.0),
        Layout(30_000, 0.0, 1e-4, 0.0, 8.0),
    ):
        with pytest.raises(LayoutError):
            scanner.use(bad)


@pytest.mark.parametrize("wrong", [(0.2, 0.0, 0.0), (0.0, 0.0, 0.3)])
def test_a_jump_of_the_pose_stops_it(make_core, robot, wrong):
    """It stands until it is started with a pose that was steady for a second."""
    core = make_core()
    assert drive(core, robot, 0.5)[-1].state == "driving"
    before = robot.way

    def jumped(core, robot, now):
        reading = robot.read()
        core.pose(now, *compose(tuple(reading.pose), wrong))
        core.scan(now, robot.layout, reading.ranges)

    commands = drive(core, robot, 1.5, jumped)
    assert {c.state for c in commands} == {"stopped"}
    assert "the pose jumped by" in commands[0].reason
    assert "steady for 1 s" in commands[0].reason
    assert "call the service start" in commands[-1].reason
    now = robot.time - robot.dt
    assert core.start(now) == (True, "the drive goes on")
    assert drive(core, robot, 0.1, jumped)[0].state == "driving"
    assert drive(core, robot, 0.1)[0].state == "stopped"
    assert (
        robot.way - before
        <= core.settings.stops_within()["the pose jumps or is unsure"] + 0.3 * 0.5
    )


def test_a_node_that_was_frozen_sees_no_jump(make_core, robot):
    """The robot stopped by its own timer, which is where the commands lead, too."""
    core = make_core()
    drive(core, robot, 0.5)
    for _ in range(12):
        robot.step()
    assert robot.stands
    assert drive(core, robot, 0.1)[-1].state == "driving"


def test_small_corrections_and_late_wheels_are_no_jumps(make_core, robot):
    """Noise of a localiser, and wheels that obey a period late, do not stop it."""
    core, random = make_core(), np.random.default_rng(2)

    def turning(_):
        return "action", (1.0, 0.4) if robot.time % 1.0 < 0.5 else (0.4, 1.0)

    core = make_core(turning, start=(0.0, 0.0, 0.0), any_start=True)

    def noisy(core, robot, now):
        reading = robot.read()
        off = random.normal(0.0, 0.02, 3)
        core.pose(now, *(reading.pose + off))
        core.scan(now, robot.layout, reading.ranges)

    late, reasons = Command(0.0, 0.0, ""), set()
    for _ in range(20):
        noisy(core, robot, robot.time)
        robot.obey(late.v, late.omega)
        late = core.tick(robot.time, 0.0)
        reasons.add(late.reason)
        robot.step()
    assert robot.way > 0.3
    assert not any("jumped" in reason for reason in reasons), reasons


@pytest.mark.parametrize(
    ("variances", "drives"),
    [
        ((0.01, 0.01, 0.01), True),
        ((0.0, 0.0, 0.0), True),
        ((-1.0, -1.0, -1.0), True),
        ((0.25, 0.01, 0.01), False),
        ((0.01, 0.07, 0.01), False),
        ((0.01, 0.01, 0.07), False),
        ((math.nan, 0.0, 0.0), False),
        ((0.0, 0.0, math.inf), False),
    ],
)
def test_an_unsure_pose_stops_it(make_core, robot, variances, drives):
    """It drives on as soon as the localiser is sure again; 0 or less says nothing."""
    core = make_core()
    drive(core, robot, 0.5)
    core.where.take_variances(variances)
    command = drive(core, robot, 0.1)[-1]
    assert (command.state == "driving") == drives
    assert drives or "the pose is unsure: standard deviation" in command.reason
    core.where.take_variances((0.01, 0.01, 0.001))
    assert drive(core, robot, 0.1)[-1].state == "driving"


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e308, 1e7])
def test_a_pose_that_is_no_place_does_not_count(make_core, robot, value):
    """The robot stands as without a pose, and observes only numbers."""
    core = make_core()
    drive(core, robot, 0.5)

    def wrong(core, robot, now):
        core.pose(now, value, 0.0, 0.0)
        core.scan(now, robot.layout, robot.read().ranges)

    last = drive(core, robot, 1.0, wrong)[-1]
    assert (last.v, last.reason) == (0.0, "the last pose is older than 0.3 s")
    assert all(np.isfinite(each).all() for each in core.observation().values())


@pytest.mark.parametrize("changes", [{"max_jump": -1.0}, {"max_deviation": math.nan}])
def test_limits_of_the_pose_are_numbers(make_core, changes):
    """0 or more."""
    with pytest.raises(SettingsError, match="expected 0 or more"):
        make_core(**changes)


@given(yaw=ANGLES)
def test_yaw_of_a_quaternion(yaw):
    """The inverse of the quaternion of a yaw."""
    found = yaw_of(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    assert math.isclose(math.cos(found), math.cos(yaw), abs_tol=1e-9)
    assert math.isclose(math.sin(found), math.sin(yaw), abs_tol=1e-9)


@pytest.mark.parametrize("w", [0.0, 0.9, 2.0, math.nan, math.inf])
def test_what_is_no_turn_is_no_pose(w):
    """A quaternion of another length than 1, such as one of zeros."""
    assert math.isnan(yaw_of(0.0, 0.0, 0.0, w))


@given(a=st.tuples(PLACES, PLACES, ANGLES), b=st.tuples(PLACES, PLACES, ANGLES))
def test_poses_compose_as_matrices(a, b):
    """The pose of C in A is the product of two homogeneous matrices."""

    def matrix(x, y, yaw):
        c, s = math.cos(yaw), math.sin(yaw)
        return np.array([[c, -s, x], [s, c, y], [0, 0, 1]])

    assert np.allclose(matrix(*compose(a, b)), matrix(*a) @ matrix(*b), atol=1e-8)


@given(times=st.lists(st.floats(-0.5, 3.0), min_size=2, max_size=5).map(sorted))
def test_parts_of_a_motion_make_the_whole(times):
    """The commands of some time lead as far in one piece as in several."""
    driven = Driven(0.3)
    for now, v, omega in ((0.0, 0.2, 0.0), (0.1, 0.1, 2.0), (1.0, 0.2, -1.5)):
        driven.take(now, v, omega)
    whole = (0.0, 0.0, 0.0)
    for part in driven.parts(*times):
        whole = compose(whole, part)
    assert np.allclose(whole, driven.between(times[0], times[-1]), atol=1e-9)
    # Straight for 0.1 s, then a left turn until the timer ends it.
    straight, turn = driven.parts(0.0, 0.1, 0.9)
    assert straight == pytest.approx((0.02, 0.0, 0.0))
    assert turn[2] == pytest.approx(2.0 * 0.3)


def localised_by_amcl(core, robot, random, lost=0.0, silent=math.inf):
    """Gives the core what a robot with AMCL sends: scans of 5 Hz, stamps 1 s ahead.

    Args:
        core: The core.
        robot: The robot, whose odometry is sent in each control period.
        random: Draws the delay of AMCL and which scans are lost.
        lost: Share of scans that are lost on the way.
        silent: Time from which AMCL sends nothing, s.
    """
    held, state = [], {"next": 0.0}

    def see(core, robot, now):
        if now >= state["next"] - 1e-9:
            state["next"] += 0.2
            if random.random() >= lost:
                core.scan(now, robot.layout, robot.read().ranges, 0.0)
                held.append((now + random.uniform(0.15, 0.18), now + 1.0))
        while held and held[0][0] <= now:
            stamp = held.pop(0)[1]
            if now < silent:
                core.where.take_transform(stamp)
        core.pose(now, *robot.read().pose)

    return see


def test_amcl_at_5_hz_stops_nothing(make_core, robot):
    """Delays of 0.15 to 0.18 s and stamps 1 s ahead: no stop after the first motion."""
    core = make_core()
    see = localised_by_amcl(core, robot, np.random.default_rng(1))
    commands = drive(core, robot, 3.0, see)
    first = next(i for i, each in enumerate(commands) if each.state == "driving")
    assert {each.state for each in commands[first:]} == {"driving"}


def test_lost_scans_of_a_slow_scanner_latch_nothing(make_core, robot):
    """With one of twenty lost, each stop ends with the next scan."""
    turns = make_core(lambda _: ("action", (0.2, -0.2)), horizon=10_000)
    see = localised_by_amcl(turns, robot, np.random.default_rng(2), lost=0.05)
    commands = drive(turns, robot, 30.0, see)
    stopped = [each for each in commands[2:] if each.state != "driving"]
    assert {each.reason for each in stopped} == {"the last scan is older than 0.3 s"}
    assert len(stopped) <= 20
    assert turns.latched == ""


def test_a_silent_localiser_is_noticed(make_core, robot):
    """The robot stands within the stated distance, whatever AMCL stamped ahead."""
    core = make_core()
    see = localised_by_amcl(core, robot, np.random.default_rng(1), silent=1.0)
    drive(core, robot, 1.0, see)
    before = robot.way
    commands = drive(core, robot, 1.5, see)
    assert commands[-1].reason.startswith("the localiser sent nothing new for 1 s")
    assert robot.stands
    stated = core.settings.stops_within()["the localiser is silent"]
    assert 0.3 * 0.7 < robot.way - before <= stated
    with pytest.raises(SettingsError, match=r"max_localiser_age: expected 0.1 to 2 s"):
        make_core(max_localiser_age=3.0)


@given(angle=ANGLES)
def test_angles_are_wrapped(angle):
    """Into (-pi, pi], and the same direction."""
    assert -math.pi < wrapped(angle) <= math.pi
    assert math.isclose(math.cos(wrapped(angle)), math.cos(angle), abs_tol=1e-9)


@given(v=st.floats(-1, 1), omega=st.floats(-5, 5))
def test_wheels_and_twist_are_inverse(settings, v, omega):
    """Speeds of the body and of the wheels."""
    wheels = Wheels(settings["robot"], 0.1)
    assert np.allclose(wheels.twist(*wheels.fractions(v, omega)), (v, omega))


@given(commands=st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=20))
def test_limits_are_those_of_the_environment(task, settings, commands):
    """The wheels' fractions are those that the environment applies."""
    robot = Robot(task, settings, dead_man=9.0)
    wheels = Wheels(settings["robot"], 0.1)
    for action in np.array(commands, np.float32).reshape(-1, 2):
        robot._env.step(action)
        if robot._env._is_over:
            break
        own = wheels.limited(*map(float, action))
        assert np.allclose(robot._env.robot.wheel_speeds, own, atol=1e-6)
