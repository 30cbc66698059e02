"""What is ahead stops the robot in time; where it stopped, it goes on."""

import math

import numpy as np
import pytest
from floor_task import drive, see

from tdac_agent.ros2.package.motion import unheard
from tdac_agent.ros2.package.scans import Guard


def test_the_stated_distance_is_the_one_that_is_looked_ahead(make_core):
    """The guard of a drive stops before a wall that is nearer than the README says."""
    core = make_core()
    stated = next(
        own for why, own in core.settings.stops_within().items() if "ahead" in why
    )
    robot, speed = core.settings.robot, core.settings.full_speed
    guard = Guard({**robot, "range_noise": 0.0}, core.settings.reaction)
    for beyond, is_blocked in ((-0.001, True), (0.001, False)):
        away = robot["radius"] + stated + beyond - robot["scanner_offset"][0]
        guard.see(np.array([away]), np.array([0.0]))
        args = speed, 0.0, speed, (0.0, 0.0, 0.0)
        assert guard.blocked(*args) == is_blocked


def test_a_wall_is_not_touched_by_a_robot_that_obeys_late(make_core, robot):
    """Each command counts a period late, as the stated distances allow."""
    core = make_core(any_start=True)
    late = 0.0, 0.0
    for _ in range(200):
        see(core, robot, robot.time)
        command = core.tick(robot.time, 0.0)
        robot.obey(*late)
        robot.step()
        late = command.v, command.omega
    assert command.reason == "something is ahead within the stopping distance"
    assert robot.way > 0.1
    assert not robot.contact
    assert robot.smallest_gap() > 0.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_was_seen_while_the_robot_turned_may_be_ahead(settings, side):
    """A pole 40 degrees to a side, seen while the robot turned by up to 40 degrees."""
    guard = Guard(settings["robot"], 0.2)
    angle = side * math.radians(40.0)
    guard.see(np.array([0.19]), np.array([angle]))
    args = 0.3, 0.0, 0.3, (0.0, 0.0, 0.0), 0.0
    assert not guard.blocked(*args)
    assert not guard.blocked(*args, 0.05)
    for turned in (angle, -angle):
        assert guard.blocked(*args, turned)


def test_a_turning_robot_reckons_with_the_time_of_its_scan(make_core, robot):
    """The turn comes from the commands; a scan without times took a control period."""

    def seen(age):
        core, found = make_core(any_start=True), []
        core._policy.policy = lambda _: ("action", (0.0, 1.0))
        own = core._guard.blocked

        def noted(*args):
            found.append(args[-1])
            return own(*args)

        core._guard.blocked = noted
        for i in range(10):
            now = 0.1 * i
            core.pose(now, *robot.read().pose)
            core.scan(now, robot.layout, np.full(60, 2.0), age)
            command = core.tick(now, 0.0)
        return found[-1], command.omega

    (once, omega), (unsaid, _), (twice, _) = seen(0.1), seen(0.0), seen(0.2)
    assert math.isclose(once, 0.1 * omega, rel_tol=1e-6)
    assert unsaid == once
    assert math.isclose(twice, 2.0 * once, rel_tol=1e-6)


def test_commands_that_nobody_takes_stop_the_drive(make_core, robot):
    """As where the smoother died: the driver may keep its last command."""
    core = make_core()
    drive(core, robot, 0.5)
    core.listeners = 0
    assert "nobody takes the commands" in drive(core, robot, 0.3)[-1].reason
    core.listeners = 1
    assert drive(core, robot, 1.0)[-1].state == "stopped"
    assert core.start(robot.time) == (True, "the drive goes on")


@pytest.mark.parametrize(
    ("publishers", "listeners", "said"),
    [(1, 1, ""), (1, 3, ""), (2, 1, "2 pub"), (0, 1, "0 pub"), (1, 0, "nobody")],
)
def test_who_hears_the_commands(publishers, listeners, said):
    """One publisher, and at least one that takes them."""
    found = unheard(publishers, listeners)
    assert found.startswith(said)
    assert bool(found) == bool(said)


@pytest.mark.parametrize(
    ("shift", "turn", "goes_on"),
    [(0.0, 0.0, True), (0.05, 0.2, True), (0.5, 0.0, False), (0.0, 1.0, False)],
)
def test_a_drive_goes_on_only_where_it_stopped(make_core, robot, shift, turn, goes_on):
    """A robot that was carried or driven elsewhere has no verified way from there."""
    core = make_core()
    drive(core, robot, 1.0)
    core.stop()
    drive(core, robot, 3.0)
    assert robot.stands

    def elsewhere(core, robot, now, share=1.0):
        x, y, yaw = robot.read().pose
        core.pose(now, x, y + share * shift, yaw + share * turn)
        core.scan(now, robot.layout, robot.read().ranges)

    for share in np.linspace(0.0, 1.0, 20):  # slowly, so that the pose never jumps
        drive(core, robot, 0.1, lambda *args, s=share: elsewhere(*args, s))
    drive(core, robot, 0.1, elsewhere)
    may, said = core.start(robot.time - robot.dt)
    assert may == goes_on, said
    if not goes_on:
        assert f"{shift:.2f} m and {turn:.2f} rad from where it came to a stand" in said
        last = drive(core, robot, 0.5, elsewhere)[-1]
        assert (last.v, last.state) == (0.0, "stopped")
        drive(core, robot, 2.0)  # put back
        assert core.start(robot.time - robot.dt)[0]


