"""Drives an exported package over DDS, without ROS: its core, its controller."""

from __future__ import annotations

import hmac
import importlib
import math
import re
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.ros2 import messages as msg
from tdac_agent.ros2.dds import Bus, seconds_of, time_of
from tdac_agent.ros2.export import (
    CONTROLLER,
    COPIED,
    MARK,
    PACKAGE,
    SETTINGS,
    core_settings,
    mark_of,
)
from tdac_agent.ros2.package.core import PERIODS, SHARE
from tdac_agent.ros2.package.ending import send_last
from tdac_agent.storage.files import read_inside
from tdac_envs.core.intake import RECORD_BYTES, TEXT_BYTES, parse_json

OURS = "tdac_agent.ros2.package"
"""The package of the modules that are exported."""
BASE = "base_link"
"""Frame of the robot's body: the middle of its axle, x ahead."""
MOST_FRAMES = 100
"""Most frames of tf that are kept; a robot and its map have fewer."""
TOGETHER, MISSING = 1.0, 0.05
"""Longest wait for scan and pose of a tick of the clock, s of the wall clock; the same
after a tick that had none."""
ANSWER = 2.0
"""Longest wait for an answer in simulated time, s of the wall clock."""
GONE = 10.0
"""Time without a scan, after the first one, that ends the drive, s."""
CLOCK_STANDS = 10.0
"""Time after which a clock that stands still ends the drive, s of the wall clock."""


@dataclass(frozen=True, slots=True)
class _Frame:
    """A frame of tf.

    Attributes:
        parent: The frame that it is in.
        pose: Its pose there.
        tilt: Largest of x and y of its quaternion, absolute.
        stamp: Its time, s; infinite if it is static.
    """

    parent: str
    pose: tuple[float, float, float]
    tilt: float
    stamp: float

    @property
    def is_static(self) -> bool:
        """Whether it is sent once, for ever."""
        return math.isinf(self.stamp)


@dataclass(frozen=True, slots=True)
class Opened:
    """An exported package, ready to drive.

    Attributes:
        folder: Its folder.
        settings: Its settings.
        core: Its module `core`.
        motion: Its module `motion`.
        scans: Its module `scans`.
        worker: Its module `worker`.
    """

    folder: Path
    settings: dict[str, Any]
    core: ModuleType
    motion: ModuleType
    scans: ModuleType
    worker: ModuleType


