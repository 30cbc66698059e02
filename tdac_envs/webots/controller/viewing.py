"""Devices that see the world; the simulation computes what they see when it is read."""

from __future__ import annotations

import math
from typing import Any

from .connection import connection
from .sensors import Sensor


class ViewingSensor(Sensor):
    """A camera, lidar or range finder.

    Args:
        name: Device name in the world.
        sampling_period: Period, ms; if given, the device is enabled at once.
    """

    def __init__(self, name: str, sampling_period: int | None = None) -> None:
        self._sampled: Any = None
        self._seen: bytes | None = None
        super().__init__(name, sampling_period)

    def enable(self, p: int) -> None:
        """Samples every `p` ms, first after `p` ms; 0 disables the device."""
        self._enabled_at = connection.time
        super().enable(p)

    @property
    def width(self) -> int:
        """Values in a row."""
        return int(self._facts.get("width", 0))

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self._facts.get("height", 0))

    @property
    def fov(self) -> float:
        """Horizontal field of view, rad."""
        return float(self._facts.get("fov", math.nan))

    def _last(self, getter: str) -> bytes | None:
        """The last view, 4 bytes for each value, requested once for each sample.

        As in Webots, it is zero before the first sample. It is None before the first
        step, and None with an error if the device is disabled.
        """
        sampled = self._sample(getter, None)
        if sampled is None:
            is_stepped = self._period > 0 and connection.time > self._enabled_at
            return bytes(4 * self.width * self.height) if is_stepped else None
        if sampled != self._sampled:
            self._sampled, self._seen = sampled, connection.image(self.name)
        return self._seen