def box_ahead(robot, away, is_lost):
    """Ranges of 360 rays to a box 0.12 m wide; near it, they say nothing."""
    angles = np.arange(360) * math.tau / 360
    ranges = np.full(360, 3.0)
    for i, angle in enumerate(angles):
        if abs(math.tan(angle)) * away < 0.06 and math.cos(angle) > 0.0:
            ranges[i] = away / math.cos(angle)
    return np.where(ranges < 0.3, math.nan, ranges) if is_lost else ranges


@pytest.mark.parametrize("is_lost", [False, True])
def test_what_is_not_seen_any_more_stays_where_it_was(settings, is_lost):
    """A dark box of which no ray returns once it is near stops the robot, too."""
    angles = np.arange(360) * math.tau / 360
    guard = Guard({**settings["robot"], "scanner_offset": None}, 0.2)
    x, step, box = 0.0, 0.06, 1.0
    for i in range(40):
        moved = (step, 0.0, 0.0) if i else (0.0, 0.0, 0.0)
        guard.see(box_ahead(None, box - x, is_lost), angles, moved)
        if guard.blocked(0.3, 0.0, 0.3, (0.0, 0.0, 0.0)):
            break
        x += step
    gap = box - x - guard.radius
    assert 0.0 < gap < 0.2
    # Turned away, it is beside the robot; once its direction reads again, it is gone.
    guard.see(box_ahead(None, 9.0, False) * math.nan, angles, (0.0, 0.0, -math.pi / 2))
    assert not guard.blocked(0.3, 0.0, 0.3, (0.0, 0.0, 0.0))
    assert len(guard.points)
    guard.see(np.full(360, math.inf), angles, (0.0, 0.0, math.pi / 2))
    assert not len(guard.points)


def test_a_stuck_robot_stops_until_it_is_started(make_core, robot):
    """Its wheels turn, or do not; the pose stays, and no scan shows why."""
    core = make_core()
    reading = robot.read()
    for i in range(40):
        core.pose(0.1 * i, *reading.pose)
        core.scan(0.1 * i, robot.layout, reading.ranges)
        command = core.tick(0.1 * i, 0.0)
    assert command.v == 0.0
    assert command.reason.startswith("the robot is stuck: it moved 0.00 m in 2 s")
    assert core.start(4.0)[0]
    core.pose(4.0, *reading.pose)
    core.scan(4.0, robot.layout, reading.ranges)
    assert core.tick(4.0, 0.0).state == "driving"


def test_a_robot_that_moves_by_itself_stops_the_drive(make_core, robot):
    """As where the driver keeps its last command, or somebody pushes it."""
    core = make_core()
    drive(core, robot, 0.5)
    core.stop()
    drive(core, robot, 3.0)
    core.start(robot.time)
    core.stop()
    begin, (x, y, yaw) = robot.time, map(float, robot.read().pose)
    for i in range(40):
        now = begin + 0.1 * i
        core.pose(now, x + 0.008 * i, y, yaw)
        core.scan(now, robot.layout, robot.read().ranges)
        core.tick(now, 0.0)
    assert core.where.strays.startswith("the robot moves by itself: it moved 0.1")


def test_a_usual_drive_strays_never(make_core, robot):
    """Turns, stops and noise of the pose are no reason."""
    random = np.random.default_rng(3)
    way = iter(range(10_000))

    def policy(_):
        i = next(way)
        return "action", ((0.0, 0.0) if i % 60 > 40 else (0.5, -0.5 + (i % 60) / 40))

    core = make_core(policy, any_start=True)
    for _ in range(600):
        x, y, yaw = map(float, robot.read().pose)
        noise = random.normal(0.0, 0.005, 2)
        core.pose(robot.time, x + noise[0], y + noise[1], yaw)
        core.scan(robot.time, robot.layout, robot.read().ranges)
        command = core.tick(robot.time, 0.0)
        robot.obey(command.v, command.omega)
        robot.step()
        if robot.over:
            break
    assert core.where.strays == ""


def test_a_plan_that_took_long_needs_another_call(make_core, robot):
    """Who called may have gone to the robot meanwhile."""
    core = make_core(start_on="service")
    drive(core, robot, 0.3)
    core._policy.waits = True
    assert core.start(robot.time - robot.dt)[0]
    drive(core, robot, 6.0)
    core._policy.waits = False
    last = drive(core, robot, 1.0)[-1]
    assert (last.v, last.state) == (0.0, "waiting")
    assert core.start(robot.time - robot.dt)[0]
    assert drive(core, robot, 0.1)[-1].state == "driving"


def test_a_timer_that_is_not_known_to_work_stops_the_drive(make_core, robot):
    """Such as a smoother that does not answer any more."""
    core = make_core()
    drive(core, robot, 0.5)
    core.timer_unfit = "no answer of velocity_smoother (dead_man_node): is it dead?"
    assert drive(core, robot, 0.2)[-1].v == 0.0
    core.timer_unfit = ""
    assert drive(core, robot, 0.5)[-1].state == "stopped"
    assert core.start(robot.time)[0]