def open_package(folder: Path, *, trust: bool = False) -> Opened:
    """The modules of a package, which run with the rights of this process.

    Those of a package that this installation exported are the same as tdac's own, byte
    for byte, and tdac's own are taken: nothing else in its folder runs but the
    controller, whose folder the mark covers.

    Args:
        folder: Folder of the package.
        trust: Whether a package may run that this installation did not export.

    Raises:
        RunError: It is no such package, it was changed, or it needs trust.
    """
    try:
        text = read_inside(folder, f"{CONTROLLER}/{SETTINGS}", TEXT_BYTES)
        settings = parse_json(text)
        name = settings["package"]
        if re.fullmatch(r"[a-z][a-z0-9_]*", name) is None:
            raise ValueError("package: expected the name of a package")
    except FileNotFoundError:
        raise RunError(
            f"{folder} is not a package of tdac export ros2: it has no "
            f"{CONTROLLER}/{SETTINGS}"
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunError(f"{folder}: {CONTROLLER}/{SETTINGS}: {error}") from None
    if is_own(folder, name):
        return Opened(folder, settings, *_modules(OURS))
    if not trust:
        raise RunError(
            f"{folder} was not exported by this installation, or was changed since: "
            "its code would run with your rights; read it, then give --trust"
        )
    sys.path.insert(0, str(folder.resolve()))
    try:
        return Opened(folder, settings, *_modules(name))
    except ImportError as error:
        raise RunError(f"{folder}: cannot import its modules: {error}") from None
    finally:
        sys.path.pop(0)


def _modules(package: str) -> list[ModuleType]:
    parts = "core", "motion", "scans", "worker"
    return [importlib.import_module(f"{package}.{part}") for part in parts]


def is_own(folder: Path, name: str) -> bool:
    """Whether this installation exported a package, and its code is unchanged."""
    try:
        mark = read_inside(folder, MARK, 200).decode()
        for file in COPIED:
            ours = (PACKAGE / file).read_bytes()  # raw read: shipped
            if read_inside(folder, f"{name}/{file}", RECORD_BYTES) != ours:
                return False
    except (OSError, ValueError):
        return False
    wanted = mark_of(folder)
    return bool(wanted) and hmac.compare_digest(mark, wanted)


class Node:
    """The node without ROS: messages in, one command per control period out.

    Args:
        package: The package.
        bus: The topics.
        dead_man: Time after which the robot stops by itself, s.
        sim_time: Whether the time is that of /clock; otherwise that of this machine.
        origin: Pose of the odometry's origin on the map; None for tf.
        policy: What answers; by default the package's controller in its worker.
        say: Called with each new state.
        **declared: Further settings of the core, such as `any_start`.

    Raises:
        RunError: A setting is impossible, or the controller is not the exported one.
    """

    def __init__(
        self,
        package: Opened,
        bus: Bus,
        *,
        dead_man: float,
        sim_time: bool,
        origin: tuple[float, float, float] | None = None,
        policy: Any = None,
        say: Callable[[str], None] = lambda _: None,
        **declared: Any,
    ) -> None:
        try:
            package.motion.check_pose_parameters(
                "tf" if origin is None else "odom",
                origin or (0.0, 0.0, 0.0),
            )
            settings = core_settings(
                package.settings,
                kind=package.core.Settings,
                dead_man=dead_man,
                **declared,
            )
            package.worker.check_files(package.folder / CONTROLLER)
            if policy is None:
                policy = package.worker.Worker(
                    package.folder / CONTROLLER, package.settings["controller_sha256"]
                )
        except (OSError, ValueError, KeyError) as error:
            raise RunError(str(error)) from None
        self.core = package.core.Core(settings, policy)
        self.dt = settings.dt
        self._package, self._bus, self._say = package, bus, say
        self._sim_time, self._origin = sim_time, origin
        self._scan_came, self._scan_at = False, math.inf
        names = ("scan", "odom", "tf", "tf_static", "map", "amcl_pose", "clock")
        self._in = {name: bus.reader(name) for name in names}
        self._out = bus.writer("cmd_vel")
        self._frames: dict[str, _Frame] = {}
        self._said = ""
        self._clock, self._end, self._complete = -1.0, math.inf, False

    def run(self, seconds: float | None = None) -> Any:
        """Drives until the goal or a failure; returns the last command.

        Args:
            seconds: Longest time, s of the wall clock.
        """
        end = math.inf if seconds is None else time.monotonic() + seconds
        self._end = end
        try:
            self._send(self._package.core.Command(0.0, 0.0, "waiting"))
            while self.core.final is None:
                self._tick()
                if self.core.latched:
                    self.core.end(f"{self.core.latched} (--recover drives on)")
                if time.monotonic() > end:
                    self.core.end("out of time")
        finally:
            last = self.core.end("the node was told to end")
            try:
                send_last(self._send, last, PERIODS * self.dt)
            except KeyboardInterrupt:  # a second signal ends it at once
                self._send(last)
                raise
        return last

    def _tick(self) -> None:
        if not self._sim_time:
            due = time.monotonic() + self.dt
            self._hear()
            self._decide(time.time(), SHARE * self.dt)
            while (rest := due - time.monotonic()) > 0.0:
                time.sleep(min(rest, 0.005))
                self._hear()
            return
        last, end = self._clock, time.monotonic() + CLOCK_STANDS
        while self._clock < last + self.dt - 1e-6:
            self._hear()
            time.sleep(0.0003)
            if time.monotonic() > self._end:
                return
            if last >= 0.0 and time.monotonic() > end:
                self._send(self.core.end("the clock stands still"))
                return
            if self._clock < last:  # the simulation began again
                break
        end = time.monotonic() + (TOGETHER if self._complete else MISSING)
        while not self.core.has(self._clock) and time.monotonic() < end:
            self._hear()
            time.sleep(0.0003)
        self._complete = self.core.has(self._clock)
        self._decide(self._clock, ANSWER)

    def _decide(self, now: float, wait: float) -> None:
        self.core.publishers = self._bus.publishers("cmd_vel")
        self.core.listeners = self._bus.listeners("cmd_vel")
        if self._scan_came or math.isinf(self._scan_at):
            self._scan_at = now if self._scan_came else math.inf
            self._scan_came = False
        elif now - self._scan_at > GONE:
            self.core.end(f"no scan for {GONE:g} s: the robot has gone")
        command = self.core.tick(now, wait)
        # What came meanwhile is older than the command, and needs none of its own.
        self._hear()
        self._send(command)

    def _hear(self) -> None:
        """Takes what has arrived."""
        for clock in self._in["clock"].take():
            self._clock = seconds_of(clock.clock)
        for message in self._in["map"].take():
            own = message.info
            origin = self._pose_of(own.origin, "position")
            self.core.localiser_map((own.width, own.height), own.resolution, origin)
        for name in ("tf_static", "tf"):
            for message in self._in[name].take():
                for each in message.transforms:
                    self._place(each, is_static=name == "tf_static")
        for message in self._in["odom"].take():
            if self._origin is not None:
                pose = self._package.motion.compose(
                    self._origin, self._pose_of(message.pose.pose, "position")
                )
                self.core.where.take_variances(_variances(message))
                self.core.pose(seconds_of(message.header.stamp), *pose)
        for message in self._in["amcl_pose"].take():
            if self._origin is None:
                self.core.where.take_variances(_variances(message))
        for message in self._in["scan"].take():
            mount = self._mount(message.header.frame_id)
            self._scan_came = True
            if mount is None:
                continue
            try:
                age = self._package.scans.oldest_ray(
                    len(message.ranges), message.scan_time, message.time_increment
                )
            except ValueError as error:
                self.core.refuse_scan(str(error))
                continue
            layout = self._package.scans.Layout(
                len(message.ranges),
                message.angle_min,
                message.angle_increment,
                message.range_min,
                message.range_max,
                mount,
            )
            self.core.scan(
                seconds_of(message.header.stamp), layout, message.ranges, age
            )

    def _place(self, each: Any, *, is_static: bool) -> None:
        """Takes a transform, and the pose of `BASE` on the map if it is newer now."""
        is_new = each.child_frame_id not in self._frames
        if is_new and len(self._frames) >= MOST_FRAMES:
            # Those that are not sent again stay.
            self._frames = {k: f for k, f in self._frames.items() if f.is_static}
            if len(self._frames) >= MOST_FRAMES:
                return
        turn = each.transform.rotation
        self._frames[each.child_frame_id] = _Frame(
            each.header.frame_id,
            self._pose_of(each.transform, "translation"),
            max(abs(turn.x), abs(turn.y)),
            math.inf if is_static else seconds_of(each.header.stamp),
        )
        if is_static or self._origin is not None:
            return
        found = self._way("map", BASE)
        if found is not None:
            stamp = min(frame.stamp for frame in found)
            if math.isinf(stamp):
                return
            self.core.where.take_transform(found[-1].stamp)  # infinite if it is static
            self.core.pose(stamp, *self._composed(found))

    def _way(self, top: str, frame: str) -> list[_Frame] | None:
        """The frames from one up to another above it; None if tf has no such way."""
        found: list[_Frame] = []
        while frame != top:
            own = self._frames.get(frame)
            if own is None or len(found) > MOST_FRAMES:
                return None
            found.append(own)
            frame = own.parent
        return found

    def _composed(self, way: list[_Frame]) -> tuple[float, float, float]:
        pose = 0.0, 0.0, 0.0
        for frame in way:
            pose = self._package.motion.compose(frame.pose, pose)
        return pose

    def _mount(self, frame: str) -> float | None:
        """Yaw of the scanner on the robot, as in the node; None while it is unknown."""
        found = self._way(BASE, frame)
        if found is None:
            self.core.refuse_scan(f"tf does not know where {frame:.40} is on {BASE}")
            return None
        x, y, yaw = self._composed(found)
        tilt = max((each.tilt for each in found), default=0.0)
        turn = tilt, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        try:
            mount: float = self._package.scans.mounted(
                self.core.settings.robot, (x, y), turn
            )
        except ValueError as error:
            self.core.end(str(error))
            return None
        return mount

    def _pose_of(self, pose: Any, place: str) -> tuple[float, float, float]:
        at = getattr(pose, place)
        turn = pose.orientation if place == "position" else pose.rotation
        yaw = self._package.motion.yaw_of(turn.x, turn.y, turn.z, turn.w)
        return at.x, at.y, yaw

    def _send(self, command: Any) -> None:
        twist: Any = msg.Twist(
            msg.Vector3(command.v), msg.Vector3(0.0, 0.0, command.omega)
        )
        if self._bus.stamped:
            now = self._clock if self._sim_time else time.time()
            twist = msg.TwistStamped(
                msg.Header(time_of(max(now, 0.0)), "base_link"), twist
            )
        # By this time of the sample a simulation knows which tick it answers.
        tick = round(max(self._clock, 0.0) * 1e9) + 1 if self._sim_time else None
        self._out.write(twist, tick)
        text = f"{command.state}: {command.reason}".rstrip(": ")
        if text != self._said:
            self._said = text
            self._say(text)


def _variances(message: Any) -> tuple[float, float, float]:
    """Variances of x, y and yaw of a message with a pose and its covariance."""
    own = message.pose.covariance
    return own[0], own[7], own[35]
