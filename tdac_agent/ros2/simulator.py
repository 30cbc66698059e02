"""A simulated robot over DDS: /scan, /odom, /tf, /map, /clock out, /cmd_vel in."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tdac_agent.ros2 import messages as msg
from tdac_agent.ros2.bag import BEGIN, Bag
from tdac_agent.ros2.dds import Bus, time_of
from tdac_agent.ros2.faults import LATE, Course, Fault
from tdac_agent.ros2.package.motion import compose, inverse
from tdac_agent.ros2.robot import Robot

Pose = tuple[float, float, float]
JUMP = (0.2, 0.22, 0.3)
"""A wrong pose: 0.3 m and 0.3 rad, in the robot's frame."""
SURE, UNSURE = 0.0004, 1.0
"""Variances of x and y that the localiser states, m²."""
PATIENCE = 5.0
"""Longest wait for a command in simulated time, s of the wall clock."""
IMPATIENCE = 0.05
"""The same after a command that did not come."""
REPEAT = 0.3
"""Time after which the messages of a tick without a command are sent again, s."""
DISCOVERY = 0.3
"""Time in which other processes notice a writer, s."""
IDLE_SECONDS = 60.0
"""Longest wait for the first motion, s of the wall clock."""
LAST_TICKS = 20
"""Periods in which the node may notice that the goal is reached."""


@dataclass(frozen=True, slots=True)
class DriveReport:
    """How a simulated drive went.

    Attributes:
        outcome: `reached`, `contact`, `out of time` or `no command`.
        contact: What was touched, or an empty text.
        steps: Control periods since the first motion.
        commands: Commands that arrived in them.
        stops: How often the robot came to a stand before the end.
        way: Driven path, m.
        smallest_gap: Smallest gap to an obstacle, m.
        faults: What the robot did in each fault.
    """

    outcome: str
    contact: str
    steps: int
    commands: int
    stops: int
    way: float
    smallest_gap: float
    faults: tuple[dict[str, Any], ...]


