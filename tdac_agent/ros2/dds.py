"""Topics over DDS with the names and the quality of service of ROS 2."""

from __future__ import annotations

from typing import Any

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import InstanceState, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from tdac_agent.ros2 import messages as msg

LOOPBACK = """<CycloneDDS><Domain>
<General><AllowMulticast>false</AllowMulticast>
<Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""Configuration that reaches this machine alone, with up to 60 participants."""
MOST_TAKEN = 200
"""Most messages of a topic that are taken at once."""
MOST_DOMAIN = 101
"""Largest domain whose ports are free for it on all systems, as ROS 2 says."""


def _qos(reliable: bool, depth: int, *, lasting: bool = False) -> Qos:
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100))
        if reliable
        else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if lasting else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
    )


SENSOR, STATE, TRANSFORMS = _qos(False, 5), _qos(True, 10), _qos(True, 100)
STATIC = _qos(True, 100, lasting=True)
LATCHED, NEWEST = _qos(True, 1, lasting=True), _qos(False, 1)
TOPICS: dict[str, tuple[type, Qos]] = {
    "scan": (msg.LaserScan, SENSOR),
    "odom": (msg.Odometry, STATE),
    "tf": (msg.TFMessage, TRANSFORMS),
    "tf_static": (msg.TFMessage, STATIC),
    "map": (msg.OccupancyGrid, LATCHED),
    "amcl_pose": (msg.PoseWithCovarianceStamped, LATCHED),
    "clock": (msg.Clock, NEWEST),
    "cmd_vel": (msg.Twist, STATE),
}
"""Topics of a drive; their quality of service is that of ROS 2's profiles for sensor
data, odometry, tf, maps, AMCL, the clock and commands."""


class Bus:
    """A participant of a DDS domain, with writers and readers of `TOPICS`.

    Args:
        domain: Number of the domain (`ROS_DOMAIN_ID`).
        network: Whether to reach other machines, as `CYCLONEDDS_URI` says; otherwise
            this machine alone.
        stamped: Whether commands are `TwistStamped`.
    """

    def __init__(
        self, domain: int = 0, *, network: bool = False, stamped: bool = False
    ) -> None:
        self.stamped = stamped
        self._domain = None if network else _loopback(domain)
        self._participant = DomainParticipant(domain)
        self._publications, self._subscriptions = (
            BuiltinDataReader(self._participant, kind)
            for kind in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription)
        )

    def _topic(self, name: str) -> tuple[Any, Qos]:
        kind, qos = TOPICS[name]
        if name == "cmd_vel" and self.stamped:
            kind = msg.TwistStamped
        return Topic(self._participant, f"rt/{name}", kind, qos=qos), qos

    def writer(self, name: str) -> Any:
        """A writer of a topic; its `write` takes a message."""
        topic, qos = self._topic(name)
        return DataWriter(self._participant, topic, qos=qos)

    def reader(self, name: str) -> Reader:
        """A reader of a topic."""
        topic, qos = self._topic(name)
        return Reader(DataReader(self._participant, topic, qos=qos))

    def publishers(self, name: str) -> int:
        """How many writers a topic has now, in all processes."""
        return _alive(self._publications, name)

    def listeners(self, name: str) -> int:
        """How many readers a topic has now, in all processes."""
        return _alive(self._subscriptions, name)


def _alive(endpoints: Any, name: str) -> int:
    """How many of the known endpoints are of a topic, and there."""
    return sum(
        each.topic_name == f"rt/{name}"
        for each in endpoints.read(1000)
        if hasattr(each, "topic_name")
        and each.sample_info.instance_state == InstanceState.Alive
    )


class Reader:
    """New messages of a topic."""

    def __init__(self, reader: Any) -> None:
        self._reader = reader

    def take(self) -> list[Any]:
        """The messages that have arrived since the last call, oldest first.

        What is none, such as a text that is not UTF-8, is left out: any process on the
        network may have sent it.
        """
        found: list[Any] = []
        for _ in range(MOST_TAKEN):
            try:
                taken = self._reader.take(1)
            # Whatever the decoder of Cyclone DDS raises.
            except Exception:
                continue
            if not taken:
                break
            # A sample without data says that its writer is gone.
            found += [each for each in taken if each.sample_info.valid_data]
        return found


_DOMAINS: dict[int, Any] = {}


def _loopback(number: int) -> Any:
    """The domain of this process, which may be configured only once."""
    if number not in _DOMAINS:
        _DOMAINS[number] = Domain(number, LOOPBACK)
    return _DOMAINS[number]


def time_of(seconds: float) -> Any:
    """A time as a message."""
    nanoseconds = round(seconds * 1e9)
    return msg.Time(nanoseconds // 1_000_000_000, nanoseconds % 1_000_000_000)


def seconds_of(stamp: Any) -> float:
    """The inverse of `time_of`."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
