"""What goes over the wire is what ROS 2 expects, by an independent reader."""

import dataclasses
import math
import os
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

pytest.importorskip("cyclonedds", reason="no wheel of Cyclone DDS")

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import Policy
from cyclonedds.domain import DomainParticipant

from tdac_agent.ros2 import messages as msg
from tdac_agent.ros2.dds import LOOPBACK, TOPICS, Bus, seconds_of, time_of
from tdac_agent.ros2.robot import Robot
from tdac_agent.ros2.simulator import Simulator

DOMAIN = 20 + os.getpid() % 60
HEADER = msg.Header(msg.Time(12, 345_678_901), "base_scan")
TURN = msg.Quaternion(0.0, 0.0, 0.5, 0.75)
TWIST = msg.Twist(msg.Vector3(0.25, 0.5, 0.75), msg.Vector3(1.0, 2.0, 3.0))
MESSAGES = [
    msg.Clock(msg.Time(7, 5)),
    TWIST,
    msg.TwistStamped(HEADER, TWIST),
    msg.LaserScan(
        HEADER, -3.0, 3.0, 0.5, 0.25, 0.125, 0.1, 3.5,
        [1.0, math.inf, 0.0, math.nan], [5.0],
    ),
    msg.Odometry(
        HEADER, "base_link",
        msg.PoseWithCovariance(
            msg.Pose(msg.Point(1.0, 2.0, 3.0), TURN), [float(i) for i in range(36)]
        ),
        msg.TwistWithCovariance(TWIST, [float(-i) for i in range(36)]),
    ),
    msg.PoseWithCovarianceStamped(
        HEADER,
        msg.PoseWithCovariance(
            msg.Pose(msg.Point(1.0, 2.0, 3.0), TURN), [float(i) for i in range(36)]
        ),
    ),
    msg.OccupancyGrid(
        HEADER,
        msg.MapMetaData(
            HEADER.stamp, 0.05, 3, 2, msg.Pose(msg.Point(-1.0, 2.0, 0.0), TURN)
        ),
        [0, 100, -1, 50, 0, 0],
    ),
    msg.TFMessage(
        [
            msg.TransformStamped(
                HEADER, "odom", msg.Transform(msg.Vector3(4.0, 5.0, 6.0), TURN)
            )
        ]
        * 2
    ),
]  # fmt: skip


def plain(message):
    """A message of any library as nested lists of numbers and texts."""
    if isinstance(message, list | tuple | np.ndarray):
        return [plain(each) for each in message]
    if dataclasses.is_dataclass(message):
        names = [f.name for f in dataclasses.fields(message)]
        return {n: plain(getattr(message, n)) for n in names if n[0] != "_"}
    if isinstance(message, float | np.floating):
        return "nan" if math.isnan(message) else float(np.float32(message))
    return message


@pytest.mark.parametrize("store", [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY])
@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: type(m).__name__)
def test_messages_are_those_of_ros(message, store):
    """`rosbags` reads each message with its own definitions, and writes the same."""
    types, name = get_typestore(store), msg.ros_name(type(message))
    read = types.deserialize_cdr(message.serialize(), name)
    assert plain(read) == plain(message)
    written = bytes(types.serialize_cdr(read, name))
    assert written == message.serialize()[: len(written)]


@pytest.mark.parametrize("seconds", [0.0, 1.5, 1_700_000_000.123456])
def test_times_are_kept(seconds):
    """Seconds and nanoseconds, to the microsecond."""
    assert math.isclose(seconds_of(time_of(seconds)), seconds, abs_tol=1e-6)


def test_topics_have_the_names_types_and_qos_of_ros(task, settings):
    """Another participant sees them as nodes of ROS 2 would."""
    bus = Bus(DOMAIN)
    robot = Robot(task, settings, dead_man=0.3)
    simulator = Simulator(robot, bus)
    other = DomainParticipant(DOMAIN)
    reader = BuiltinDataReader(other, BuiltinTopicDcpsPublication)
    end, seen = time.monotonic() + 10.0, {}
    while len(seen) < 7 and time.monotonic() < end:
        for each in reader.take(100):
            if hasattr(each, "topic_name") and each.topic_name.startswith("rt/"):
                seen[each.topic_name] = each
        time.sleep(0.02)
    assert {name: each.type_name for name, each in seen.items()} == {
        "rt/scan": "sensor_msgs::msg::dds_::LaserScan_",
        "rt/odom": "nav_msgs::msg::dds_::Odometry_",
        "rt/tf": "tf2_msgs::msg::dds_::TFMessage_",
        "rt/tf_static": "tf2_msgs::msg::dds_::TFMessage_",
        "rt/map": "nav_msgs::msg::dds_::OccupancyGrid_",
        "rt/amcl_pose": "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_",
        "rt/clock": "rosgraph_msgs::msg::dds_::Clock_",
    }
    reliable = {n: each.qos[Policy.Reliability] for n, each in seen.items()}
    best = Policy.Reliability.BestEffort
    assert {n for n, each in reliable.items() if each == best} == {
        "rt/scan",
        "rt/clock",
    }
    for name in ("rt/tf_static", "rt/map", "rt/amcl_pose"):
        lasting = seen[name].qos[Policy.Durability]
        assert lasting == Policy.Durability.TransientLocal
    assert seen["rt/scan"].qos[Policy.Durability] == Policy.Durability.Volatile
    assert simulator is not None


def test_it_stays_on_this_machine():
    """Without --network, Cyclone DDS is told of the loopback interface alone."""
    own = ET.fromstring(LOOPBACK)
    names = [each.get("name") for each in own.iter("NetworkInterface")]
    peers = [each.get("Address") for each in own.iter("Peer")]
    assert (names, peers) == (["lo"], ["127.0.0.1"])
    assert [each.text for each in own.iter("AllowMulticast")] == ["false"]
    trace = "<Tracing><Verbosity>config</Verbosity><OutputFile>stderr</OutputFile>"
    code = (
        "from tdac_agent.ros2 import dds\n"
        "end = '</Domain></CycloneDDS>'\n"
        f"dds.LOOPBACK = dds.LOOPBACK.replace(end, '{trace}</Tracing>' + end)\n"
        "dds.Bus(1)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert re.findall(r"selected interfaces: (.*) \(index", done.stderr) == ["lo"]
    assert set(re.findall(r"add udp/([\d.]+):", done.stderr)) == {"127.0.0.1"}


def test_every_topic_can_be_written_and_read():
    """One process writes, another participant reads the same values."""
    bus = Bus(DOMAIN + 1)
    for message in MESSAGES:
        names = [n for n, (kind, _) in TOPICS.items() if kind is type(message)]
        for name in names:
            reader, writer = bus.reader(name), bus.writer(name)
            end, found = time.monotonic() + 10.0, []
            while not found and time.monotonic() < end:
                writer.write(message)
                time.sleep(0.01)
                found = reader.take()
            assert plain(found[0]) == plain(message)
