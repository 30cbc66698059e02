"""Devices that are not modelled.

Devices that every e-puck has return no data and print this once. The other classes
exist only so that they can be imported.
"""

from __future__ import annotations

import math
from typing import Any

from .connection import c_int
from .device import Device
from .messages import once, unsupported


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

    def getSamplingPeriod(self) -> int:
        """Sampling period given to `enable`, ms."""
        return self._period


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


class Emitter(_Mute):
    """An emitter without receivers."""

    CHANNEL_BROADCAST = -1
    _channel = 1

    def getChannel(self) -> int:
        """Channel given to `setChannel`."""
        return self._channel

    def setChannel(self, channel: int) -> None:
        """Sets the channel."""
        self._channel = c_int(channel)

    send: Any = unsupported("Emitter.send", 1)
    setRange: Any = unsupported("Emitter.setRange")
    getRange: Any = unsupported("Emitter.getRange", -1.0)
    getBufferSize: Any = unsupported("Emitter.getBufferSize", -1)


class Receiver(_Mute):
    """A receiver whose queue is always empty."""

    CHANNEL_BROADCAST = -1
    _channel = 1

    def getQueueLength(self) -> int:
        """Always 0."""
        return 0

    def getChannel(self) -> int:
        """Channel given to `setChannel`."""
        return self._channel

    def setChannel(self, channel: int) -> None:
        """Sets the channel."""
        self._channel = c_int(channel)

    nextPacket: Any = unsupported("Receiver.nextPacket")
    getString: Any = unsupported("Receiver.getString")
    getBytes: Any = unsupported("Receiver.getBytes")
    getData: Any = unsupported("Receiver.getData")
    getFloats: Any = unsupported("Receiver.getFloats")
    getInts: Any = unsupported("Receiver.getInts")
    getBools: Any = unsupported("Receiver.getBools")
    getDataSize: Any = unsupported("Receiver.getDataSize", -1)
    getSignalStrength: Any = unsupported("Receiver.getSignalStrength", math.nan)
    getEmitterDirection: Any = unsupported(
        "Receiver.getEmitterDirection", (math.nan,) * 3
    )


class Speaker(Device):
    """A speaker that makes no sound."""

    playSound: Any = unsupported("Speaker.playSound")
    stop: Any = unsupported("Speaker.stop")
    speak: Any = unsupported("Speaker.speak")
    getEngine: Any = unsupported("Speaker.getEngine", "")
    setEngine: Any = unsupported("Speaker.setEngine", False)
    getLanguage: Any = unsupported("Speaker.getLanguage", "")
    setLanguage: Any = unsupported("Speaker.setLanguage", False)
    isSoundPlaying: Any = unsupported("Speaker.isSoundPlaying", False)
    isSpeaking: Any = unsupported("Speaker.isSpeaking", False)


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
