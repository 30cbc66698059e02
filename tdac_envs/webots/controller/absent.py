"""Devices that no robot has here: their names can be imported, and that is all."""

from __future__ import annotations

from .device import Device


class Accelerometer(Device):
    """Not modelled."""


class Altimeter(Device):
    """Not modelled."""


class Brake(Device):
    """Not modelled."""


class Camera(Device):
    """Not modelled."""


class CameraRecognitionObject:
    """Not modelled."""


class Connector(Device):
    """Not modelled."""


class Display(Device):
    """Not modelled."""


class Emitter(Device):
    """Not modelled."""


class Gyro(Device):
    """Not modelled."""


class Lidar(Device):
    """Not modelled."""


class LidarPoint:
    """Not modelled."""


class Pen(Device):
    """Not modelled."""


class Radar(Device):
    """Not modelled."""


class RadarTarget:
    """Not modelled."""


class RangeFinder(Device):
    """Not modelled."""


class Receiver(Device):
    """Not modelled."""


class Skin(Device):
    """Not modelled."""


class Speaker(Device):
    """Not modelled."""


class TouchSensor(Device):
    """Not modelled."""


class VacuumGripper(Device):
    """Not modelled."""
