"""Devices that are not modelled.

Devices that every e-puck has return no data and print this once. The other classes
exist only so that they can be imported.
"""

from __future__ import annotations

import math
from typing import Any

from .calls import constants, getters, lacking
from .connection import c_int
from .device import Device
from .messages import once, unsupported


@getters(getSamplingPeriod="_period")
class _Mute(Device):
    """A device that never returns data."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._period = 0

    def enable(self, p: int) -> None:
        """Prints once that the device returns no data."""
        once(f"tdac: {self.name} is not modelled; it returns no data")
        self._period = c_int(p)

    def disable(self) -> None:
        """Disables the device."""
        self._period = 0


class Unknown(_Mute):
    """A device that is not modelled; all its calls print once and do nothing."""

    def __getattr__(self, call: str) -> Any:
        if call.startswith("_"):
            raise AttributeError(call)
        return unsupported(f"{self.name}.{call}", self._neutral(call))

    def _neutral(self, call: str) -> Any:
        """What a call returns: NaN or nothing, and a scan that meets nothing."""
        width, height = (int(self._facts.get(k, 0)) for k in ("width", "height"))
        results: dict[str, Any] = {
            "getRangeImage": [math.inf] * (width * height),
            "getWidth": width,
            "getHeight": height,
            "getHorizontalResolution": width,
            "getNumberOfLayers": height,
            "getValue": math.nan,
            "getValues": [math.nan] * 3,
        }
        return results.get(call)


@getters(getChannel="_channel")
class _Radio(_Mute):
    CHANNEL_BROADCAST = -1
    _channel = 1

    def setChannel(self, channel: int) -> None:
        """Sets the channel."""
        self._channel = c_int(channel)


@lacking(send=1, setRange=None, getRange=-1.0, getBufferSize=-1)
class Emitter(_Radio):
    """An emitter without receivers."""


@constants(getQueueLength=0)
@lacking(
    nextPacket=None,
    getString=None,
    getBytes=None,
    getData=None,
    getFloats=None,
    getInts=None,
    getBools=None,
    getDataSize=-1,
    getSignalStrength=math.nan,
    getEmitterDirection=(math.nan,) * 3,
)
class Receiver(_Radio):
    """A receiver whose queue is always empty."""


@lacking(
    playSound=None,
    stop=None,
    speak=None,
    getEngine="",
    setEngine=False,
    getLanguage="",
    setLanguage=False,
    isSoundPlaying=False,
    isSpeaking=False,
)
class Speaker(Device):
    """A speaker that makes no sound."""


class Altimeter(Unknown):
    """Not modelled."""


class Brake(Unknown):
    """Not modelled."""


class CameraRecognitionObject:
    """Not modelled."""


class Connector(Unknown):
    """Not modelled."""


class Display(Unknown):
    """Not modelled."""


class Pen(Unknown):
    """Not modelled."""


class Radar(Unknown):
    """Not modelled."""


class RadarTarget:
    """Not modelled."""


class Skin(Unknown):
    """Not modelled."""


class TouchSensor(Unknown):
    """Not modelled."""


class VacuumGripper(Unknown):
    """Not modelled."""
