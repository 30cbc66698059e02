"""Compares a recorded drive with its controller: commands, gap and stops."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.errors import RunError
from tdac_agent.evaluation.policy import Policy
from tdac_agent.ros2.export import core_settings, settings_of
from tdac_agent.ros2.map_gap import map_gap
from tdac_agent.ros2.package.core import PERIODS, Core
from tdac_agent.ros2.package.motion import compose, yaw_of
from tdac_agent.ros2.package.scans import Layout
from tdac_agent.ros2.read_bag import (
    CLOCK,
    POSE_COVARIANCE,
    TF,
    TWIST_STAMPED,
    Recorded,
    Topics,
    counts_of,
    read_bag,
    topics_of,
)
from tdac_agent.sandbox import ControllerFault
from tdac_agent.tasks.task import Task

SAME = 1e-3
"""Largest difference of equal commands, as a share of the full speeds."""
APART = 5.0
"""Stamps that differ more from the times of recording are of another clock, s."""
MOST = 1e6
"""Number below which places (m), speeds (m/s) and turn rates (rad/s) are."""
STANDS = 5e-4
"""Way between two poses below which the robot stands, m or rad."""
MOST_SHOWN = 10
MOST_HOPS = 20
"""Most frames between a robot and its map."""
BASES = ("base_link", "base_footprint")
Pose = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Difference:
    """A command that is not the controller's.

    Attributes:
        time: Time since the first motion, s.
        recorded: Speed (m/s) and turn rate (rad/s) as recorded.
        replayed: Those of the controller.
        state: State of the replayed node, with its reason.
    """

    time: float
    recorded: tuple[float, float]
    replayed: tuple[float, float]
    state: str


@dataclass(frozen=True, slots=True)
class RecordedReport:
    """What a bag shows of a drive.

    Attributes:
        seconds: From the first to the last motion.
        commands: Recorded commands in this time.
        same: How many of them are the controller's.
        stood: How many are zero where the controller would have driven.
        differences: The first of the others.
        different: Number of the others, with those that are not finite or huge.
        stops: How often the commands stopped the robot on the way.
        stopped: How long, s.
        way: Driven path by the poses, m.
        map_gap: Smallest gap to the map by the poses, m; None beyond `map_gap.REACH`.
        scan_gap: Smallest gap by the scans, m; None without a return.
        place: Where the map's gap was smallest: x, y, m.
        rolled: From the last command, if it was a motion, to the last pose that
            moved, s: what `dead_man` must cover. None if the drive ended with a zero,
            or the bag before the robot.
        outcome: State of the replayed node at the end.
    """

    seconds: float
    commands: int
    same: int
    stood: int
    differences: tuple[Difference, ...]
    different: int
    stops: int
    stopped: float
    way: float
    map_gap: float | None
    scan_gap: float | None
    place: tuple[float, float] | None
    rolled: float | None
    outcome: str

    @property
    def passed(self) -> bool:
        """Whether no command differs, and nothing was touched by poses or scans."""
        gaps = [gap for gap in (self.map_gap, self.scan_gap) if gap is not None]
        return self.different == 0 and min(gaps, default=1.0) > 0.0


def compare(
    bag: Path, source: bytes, task: Task, *, tier: str = "auto"
) -> RecordedReport:
    """Replays a controller, in its sandbox, on what a bag has.

    Args:
        bag: The bag; see `read_bag`.
        source: The controller.
        task: Its task, in metres.
        tier: Sandbox tier.

    Raises:
        RunError: The bag cannot be read, or lacks scans, poses or commands.
        TaskError: The task is not one that a robot drives.
    """
    settings = settings_of(task)
    messages = read_bag(bag)
    topics = topics_of(bag, messages)
    with Policy(source, task, tier) as policy:
        robot = settings["robot"]
        rays = {len(robot["ray_angles"])}
        own = core_settings(
            settings,
            dead_man=PERIODS * settings["dt"],
            any_start=True,
            recover=True,  # a bag has no calls of services
            # A node drives with other scans only if it has this parameter.
            resample_scan=robot["is_scanner"]
            and counts_of(messages, topics.scan) != rays,
        )
        drive = _Drive(Core(own, _Sandboxed(policy)), settings, topics)
        for each in messages:
            drive.take(each)
    if drive.poses == []:
        raise RunError(f"{bag} has no pose: tf from map to base_link, or a pose topic")
    return drive.report(task)


class _Sandboxed:
    """A controller in its sandbox, as the core asks it."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._observation: dict[str, Any] = {}

    def ask(self, observation: dict[str, Any]) -> None:
        self._observation = observation

    def answer(self, wait: float) -> tuple[str, Any] | None:  # noqa: ARG002
        try:
            left, right = map(float, self._policy(self._observation))
        except (ControllerFault, ValueError) as error:
            return "error", str(error)
        return "action", (left, right)


