"""An episode as an MCAP file with ROS 2 messages, for Foxglove and RViz."""

from __future__ import annotations

import importlib.util
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.environments.map2d.setting import Map2DSetting
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.ros2.package.motion import Wheels
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task
from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command
from tdac_envs.grid.map_units import MapUnits

BEGIN = 1.0
"""Time of the start, s: at 0, tf means the latest time."""
SUFFIX = ".mcap"


def check_packages(path: Path) -> None:
    """Checks before the work begins that a bag can be written.

    Raises:
        TaskError: It cannot.
    """
    if path.suffix != SUFFIX:
        raise TaskError(f"--mcap must end in {SUFFIX}, got {path.name!r}")
    if not all(importlib.util.find_spec(name) for name in ("mcap", "rosbags")):
        raise TaskError(f"--mcap needs mcap and rosbags: {install_command('ros2')}")


def check_bag(task: Task, path: Path) -> None:
    """Like `check_packages`, also of the task whose episodes are to be written.

    Raises:
        TaskError: They cannot.
    """
    check_packages(path)
    _units(task)


def write_bag(path: Path, task: Task, rollout: Rollout) -> None:
    """Writes an episode of a task on a map with a resolution.

    Topics: `/map`, `/goal`, `/plan` (the shortest path), `/path` (as driven), `/tf`,
    `/tf_static`, `/pose`, `/scan`, `/cmd_vel`, `/contacts` and `/movers`. Times begin
    at 1 s. The true pose is written, and the ranges as observed.

    Args:
        path: The file.
        task: The task.
        rollout: Its episode.

    Raises:
        TaskError: The task has no metres, or a package is missing.
    """
    check_bag(task, path)
    bag, units = Bag(), _units(task)
    setting = task.setting
    assert isinstance(setting, Map2DSetting)
    scale, trajectory = units.per_pixel, rollout.trajectory
    poses = _poses(trajectory.poses, units)
    bag.static(BEGIN, setting, scale)
    plan = setting.nominal.shortest_path(setting.nominal.start)
    ways = {
        "/plan": [(*units.coordinates(x, y), 0.0) for x, y in plan.tolist()],
        "/path": poses,
    }
    for topic, way in ways.items():
        stamped = [bag.pose_stamped(BEGIN, pose) for pose in way]
        bag.add(topic, BEGIN, "nav_msgs/msg/Path", bag.header(BEGIN, "map"), stamped)
    goal = bag.pose_stamped(BEGIN, (*units.coordinates(*rollout.goal), 0.0))
    bag.write("/goal", BEGIN, goal)
    wheels = _wheels(setting, scale, trajectory.dt)
    angles = 0.0 - np.asarray(setting.nominal.robot.angles(), np.float64)
    for step, pose in enumerate(poses):
        time = BEGIN + step * trajectory.dt
        bag.moment(time, pose)
        bag.scan(time, angles, trajectory.ranges[step] * scale, setting, trajectory.dt)
        if trajectory.movers is not None:
            discs = trajectory.movers[step][:, :2].tolist()
            bag.places("/movers", time, [units.coordinates(x, y) for x, y in discs])
        if step < trajectory.steps:
            v, omega = wheels.twist(
                *wheels.limited(*map(float, trajectory.actions[step]))
            )
            bag.twist("/cmd_vel", time, v, omega)
    end = BEGIN + trajectory.steps * trajectory.dt
    bag.twist("/cmd_vel", end, 0.0, 0.0)
    if trajectory.collisions:
        bag.places("/contacts", end, [poses[-1][:2]])
    write_atomic(path, bag.finish())


def _units(task: Task) -> MapUnits:
    setting = task.setting
    if not isinstance(setting, Map2DSetting) or setting.params.resolution is None:
        raise TaskError(
            f"--mcap: {task.name} has no metres, which ROS messages need: use a task "
            "on a map with a resolution"
        )
    return MapUnits.metres(setting.params)


def _poses(
    poses: NDArray[np.float64], units: MapUnits
) -> list[tuple[float, float, float]]:
    """Poses in px, shape (n, 3), in metres of the map's frame."""
    return [
        (*units.coordinates(x, y), units.heading(yaw)) for x, y, yaw in poses.tolist()
    ]


def _wheels(setting: Map2DSetting, scale: float, dt: float) -> Wheels:
    """The wheels of the robot, in metres."""
    robot = setting.nominal.robot
    lengths = ("max_wheel_speed", "axle_length", "max_acceleration", "max_speed")
    own = {name: (getattr(robot, name) or 0.0) * scale for name in lengths}
    for name in ("max_turn_rate", "max_turn_acceleration"):
        own[name] = getattr(robot, name) or 0.0
    return Wheels(own, dt)


