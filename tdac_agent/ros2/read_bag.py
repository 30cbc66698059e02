"""Reads what a drive needs of a bag: scans, transforms, poses, commands, the clock."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.storage.files import open_regular
from tdac_envs.core.errors import one_line_reason
from tdac_envs.core.extras import install_command

SCAN, TF = "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
CLOCK = "rosgraph_msgs/msg/Clock"
WANTED = (SCAN, TF, TWIST, TWIST_STAMPED, POSE, POSE_COVARIANCE, CLOCK)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A message of a bag.

    Attributes:
        topic: Its topic.
        kind: Its type, one of `WANTED`.
        time: When it was recorded, s.
        message: The message.
    """

    topic: str
    kind: str
    time: float
    message: Any


def read_bag(path: Path) -> Iterator[Recorded]:
    """Yields the messages of a bag in the order of their times.

    Args:
        path: Folder of rosbag2 (with `metadata.yaml`), or an `.mcap` file.

    Raises:
        RunError: It is no bag, or it is damaged.
    """
    if not all(importlib.util.find_spec(name) for name in ("mcap", "rosbags")):
        raise RunError(f"bags need mcap and rosbags: {install_command('ros2')}")
    if not path.exists():
        raise RunError(f"no bag {str(path)!r}: no such file or folder")
    try:
        yield from _decoded(_folder(path) if path.is_dir() else _file(path))
    except RunError:
        raise
    # Readers of damaged files raise nearly anything.
    except Exception as error:
        reason = one_line_reason(error) or type(error).__name__
        raise RunError(f"{path} is not a readable bag: {reason}") from None


Raw = tuple[str, str, int, bytes]
"""Topic, type, nanoseconds, CDR."""


def _decoded(messages: Iterator[Raw]) -> Iterator[Recorded]:
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY)
    for topic, kind, nanoseconds, data in messages:
        if kind in WANTED:
            message = types.deserialize_cdr(data, kind)
            yield Recorded(topic, kind, 1e-9 * nanoseconds, message)


def _folder(path: Path) -> Iterator[Raw]:
    from rosbags.rosbag2 import Reader

    if not (path / "metadata.yaml").is_file():
        raise RunError(
            f"{path} is not a bag: expected a folder with metadata.yaml, as `ros2 bag "
            "record` writes it, or an .mcap file"
        )
    with Reader(path) as reader:
        for connection, nanoseconds, data in reader.messages():
            yield connection.topic, connection.msgtype, nanoseconds, bytes(data)


def _file(path: Path) -> Iterator[Raw]:
    from mcap.reader import make_reader

    if path.suffix != ".mcap":
        raise RunError(f"{path} is not a bag: expected a folder or an .mcap file")
    with open_regular(path) as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema is not None and channel.message_encoding == "cdr":
                yield channel.topic, schema.name, message.log_time, message.data
