"""The devices of a robot, modelled or not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from tdac_envs.epuck.infrared import TABLE
from tdac_envs.webots.cameras import CAMERA_TYPE, CameraFacts
from tdac_envs.worlds.wbt.fields import children, numbers, text
from tdac_envs.worlds.wbt.robots import inside
from tdac_envs.worlds.wbt.tree import Node

Offset = tuple[float, float, float]

WHEELS = (("left wheel motor", "left wheel sensor"),
          ("right wheel motor", "right wheel sensor"))  # fmt: skip
ENCODER_STEP = 0.00628
"""Resolution of the wheel position sensors, rad."""
DARK = 4095.0
"""Reading of a light sensor in the dark; light is not modelled."""
_LIGHT_TABLE = [1.0, DARK, 0.01, 2.0, 0.0, 0.01]
_GROUND_TABLE = [0.0, 1000.0, 0.002, 0.016, 300.0, 0.004]
_TURRET: Offset = (-0.0095, 0.0, 0.0486)
_PLACED = {
    "GPS": ("gps", 44),
    "Compass": ("compass", 39),
    "InertialUnit": ("inertial unit", 46),
}
_MUTE = (("Emitter", 43), ("Receiver", 56), ("Speaker", 59))
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
        offset: Position in the robot's axes, m; used for a GPS only.
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
    robot: Node, max_velocity: float, cameras: Iterable[CameraFacts] = ()
) -> tuple[tuple[DeviceFacts, ...], tuple[str, ...]]:
    """The devices of an e-puck, and the names of those that are not modelled.

    Args:
        robot: Node of the e-puck: the PROTO or a plain Robot.
        max_velocity: Maximum speed of the motors, rad/s.
        cameras: Its cameras.
    """
    devices = [*_standard(max_velocity), *_ground(robot)]
    devices += [
        DeviceFacts(camera.name, "Camera", CAMERA_TYPE, camera.plain())
        for camera in cameras
    ]
    absent = ["tof"] if text(robot, "version") == "2" else []
    for node, offset in _mounted(robot):
        default, number = _PLACED.get(node.kind, ("", 0))
        name = text(node, "name", default)
        if number:
            devices.append(DeviceFacts(name, node.kind, number, {}, offset))
        elif name:
            absent.append(name)
    known = {device.name for device in devices}
    return tuple(devices), tuple(name for name in absent if name not in known)


def _standard(max_velocity: float) -> list[DeviceFacts]:
    devices = []
    for wheel, sensor in WHEELS:
        more = {"max_velocity": max_velocity, "sensor": sensor}
        devices.append(DeviceFacts(wheel, "Motor", 57, more))
        devices.append(DeviceFacts(sensor, "PositionSensor", 52, {"motor": wheel}))
    table = {"table": [float(x) for x in TABLE.ravel()], "aperture": 0.1}
    devices += [DeviceFacts(f"ps{k}", "DistanceSensor", 42, table) for k in range(8)]
    light = {"table": _LIGHT_TABLE}
    devices += [DeviceFacts(f"ls{k}", "LightSensor", 49, light) for k in range(8)]
    devices += [DeviceFacts(f"led{k}", "LED", 47, {}) for k in range(10)]
    force = [-_MAX_ACCEL, -_MAX_ACCEL, 0.003, _MAX_ACCEL, _MAX_ACCEL, 0.003]
    devices.append(DeviceFacts("accelerometer", "Accelerometer", 35, {"table": force}))
    turn = [-_MAX_RATE, -100000.0, 0.003, _MAX_RATE, 100000.0, 0.003]
    devices.append(DeviceFacts("gyro", "Gyro", 45, {"table": turn}))
    return devices + [DeviceFacts(kind.lower(), kind, n, {}) for kind, n in _MUTE]


def _ground(robot: Node) -> list[DeviceFacts]:
    slot = children(robot, "groundSensorsSlot")
    if not any(node.kind == "E-puckGroundSensors" for node in slot):
        return []
    more = {"table": _GROUND_TABLE, "aperture": 0.1}
    return [DeviceFacts(f"gs{k}", "DistanceSensor", 42, more) for k in range(3)]


def _mounted(robot: Node) -> list[tuple[Node, Offset]]:
    """Devices in the turret slot or in a plain Robot, with their offsets."""
    slot = children(robot, "turretSlot")
    own = [node for node in inside(robot) if node.kind in _PLACED and node is not robot]
    found = [(node, _offset(node, _TURRET)) for top in slot for node in inside(top)]
    return found + [(node, _offset(node, (0.0, 0.0, 0.0))) for node in own]


def _offset(node: Node, origin: Offset) -> Offset:
    x, y, z = numbers(node, "translation", (0.0, 0.0, 0.0))
    return origin[0] + x, origin[1] + y, origin[2] + z