class Bag:
    """An MCAP file in memory; each topic is registered with its first message."""

    def __init__(self) -> None:
        from mcap.writer import Writer
        from rosbags.typesys import Stores, get_typestore

        self._types = get_typestore(Stores.ROS2_HUMBLE)
        self._file = io.BytesIO()
        self._writer: Any = Writer(self._file)
        self._writer.start(profile="ros2")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def make(self, name: str, *values: Any) -> Any:
        """A message of `geometry_msgs/msg/Point` … with these fields."""
        return self._types.types[name](*values)

    def add(self, topic: str, time: float, name: str, *values: Any) -> None:
        """Writes a message with these fields."""
        self.write(topic, time, self.make(name, *values))

    def write(self, topic: str, time: float, message: Any) -> None:
        """Writes a message."""
        name = message.__msgtype__
        self.write_data(topic, time, name, self._types.serialize_cdr(message, name))

    def write_data(self, topic: str, time: float, name: str, data: Any) -> None:
        """Writes a message of a type as CDR."""
        if name not in self._schemas:
            text = self._types.generate_msgdef(name, ros_version=2)[0].encode()
            self._schemas[name] = self._writer.register_schema(name, "ros2msg", text)
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(
                topic, "cdr", self._schemas[name], _profile(topic)
            )
        when = round(time * 1e9)
        self._writer.add_message(self._channels[topic], when, bytes(data), when)

    def finish(self) -> bytes:
        """The file."""
        self._writer.finish()
        return self._file.getvalue()

    def header(self, time: float, frame: str) -> Any:
        """A header; times are whole nanoseconds."""
        nanoseconds = round(time * 1e9)
        parts = nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000
        stamp = self.make("builtin_interfaces/msg/Time", *parts)
        return self.make("std_msgs/msg/Header", stamp, frame)

    def point(self, x: float, y: float) -> Any:
        """A point on the floor."""
        return self.make("geometry_msgs/msg/Point", float(x), float(y), 0.0)

    def vector(self, x: float, y: float, z: float = 0.0) -> Any:
        """A vector."""
        return self.make("geometry_msgs/msg/Vector3", float(x), float(y), float(z))

    def turn(self, yaw: float) -> Any:
        """The quaternion of a yaw."""
        half = 0.5 * yaw
        parts = 0.0, 0.0, math.sin(half), math.cos(half)
        return self.make("geometry_msgs/msg/Quaternion", *parts)

    def pose(self, pose: Sequence[float]) -> Any:
        """A pose of x, y, yaw."""
        place = self.point(pose[0], pose[1])
        return self.make("geometry_msgs/msg/Pose", place, self.turn(pose[2]))

    def pose_stamped(self, time: float, pose: Sequence[float]) -> Any:
        """A pose on the map."""
        header = self.header(time, "map")
        return self.make("geometry_msgs/msg/PoseStamped", header, self.pose(pose))

    def places(
        self, topic: str, time: float, places: Sequence[Sequence[float]]
    ) -> None:
        """Writes places on the map."""
        poses = [self.pose((*place, 0.0)) for place in places]
        header = self.header(time, "map")
        self.add(topic, time, "geometry_msgs/msg/PoseArray", header, poses)

    def twist(self, topic: str, time: float, v: float, omega: float) -> None:
        """Writes a command."""
        parts = self.vector(v, 0.0), self.vector(0.0, 0.0, omega)
        self.add(topic, time, "geometry_msgs/msg/Twist", *parts)

    def transform(
        self, topic: str, time: float, frames: tuple[str, str], pose: Sequence[float]
    ) -> None:
        """Writes the pose of a frame in another one."""
        place = self.vector(pose[0], pose[1])
        own = self.make("geometry_msgs/msg/Transform", place, self.turn(pose[2]))
        header = self.header(time, frames[0])
        stamped = self.make(
            "geometry_msgs/msg/TransformStamped", header, frames[1], own
        )
        self.add(topic, time, "tf2_msgs/msg/TFMessage", [stamped])

    def moment(self, time: float, pose: Sequence[float]) -> None:
        """Writes where the robot is."""
        self.transform("/tf", time, ("map", "base_link"), pose)
        self.write("/pose", time, self.pose_stamped(time, pose))

    def static(self, time: float, setting: Map2DSetting, scale: float) -> None:
        """Writes the map, and where the scanner is."""
        ahead, right = setting.nominal.robot.scanner_offset or (0.0, 0.0)
        mount = ahead * scale, -right * scale, 0.0
        self.transform("/tf_static", time, ("base_link", "base_scan"), mount)
        grid = setting.nominal.terrain.grid
        header = self.header(time, "map")
        info = self.make(
            "nav_msgs/msg/MapMetaData",
            header.stamp,
            scale,
            grid.width,
            grid.height,
            self.pose(grid.origin),
        )
        # The first row of a message is the lowest one of the map.
        cells = np.where(grid.cells[::-1], 100, 0).astype(np.int8).reshape(-1)
        self.add("/map", time, "nav_msgs/msg/OccupancyGrid", header, info, cells)

    def scan(
        self,
        time: float,
        angles: NDArray[np.float64],
        ranges: NDArray[Any],
        setting: Map2DSetting,
        dt: float,
    ) -> None:
        """Writes a scan; no return is inf."""
        robot, scale = setting.nominal.robot, MapUnits.metres(setting.params).per_pixel
        most = robot.range_max * scale
        step = (
            math.remainder(angles[1] - angles[0], math.tau) if len(angles) > 1 else 0.1
        )
        values = np.where(ranges >= most * (1.0 - 1e-6), np.inf, ranges)
        self.add(
            "/scan",
            time,
            "sensor_msgs/msg/LaserScan",
            self.header(time, "base_scan"),
            float(angles[0]),
            float(angles[0] + step * (len(angles) - 1)),
            step,
            0.0,
            dt,
            float(robot.range_min or 0.0) * scale,
            float(most),
            values.astype(np.float32),
            np.zeros(0, np.float32),
        )


def _profile(topic: str) -> dict[str, str]:
    """Quality of service as rosbag2 records it, so that a player latches the map."""
    if topic not in {"/map", "/tf_static", "/plan", "/path", "/goal"}:
        return {}
    return {"offered_qos_profiles": _LATCHED}


_LATCHED = """- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
