"""Reads what a drive needs of a bag: scans, transforms, poses, commands, the clock."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sqlite3
import stat
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.storage.files import open_regular, read_inside
from tdac_envs.core.errors import one_line_reason
from tdac_envs.core.extras import install_command
from tdac_envs.core.intake import RECORD_BYTES, parse_yaml

SCAN, TF = "sensor_msgs/msg/LaserScan", "tf2_msgs/msg/TFMessage"
OWN = "cmd_vel_tdac"
"""Topic of the commands of an exported node, by default."""
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
CLOCK = "rosgraph_msgs/msg/Clock"
MOST_BYTES = 4_000_000_000
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


@dataclass(frozen=True, slots=True)
class Topics:
    """Names of the topics that show a drive; no pose topic means tf."""

    scan: str
    command: str
    pose: str | None
    has_clock: bool


def topics_of(bag: Path, messages: list[Recorded]) -> Topics:
    """The topics of a bag that show a drive.

    Args:
        bag: The bag, for messages.
        messages: What it has.

    Raises:
        RunError: Scans, commands or poses are missing, or there are several.
    """
    kinds = Counter((each.kind, each.topic) for each in messages)

    def one(what: str, end: str, *wanted: str) -> str | None:
        names = sorted({topic for kind, topic in kinds if kind in wanted})
        best = [name for name in names if name.rstrip("/").endswith(end)]
        if end == "pose":  # other topics of poses are goals and guesses
            names = best = [name for name in best if not name.endswith("initialpose")]
        if len(best or names) > 1:
            few = ", ".join((best or names)[:5])
            raise RunError(f"{bag} has several {what}: {few}")
        return next(iter(best or names), None)

    scan = one("scans", "scan", SCAN)
    twists = TWIST, TWIST_STAMPED
    # With a smoother, /cmd_vel has its commands, and not those of the node.
    is_own = any(kind in twists and topic.endswith(OWN) for kind, topic in kinds)
    command = one("topics of commands", OWN if is_own else "cmd_vel", *twists)
    for what, name in (
        ("sensor_msgs/LaserScan", scan),
        ("geometry_msgs/Twist", command),
    ):
        if name is None:
            raise RunError(f"{bag} has no {what}: record /scan, /tf, /cmd_vel_tdac")
    assert scan is not None
    assert command is not None
    pose = None
    if not any(kind == TF for kind, _ in kinds):
        pose = one("poses", "pose", POSE, POSE_COVARIANCE)
        if pose is None:
            raise RunError(
                f"{bag} has no pose: record /tf (map to base_link), or a pose topic"
            )
    return Topics(scan, command, pose, any(kind == CLOCK for kind, _ in kinds))


def counts_of(messages: list[Recorded], topic: str) -> set[int]:
    """The numbers of rays of the scans of a topic."""
    return {len(each.message.ranges) for each in messages if each.topic == topic}


def read_bag(path: Path, most: int = MOST_BYTES) -> list[Recorded]:
    """The messages of a bag, in the order of their times.

    Args:
        path: Folder of rosbag2 (with `metadata.yaml`), or an `.mcap` file.
        most: Memory that reading may need, and the size of a file that may be unpacked,
            bytes: a small file may unpack to any size.

    Raises:
        RunError: It is no bag, it is damaged, or it needs more than `most`.
    """
    if not all(importlib.util.find_spec(name) for name in ("mcap", "rosbags")):
        raise RunError(f"bags need mcap and rosbags: {install_command('ros2')}")
    if not path.exists():
        raise RunError(f"no bag {str(path)!r}: no such file or folder")
    try:
        # Their modules need memory, too.
        from mcap.reader import make_reader  # noqa: F401
        from rosbags.rosbag2 import Reader  # noqa: F401
        from rosbags.typesys import Stores, get_typestore

        types = get_typestore(Stores.ROS2_JAZZY)
        with _at_most(most):
            raw = _folder(path) if path.is_dir() else _file(path)
            return list(_decoded(raw, types))
    except RunError:
        raise
    except MemoryError:
        raise RunError(
            f"{path}: reading this bag needs more than {most / 1e9:g} GB of memory: "
            "split it, or leave out other topics"
        ) from None
    # Readers of damaged files raise nearly anything.
    except Exception as error:
        reason = one_line_reason(error) or type(error).__name__
        raise RunError(
            f"{path} is not a readable bag: {reason}; one that was cut off: mcap "
            "recover, or ros2 bag reindex"
        ) from None


@contextlib.contextmanager
def _at_most(extra: int) -> Iterator[None]:
    """Limits the memory of this process and the size of its files, where it can.

    Args:
        extra: What may come to the memory that the process has, and the largest file.
    """
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])  # raw read: kernel
    except (ImportError, OSError, ValueError):
        yield
        return
    limits = {
        resource.RLIMIT_AS: pages * resource.getpagesize() + extra,
        resource.RLIMIT_FSIZE: extra,
    }
    before = {kind: resource.getrlimit(kind) for kind in limits}
    for kind, limit in limits.items():
        soft, hard = before[kind]
        if soft == resource.RLIM_INFINITY or limit < soft:
            resource.setrlimit(kind, (limit, hard))
    try:
        yield
    finally:
        for kind, own in before.items():
            resource.setrlimit(kind, own)


Raw = tuple[str, str, int, bytes]
"""Topic, type, nanoseconds, CDR."""


def _decoded(messages: Iterator[Raw], types: Any) -> Iterator[Recorded]:
    for topic, kind, nanoseconds, data in messages:
        if kind in WANTED:
            message = types.deserialize_cdr(data, kind)
            yield Recorded(topic, kind, 1e-9 * nanoseconds, message)


def _folder(path: Path) -> Iterator[Raw]:
    from rosbags.rosbag2 import Reader

    _check_folder(path)
    with Reader(path) as reader:
        wanted = [each for each in reader.connections if each.msgtype in WANTED]
        if not wanted:  # rosbags takes none as all
            return
        for connection, nanoseconds, data in reader.messages(wanted):
            yield connection.topic, connection.msgtype, nanoseconds, bytes(data)


def _check_folder(path: Path) -> None:
    """Checks the files of a bag before a reader opens them.

    They must be regular ones in its folder. A database must have tables: a view can
    have rows without end.
    """
    try:
        about = parse_yaml(read_inside(path, "metadata.yaml", RECORD_BYTES))
        names = about["rosbag2_bagfile_information"]["relative_file_paths"]
        files = [path / PurePath(str(name)).name for name in names]
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = one_line_reason(error) or type(error).__name__
        raise RunError(
            f"{path} is not a bag: metadata.yaml: {reason}; expected a folder as `ros2 "
            "bag record` writes it, or an .mcap file"
        ) from None
    for file in files:
        mode = file.lstat().st_mode if os.path.lexists(file) else 0
        if not stat.S_ISREG(mode):
            raise RunError(f"{path} is not a bag: {file.name} is not a regular file")
        if file.suffix == ".db3":
            _check_tables(file)


def _check_tables(file: Path) -> None:
    uri = f"{file.absolute().as_uri()}?mode=ro&immutable=1"
    with contextlib.closing(sqlite3.connect(uri, uri=True)) as database:
        query = (
            "SELECT name, type FROM sqlite_master WHERE name IN ('messages','topics')"
        )
        kinds = dict(database.execute(query).fetchmany(10))
    if kinds != {"messages": "table", "topics": "table"}:
        raise RunError(f"{file} is not a bag: it has no tables messages and topics")


def _file(path: Path) -> Iterator[Raw]:
    from mcap.reader import make_reader

    if path.suffix != ".mcap":
        raise RunError(f"{path} is not a bag: expected a folder or an .mcap file")
    with open_regular(path) as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema is not None and channel.message_encoding == "cdr":
                yield channel.topic, schema.name, message.log_time, message.data