class _Drive:
    """The state of a replay: what has been read, and what the core says to it."""

    def __init__(self, core: Core, settings: dict[str, Any], topics: Topics) -> None:
        self._core, self._settings, self._topics = core, settings, topics
        self._frames: dict[str, tuple[str, Pose]] = {}
        self._shift: float | None = None
        self._now = 0.0
        self._began: float | None = None
        self.poses: list[tuple[float, Pose]] = []
        self._commands: list[tuple[float, float, float]] = []
        self._found: list[Difference] = []
        self._same = self._stood = self._impossible = 0
        self._gap = math.inf
        self._last = ""

    def take(self, each: Recorded) -> None:
        """Takes the next message."""
        kind, message = each.kind, each.message
        if kind == CLOCK:
            self._now = _seconds(message.clock)
        elif not self._topics.has_clock and self._shift is not None:
            self._now = each.time - self._shift
        if kind == TF:
            for transform in message.transforms:
                self._place(transform)
        elif each.topic == self._topics.pose:
            pose = message.pose.pose if kind == POSE_COVARIANCE else message.pose
            self._pose(
                _seconds(message.header.stamp), _flat(pose.position, pose.orientation)
            )
        elif each.topic == self._topics.scan:
            self._scan(each.time, message)
        elif each.topic == self._topics.command:
            twist = message.twist if kind == TWIST_STAMPED else message
            self._command(float(twist.linear.x), float(twist.angular.z))

    def _scan(self, time: float, message: Any) -> None:
        stamp = _seconds(message.header.stamp)
        if self._shift is None:
            self._shift = time - stamp if abs(time - stamp) > APART else 0.0
            if not self._topics.has_clock:
                self._now = time - self._shift
        yaw = self._frames.get(message.header.frame_id, ("", (0.0, 0.0, 0.0)))[1][2]
        layout = Layout(
            len(message.ranges),
            float(message.angle_min),
            float(message.angle_increment),
            float(message.range_min),
            float(message.range_max),
            yaw,
        )
        self._core.scan(stamp, layout, message.ranges)
        if self._began is not None:
            self._see(layout, np.asarray(message.ranges, np.float64))

    def _see(self, layout: Layout, ranges: NDArray[np.float64]) -> None:
        """Notes the smallest gap between the body and what a scan shows."""
        robot = self._settings["robot"]
        if not np.isfinite(layout.angles()).all():
            return
        real = (ranges >= layout.range_min) & (ranges < layout.range_max)
        turn, length = layout.angles()[real], ranges[real]
        ahead, left = robot.get("scanner_offset") or (0.0, 0.0)
        away = np.hypot(ahead + length * np.cos(turn), left + length * np.sin(turn))
        if away.size:
            self._gap = min(self._gap, float(away.min()) - float(robot["radius"]))

    def _place(self, transform: Any) -> None:
        """Takes a transform; a new pose of the base on the map is a pose."""
        own = _flat(transform.transform.translation, transform.transform.rotation)
        child = transform.child_frame_id
        self._frames[child] = (transform.header.frame_id, own)
        base = next((name for name in BASES if name in self._frames), None)
        if base is None or self._topics.pose is not None:
            return
        frame, pose = base, (0.0, 0.0, 0.0)
        moved = False
        for _ in range(min(len(self._frames), MOST_HOPS)):
            if frame not in self._frames:
                return
            moved = moved or frame == child
            frame, above = self._frames[frame]
            pose = compose(above, pose)
            if frame == "map":
                # The motion comes with the odometry, not with its correction.
                if child == base or (moved and transform.header.frame_id != "map"):
                    self._pose(_seconds(transform.header.stamp), pose)
                return

    def _pose(self, stamp: float, pose: Pose) -> None:
        if not all(abs(each) < MOST for each in pose):
            return
        self._core.pose(stamp, *pose)
        if self._began is not None:
            self.poses.append((stamp, pose))
        elif not self.poses:
            self.poses = [(stamp, pose)]
        else:
            self.poses[0] = stamp, pose

    def _command(self, v: float, omega: float) -> None:
        """Compares a command; before the first motion there are none."""
        if not (abs(v) < MOST and abs(omega) < MOST):
            self._impossible += 1
            return
        if self._began is None and v == omega == 0.0:
            return
        if self._began is None:
            self._began = self._now
        since = self._now - self._began
        self._commands.append((since, v, omega))
        own = self._core.tick(self._now, 60.0)
        self._last = f"{own.state}: {own.reason}".rstrip(": ")
        robot = self._settings["robot"]
        speed, axle = float(robot["max_wheel_speed"]), float(robot["axle_length"])
        if (
            abs(v - own.v) <= SAME * speed
            and abs(omega - own.omega) <= SAME * 2.0 * speed / axle
        ):
            self._same += 1
        elif v == omega == 0.0:
            self._stood += 1
        else:
            there = (round(v, 5), round(omega, 5))
            here = (round(own.v, 5), round(own.omega, 5))
            self._found.append(Difference(round(since, 3), there, here, self._last))
        self._core.drove(v, omega)

    def _rolled(self) -> float | None:
        """From a last command that was a motion to the end of the motion, s."""
        if self._began is None or not self._commands or not any(self._commands[-1][1:]):
            return None
        last = self._began + self._commands[-1][0]
        moved = last
        for (_, before), (stamp, after) in pairwise(self.poses):
            off = math.dist(before[:2], after[:2]) + abs(math.sin(after[2] - before[2]))
            if off > STANDS:
                moved = max(moved, stamp)
        # The robot must have rolled on, and stand at the end of the bag.
        is_known = last < moved < self.poses[-1][0]
        return round(moved - last, 3) if is_known else None

    def report(self, task: Task) -> RecordedReport:
        """What the bag shows, at its end."""
        commands = self._commands
        moving = [time for time, v, omega in commands if v or omega]
        end = moving[-1] if moving else 0.0
        commands = [each for each in commands if each[0] <= end]
        stops, stopped = _stops(commands)
        gap, place = map_gap(task, [pose for _, pose in self.poses])
        ways = [pose[:2] for _, pose in self.poses]
        return RecordedReport(
            seconds=round(end, 3),
            commands=len(self._commands),
            same=self._same,
            stood=self._stood,
            differences=tuple(self._found[:MOST_SHOWN]),
            different=len(self._found) + self._impossible,
            stops=stops,
            stopped=round(stopped, 3),
            way=round(sum(map(math.dist, ways, ways[1:])), 4),
            map_gap=None if gap is None else round(gap, 5),
            scan_gap=None if self._gap == math.inf else round(self._gap, 5),
            place=place,
            rolled=self._rolled(),
            outcome=self._last,
        )


def _stops(commands: list[tuple[float, float, float]]) -> tuple[int, float]:
    """How often commands became zero, and how long they were."""
    count, total, since = 0, 0.0, None
    for time, v, omega in commands:
        if v == omega == 0.0:
            if since is None:
                count, since = count + 1, time
        elif since is not None:
            total, since = total + time - since, None
    return count, total


def _flat(place: Any, turn: Any) -> Pose:
    return float(place.x), float(place.y), yaw_of(turn.x, turn.y, turn.z, turn.w)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
