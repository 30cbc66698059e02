"""The robot that a controller drives."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from . import camera, led, motor, ranges, sensors, unmodelled
from .calls import getters, lacking
from .connection import c_int, connection
from .device import Device
from .input import Joystick, Keyboard, Mouse
from .messages import complain

_KINDS: dict[str, type[Device]] = {
    "Motor": motor.Motor,
    "DistanceSensor": sensors.DistanceSensor,
    "LightSensor": sensors.LightSensor,
    "PositionSensor": sensors.PositionSensor,
    "GPS": sensors.GPS,
    "Compass": sensors.Compass,
    "InertialUnit": sensors.InertialUnit,
    "Accelerometer": sensors.Accelerometer,
    "Gyro": sensors.Gyro,
    "Camera": camera.Camera,
    "Lidar": ranges.Lidar,
    "RangeFinder": ranges.RangeFinder,
    "Emitter": unmodelled.Emitter,
    "Receiver": unmodelled.Receiver,
    "Speaker": unmodelled.Speaker,
    "LED": led.LED,
    "Unknown": unmodelled.Unknown,
}


def _deprecated(getter: str) -> Callable[[Any, str], Device | None]:
    def get(robot: Any, name: str) -> Device | None:
        complain(
            f"DEPRECATION: Robot.{getter} is deprecated, please use Robot.getDevice "
            "instead."
        )
        found: Device | None = robot.getDevice(name)
        return found

    get.__name__ = getter
    get.__doc__ = "Same as `getDevice`, with a warning."
    return get


@getters(
    "basic_time_step",
    "custom_data",
    "joystick",
    "keyboard",
    "mode",
    "model",
    "mouse",
    "name",
    "number_of_devices",
    "project_path",
    "supervisor",
    "synchronization",
    "time",
    "world_path",
)
@lacking(
    setMode=None,
    getUrdf="",
    getData="",
    setData=None,
    batterySensorEnable=None,
    batterySensorDisable=None,
    batterySensorGetSamplingPeriod=0,
    batterySensorGetValue=math.nan,
    wwiSendText=None,
    wwiReceiveText=None,
    waitForUserInputEvent=0,
)
class Robot:
    """The robot. A second instance prints an error and has no devices.

    Attributes:
        created: The first instance.
        keyboard: The keyboard, on which no key is ever pressed.
        mouse: The mouse, which gives no input.
        joystick: The joystick, which gives no input.
    """

    MODE_SIMULATION, MODE_CROSS_COMPILATION, MODE_REMOTE_CONTROL = 0, 1, 2
    EVENT_QUIT, EVENT_NO_EVENT = -1, 0
    created: Robot | None = None

    def __init__(self) -> None:
        connection.check()
        if Robot.created is not None:
            complain(
                "Error: only one Robot instance can be created per controller process."
            )
            return
        Robot.created = self
        self.devices: dict[str, Device] = {
            name: _KINDS[facts["kind"]](name)
            for name, facts in connection.devices.items()
        }
        self.keyboard = Keyboard()
        self.mouse = Mouse()
        self.joystick = Joystick()

    def step(self, time_step: int | None = None) -> int:
        """Advances the simulation by `time_step` ms; returns -1 if it has ended.

        Durations are rounded up to a multiple of the world's `basicTimeStep`.
        """
        duration = int(self.basic_time_step) if time_step is None else c_int(time_step)
        if duration < 0:
            complain("Error: wb_robot_step() called with negative duration.")
            return -1
        return connection.step(duration)

    def getDevice(self, name: str) -> Device | None:
        """The device called `name`, or None."""
        if name in self.devices:
            return self.devices[name]
        complain(f'Device "{name}" was not found on robot "{self.name}"')
        return None

    def getDeviceByIndex(self, index: int) -> Device:
        """The device at an index, from 0."""
        return list(self.devices.values())[index]

    def setCustomData(self, data: str) -> None:
        """Sets the robot's `customData` field."""
        self.custom_data = data

    def getType(self) -> int:
        """Always `Node.ROBOT`."""
        return int(connection.facts["node_type"])

    @property
    def basic_time_step(self) -> float:
        """Basic time step of the world, ms."""
        return float(connection.facts["basic_time_step"])

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return connection.time

    @property
    def name(self) -> str:
        """Name of the robot."""
        return str(connection.facts["name"])

    @property
    def model(self) -> str:
        """Model of the robot."""
        return str(connection.facts["model"])

    @property
    def custom_data(self) -> str:
        """The robot's `customData` field."""
        return str(connection.facts["custom_data"])

    @custom_data.setter
    def custom_data(self, data: str) -> None:
        connection.facts["custom_data"] = str(data)

    @property
    def supervisor(self) -> bool:
        """Whether the robot is a supervisor."""
        return bool(connection.facts["supervisor"])

    @property
    def synchronization(self) -> bool:
        """The robot's `synchronization` field; the simulation always waits."""
        return bool(connection.facts["synchronization"])

    @property
    def mode(self) -> int:
        """Always MODE_SIMULATION."""
        return self.MODE_SIMULATION

    @property
    def number_of_devices(self) -> int:
        """Number of devices."""
        return len(connection.devices)

    @property
    def world_path(self) -> str:
        """Path of the world file."""
        return str(connection.facts["world_path"])

    @property
    def project_path(self) -> str:
        """Path of the controller's folder."""
        return str(connection.facts["project_path"])


for _kind in (
    "Accelerometer", "Camera", "Compass", "Display", "DistanceSensor", "Emitter", "GPS",
    "Gyro", "InertialUnit", "LED", "Lidar", "LightSensor", "Motor", "Pen",
    "PositionSensor", "RangeFinder", "Receiver", "Speaker", "TouchSensor",
):  # fmt: skip
    setattr(Robot, f"get{_kind}", _deprecated(f"get{_kind}"))