class Simulator:
    """Publishes what a robot senses, and drives it as it is commanded.

    In simulated time, each control period waits for a command, so that the node's speed
    does not matter. The clock runs while the robot waits for its first command.

    Args:
        robot: The robot.
        bus: Where it publishes.
        real_time: Whether it drives in real time, whatever the node does.
        faults: What goes wrong.
        patience: Longest wait for a command in simulated time, s; after as long without
            one, in either time, `say` is told so.
        watch: Called with the robot after each period.
        bag: What is published and commanded is written to it.
        say: Called with a sentence when it waits.
    """

    def __init__(
        self,
        robot: Robot,
        bus: Bus,
        *,
        real_time: bool = False,
        faults: tuple[Fault, ...] = (),
        patience: float = PATIENCE,
        watch: Callable[[Robot], None] | None = None,
        bag: Bag | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._robot, self._bus, self._real = robot, bus, real_time
        self._courses = [Course(fault) for fault in faults]
        self._active: set[str] = set()
        self._patience, self._watch, self._bag = patience, watch, bag
        self._say, self._heard, self._has_said = say, time.monotonic(), False
        names = ("scan", "odom", "tf", "tf_static", "map", "amcl_pose", "clock")
        self._out = {name: bus.writer(name) for name in names}
        self._commands = bus.reader("cmd_vel")
        self._other: Any = None
        x, y, yaw = map(float, robot.read().pose)
        self._start: Pose = x, y, yaw
        self._held: deque[tuple[float, Any]] = deque()
        self._last_scan: Any = None
        self._clock = time.time() if real_time else BEGIN
        self._sent: list[tuple[str, Any]] = []
        self._is_patient = self._moves = False
        self._answered = -1.0
        self._steps = self._received = self._stops = 0
        self._tell_static()

    def run(self, seconds: float) -> DriveReport:
        """Drives until the goal, a contact, or for so many simulated seconds.

        Before the first motion it waits for at most `IDLE_SECONDS`.
        """
        self._heard = time.monotonic()
        if not self._wait_for_motion():
            return self._report("no command")
        self._is_patient = True
        due = time.monotonic()
        while not self._robot.over and self._robot.time < seconds:
            self._period()
            if self._robot.over:
                break
            self._publish()
            if self._real:
                due += self._robot.dt
                self._sleep_until(due)
                # A machine that was busy does not stop the robot.
                while due + self._robot.dt <= time.monotonic():
                    self._period()
                    due += self._robot.dt
            else:
                self._await()
            self._note_silence()
        self._let_end()
        robot = self._robot
        if robot.contact:
            return self._report("contact")
        return self._report("reached" if robot.reached else "out of time")

    def _wait_for_motion(self) -> bool:
        end = time.monotonic() + IDLE_SECONDS
        while time.monotonic() < end:
            self._publish()
            if self._real:
                self._sleep_until(time.monotonic() + self._robot.dt)
            else:
                self._await()
                self._clock += 0.0 if self._moves else self._robot.dt
            if self._moves:
                return True
            self._note_silence()
        return False

    def _note_silence(self) -> None:
        """Says once what it waits for when no command has come for some time."""
        silent = time.monotonic() - self._heard
        if self._has_said or silent < self._patience:
            return
        self._has_said = True
        wanted = (
            f"it waits at most {IDLE_SECONDS:g} s for a node, such as tdac ros drive"
        )
        if self._moves:
            wanted = "it waits for another node if its own has ended; Ctrl-C ends it"
        self._say(f"no command on /cmd_vel for {silent:.0f} s: {wanted}")

    def _period(self) -> None:
        """Drives for a control period."""
        robot, stood = self._robot, self._robot.stands
        self._take()
        robot.step()
        self._steps += 1
        self._clock += robot.dt
        self._stops += robot.stands and not stood and not robot.over
        own, self._active = self._active, set()
        for course in self._courses:
            if course.note(robot.time, robot.way, stands=robot.stands):
                self._active.add(course.fault.kind)
        if ("second-publisher" in own) != ("second-publisher" in self._active):
            self._other = None if self._other else self._bus.writer("cmd_vel")
            time.sleep(DISCOVERY)
        if self._watch is not None:
            self._watch(robot)

    def _take(self) -> bool:
        """Obeys the last command that has arrived; whether there was one."""
        taken = self._commands.take()
        if not taken:
            return False
        self._heard, self._has_said = time.monotonic(), False
        for each in taken:
            self._record("cmd_vel", each)
        self._answered = 1e-9 * taken[-1].sample_info.source_timestamp
        twist = taken[-1].twist if self._bus.stamped else taken[-1]
        v, omega = twist.linear.x, twist.angular.z
        self._moves = self._moves or bool(v or omega)
        if self._moves:
            self._received += 1
            self._robot.obey(v, omega)
        return True

    def _await(self) -> None:
        """Waits for the command of this period.

        A node of `tdac ros drive` says which tick of the clock it answers, so that a
        late answer to an earlier tick is not taken for that of this one. The drive then
        has the commands of the verified episode, however slow the machine is.
        """
        begins = not self._moves and self._bus.publishers("cmd_vel") > 0
        is_patient = self._is_patient or begins
        end = time.monotonic() + (self._patience if is_patient else IMPATIENCE)
        again = time.monotonic() + REPEAT
        while True:
            if self._take():
                self._is_patient = True
                if self._answered > self._clock - 0.5 * self._robot.dt:
                    return
                end = time.monotonic() + self._patience
            if time.monotonic() > end:
                self._is_patient = False
                return
            if time.monotonic() > again:  # a message of this tick may be lost
                self._repeat()
                again = time.monotonic() + REPEAT
            time.sleep(0.0003)

    def _sleep_until(self, due: float) -> None:
        while (rest := due - time.monotonic()) > 0.0:
            self._take()
            time.sleep(min(rest, 0.005))

    def _let_end(self) -> None:
        """Shows the robot where it stands, until the node has sent its last zero."""
        received = self._received
        for tick in range(LAST_TICKS):
            self._clock += self._robot.dt
            self._active = set()
            self._publish()
            if tick == 0 and not self._real:
                self._await()
            self._sleep_until(time.monotonic() + 0.02)
        self._received = received

    def _publish(self) -> None:
        self._sent = []
        now = time.time() if self._real else self._clock
        reading, stamp = self._robot.read(), time_of(now)
        x, y, yaw = map(float, reading.pose)
        own = compose(inverse(self._start), (x, y, yaw))
        if "no-poses" not in self._active:
            self._tell_pose(stamp, own)
        scan = self._scan(stamp, reading.ranges)
        self._held.append((now, scan))
        late = LATE if "late-scans" in self._active else 0.0
        while self._held and self._held[0][0] <= now - late + 1e-9:
            _, scan = self._held.popleft()
            if "old-scans" in self._active and self._last_scan is not None:
                scan = self._last_scan
            if "no-scans" not in self._active:
                self._send("scan", scan)
                self._last_scan = scan
        if not self._real:
            self._send("clock", msg.Clock(stamp))

    def _repeat(self) -> None:
        for name, message in self._sent:
            self._out[name].write(message)

    def _send(self, name: str, message: Any) -> None:
        self._sent.append((name, message))
        self._out[name].write(message)
        self._record(name, message)

    def _record(self, name: str, message: Any) -> None:
        if self._bag is not None:
            now = time.time() if self._real else self._clock
            kind = msg.ros_name(type(message))
            self._bag.write_data(f"/{name}", now, kind, message.serialize())

    def _scan(self, stamp: Any, ranges: Any) -> Any:
        layout, values = self._robot.layout, ranges.astype(np.float64)
        if "nan-scans" in self._active:
            values[:] = math.nan
        elif "zero-scans" in self._active:
            values[:] = 0.0
        elif "some-nan" in self._active:
            values[::10] = math.nan
        last = layout.first + layout.step * (layout.count - 1)
        return msg.LaserScan(
            msg.Header(stamp, "base_scan"),
            layout.first,
            last,
            layout.step,
            0.0,
            self._robot.dt,
            layout.range_min,
            layout.range_max,
            values.tolist(),
        )

    def _tell_pose(self, stamp: Any, own: Pose) -> None:
        """Publishes the odometry, which begins at zero, and where it began."""
        begin = self._start
        if "pose-jump" in self._active:
            begin = compose(compose(begin, own), compose(JUMP, inverse(own)))
        v, omega = self._robot.twist()
        self._send(
            "odom",
            msg.Odometry(
                msg.Header(stamp, "odom"),
                "base_link",
                msg.PoseWithCovariance(msg.Pose(msg.Point(*own[:2]), _turn(own[2]))),
                msg.TwistWithCovariance(
                    msg.Twist(msg.Vector3(v), msg.Vector3(0.0, 0.0, omega))
                ),
            ),
        )
        moving = [_transform(stamp, "map", "odom", begin)]
        moving.append(_transform(stamp, "odom", "base_link", own))
        self._send("tf", msg.TFMessage(moving))
        place = compose(begin, own)
        spread = [0.0] * 36
        spread[0] = spread[7] = UNSURE if "unsure-pose" in self._active else SURE
        pose = msg.Pose(msg.Point(*place[:2]), _turn(place[2]))
        unsure = msg.PoseWithCovariance(pose, spread)
        header = msg.Header(stamp, "map")
        self._send("amcl_pose", msg.PoseWithCovarianceStamped(header, unsure))

    def _tell_static(self) -> None:
        offset = self._robot.settings["robot"].get("scanner_offset") or (0.0, 0.0)
        mount = (float(offset[0]), float(offset[1]), 0.0)
        static = _transform(time_of(0.0), "base_link", "base_scan", mount)
        self._send("tf_static", msg.TFMessage([static]))
        self._send("map", self._map())

    def _map(self) -> Any:
        """The map as a map server publishes it; its first row is the lowest one."""
        own, cells = self._robot.settings["map"], self._robot.cells
        (width, height), (x, y, yaw) = own["size"], own["origin"]
        header, origin = (
            msg.Header(frame_id="map"),
            msg.Pose(msg.Point(x, y), _turn(yaw)),
        )
        info = msg.MapMetaData(header.stamp, own["resolution"], width, height, origin)
        data = np.where(cells[::-1], 100, 0).reshape(-1).tolist()
        return msg.OccupancyGrid(header, info, data)

    def _report(self, outcome: str) -> DriveReport:
        robot = self._robot
        faults = tuple(
            {**asdict(each.fault), "way": round(each.way, 4), "stood": each.stood}
            for each in self._courses
        )
        return DriveReport(
            outcome,
            robot.contact,
            self._steps,
            self._received,
            self._stops,
            round(robot.way, 4),
            round(robot.smallest_gap(), 5),
            faults,
        )


def _turn(yaw: float) -> Any:
    return msg.Quaternion(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


def _transform(stamp: Any, parent: str, child: str, pose: Pose) -> Any:
    place = msg.Vector3(pose[0], pose[1], 0.0)
    transform = msg.Transform(place, _turn(pose[2]))
    return msg.TransformStamped(msg.Header(stamp, parent), child, transform)
