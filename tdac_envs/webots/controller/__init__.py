"""The `controller` package of a run: the Python API of Webots R2025a.

The package is copied to the folder in which a controller runs, so it uses only the
standard library and nothing else of tdac. It accesses the simulation only through the
`Simulation` given to `connect`, one step at a time. It handles invalid calls as Webots
does, where that is known.
"""

from .ansi import AnsiCodes
from .camera import Camera
from .connection import connect
from .device import Device
from .field import Field
from .input import Joystick, Keyboard, Mouse
from .led import LED
from .motor import Motor
from .node import Node
from .ranges import Lidar, LidarPoint, RangeFinder
from .robot import Robot
from .sensors import (
    GPS,
    Accelerometer,
    Compass,
    DistanceSensor,
    Gyro,
    InertialUnit,
    LightSensor,
    PositionSensor,
)
from .supervisor import Supervisor
from .unmodelled import (
    Altimeter,
    Brake,
    CameraRecognitionObject,
    Connector,
    Display,
    Emitter,
    Pen,
    Radar,
    RadarTarget,
    Receiver,
    Skin,
    Speaker,
    TouchSensor,
    VacuumGripper,
)

__all__ = [
    "GPS",
    "LED",
    "Accelerometer",
    "Altimeter",
    "AnsiCodes",
    "Brake",
    "Camera",
    "CameraRecognitionObject",
    "Compass",
    "Connector",
    "Device",
    "Display",
    "DistanceSensor",
    "Emitter",
    "Field",
    "Gyro",
    "InertialUnit",
    "Joystick",
    "Keyboard",
    "Lidar",
    "LidarPoint",
    "LightSensor",
    "Motor",
    "Mouse",
    "Node",
    "Pen",
    "PositionSensor",
    "Radar",
    "RadarTarget",
    "RangeFinder",
    "Receiver",
    "Robot",
    "Skin",
    "Speaker",
    "Supervisor",
    "TouchSensor",
    "VacuumGripper",
    "connect",
]
