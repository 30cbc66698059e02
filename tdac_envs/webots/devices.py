"""The devices of a robot, modelled or not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from tdac_envs.epuck.infrared import TABLE
from tdac_envs.webots.cameras import CAMERA_TYPE, CameraFacts
from tdac_envs.webots.instruments import Instruments
from tdac_envs.webots.mounts import Mount
from tdac_envs.webots.scanners import LIDAR_TYPE, RANGE_FINDER_TYPE, ScannerFacts
from tdac_envs.worlds.wbt.fields import number, text
from tdac_envs.worlds.wbt.tree import WbtNode

Offset = tuple[float, ...]

WHEELS = (("left wheel motor", "left wheel sensor"),
          ("right wheel motor", "right wheel sensor"))  # fmt: skip
_PLACED = {
    "GPS": ("gps", 44),
    "Compass": ("compass", 39),
    "InertialUnit": ("inertial unit", 46),
}
NAMES_OF = {
    "Altimeter": "altimeter", "Camera": "camera", "Connector": "connector",
    "Display": "display", "Emitter": "emitter", "Lidar": "lidar", "Pen": "pen",
    "Radar": "radar", "RangeFinder": "range-finder", "Receiver": "receiver",
    "Speaker": "speaker", "TouchSensor": "touch sensor", "LED": "led",
    "VacuumGripper": "vacuum gripper", "RotationalMotor": "rotational motor",
    "LinearMotor": "linear motor", "PositionSensor": "position sensor",
    "Accelerometer": "accelerometer", "Gyro": "gyro", "Brake": "brake",
    "Microphone": "microphone", "Radio": "radio", "Skin": "skin",
}  # fmt: skip
"""Default names of devices, most of which are not modelled."""
_MUTE_KINDS = {"Emitter", "Receiver", "Speaker", "LED"}
_MUTE = (("Emitter", 43), ("Receiver", 56), ("Speaker", 59))
_MOST_VALUES = 2_000_000
GYRO_SCALE = 100000.0 / 13.3158
"""Gyro reading per rad/s."""
_MAX_RATE, _MAX_ACCEL = 13.3158, 100.0


@dataclass(frozen=True, slots=True)
class DeviceFacts:
    """Facts about a device of the robot.

    Attributes:
        name: Device name.
        kind: Name of its class in the `controller` package.
        node_type: Webots' number of the node type.
        more: Further facts that the class needs.
        offset: Position relative to the robot: forward, left, up, m; used for a GPS.
    """

    name: str
    kind: str
    node_type: int
    more: dict[str, Any]
    offset: Offset = (0.0, 0.0, 0.0)

    def plain(self) -> dict[str, Any]:
        """The facts as they are sent to the controller."""
        own = {"name": self.name, "kind": self.kind, "node_type": self.node_type}
        return {**own, **self.more}


def find_devices(
    max_velocity: float,
    mounted: tuple[Mount, ...] = (),
    instruments: Instruments | None = None,
    cameras: Iterable[CameraFacts] = (),
    scanners: Iterable[ScannerFacts] = (),
) -> tuple[tuple[DeviceFacts, ...], tuple[str, ...]]:
    """The devices of an e-puck, and the names of those that are not modelled.

    Args:
        max_velocity: Maximum speed of the motors, rad/s.
        mounted: Nodes in its slots, or in the Robot node.
        instruments: Its distance and light sensors beside ps0 to ps7.
        cameras: Its cameras.
        scanners: Its lidars and range finders.
    """
    devices = _standard(max_velocity)
    devices += [
        DeviceFacts(camera.name, "Camera", CAMERA_TYPE, camera.plain())
        for camera in cameras
    ]
    for scanner in scanners:
        number_of = LIDAR_TYPE if scanner.is_lidar else RANGE_FINDER_TYPE
        kind = "Lidar" if scanner.is_lidar else "RangeFinder"
        devices.append(DeviceFacts(scanner.name, kind, number_of, scanner.plain()))
    if instruments is not None:
        for beam in instruments.beams:
            devices.append(DeviceFacts(beam.name, "DistanceSensor", 42, beam.plain()))
        for cell in instruments.cells:
            devices.append(DeviceFacts(cell.name, "LightSensor", 49, cell.plain()))
    devices += [
        DeviceFacts(node_name, "PositionSensor", 52, {"motor": WHEELS[wheel][0]})
        for node_name, wheel in renamed(mounted, "PositionSensor")
    ]
    for node_name, wheel in renamed(mounted, "RotationalMotor"):
        more = {"max_velocity": max_velocity, "sensor": WHEELS[wheel][1]}
        devices.append(DeviceFacts(node_name, "Motor", 57, more))
    known = {device.name for device in devices}
    absent: list[str] = []
    for node, frame in mounted:
        default, node_type = _PLACED.get(node.kind, (NAMES_OF.get(node.kind, ""), 0))
        name = text(node, "name", default)
        if name in known or not (node_type or node.kind in NAMES_OF):
            continue
        known.add(name)
        kind = node.kind if node_type or node.kind in _MUTE_KINDS else "Unknown"
        offset = tuple(frame.origin.tolist())
        more = {} if node_type else _facts_of(node)
        devices.append(DeviceFacts(name, kind, node_type, more, offset))
        if not node_type:
            absent.append(name)
    return tuple(devices), tuple(absent)


def renamed(mounted: tuple[Mount, ...], kind: str) -> list[tuple[str, int]]:
    """Names of wheel motors or sensors that a Robot node calls otherwise.

    Args:
        mounted: Nodes in the Robot node.
        kind: `RotationalMotor` or `PositionSensor`.

    Returns:
        Names, and the index of the wheel in `WHEELS`.
    """
    usual = {name for pair in WHEELS for name in pair}
    names = [text(node, "name") for node, _ in mounted if node.kind == kind]
    return [
        (name, wheel)
        for name in dict.fromkeys(names)
        for wheel, side in enumerate(("left", "right"))
        if name not in usual and side in name.lower()
    ]


def _facts_of(node: WbtNode) -> dict[str, Any]:
    """Facts about a device that is not modelled."""
    names = ("horizontalResolution", "numberOfLayers"), (512.0, 4.0)
    if node.kind != "Lidar":
        names = ("width", "height"), (64.0, 64.0)
    width, height = (int(number(node, *each)) for each in zip(*names, strict=True))
    if not (width >= 0 and height >= 0 and width * height <= _MOST_VALUES):
        width = height = 0
    return {"width": width, "height": height}


def _standard(max_velocity: float) -> list[DeviceFacts]:
    devices = []
    for wheel, sensor in WHEELS:
        more = {"max_velocity": max_velocity, "sensor": sensor}
        devices.append(DeviceFacts(wheel, "Motor", 57, more))
        devices.append(DeviceFacts(sensor, "PositionSensor", 52, {"motor": wheel}))
    table = {"table": [float(x) for x in TABLE.ravel()], "aperture": 0.1}
    devices += [DeviceFacts(f"ps{k}", "DistanceSensor", 42, table) for k in range(8)]
    devices += [DeviceFacts(f"led{k}", "LED", 47, {}) for k in range(10)]
    force = [-_MAX_ACCEL, -_MAX_ACCEL, 0.003, _MAX_ACCEL, _MAX_ACCEL, 0.003]
    devices.append(DeviceFacts("accelerometer", "Accelerometer", 35, {"table": force}))
    turn = [-_MAX_RATE, -100000.0, 0.003, _MAX_RATE, 100000.0, 0.003]
    devices.append(DeviceFacts("gyro", "Gyro", 45, {"table": turn}))
    return devices + [DeviceFacts(kind.lower(), kind, n, {}) for kind, n in _MUTE]
