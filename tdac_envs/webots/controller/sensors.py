"""Sensors: they read NaN before their first sample, then the last sample."""

from __future__ import annotations

import math
from typing import Any

from .calls import constants, getters
from .connection import c_int, connection
from .device import Device
from .messages import complain


@getters("sampling_period")
class Sensor(Device):
    """A sensor that samples periodically once it is enabled.

    Args:
        name: Device name in the world.
        sampling_period: Period, ms; if given, the sensor is enabled at once.
    """

    _c_name = ""

    def __init__(self, name: str, sampling_period: int | None = None) -> None:
        super().__init__(name)
        self._period = 0
        if sampling_period is not None:
            self.enable(sampling_period)

    def enable(self, p: int) -> None:
        """Samples every `p` ms, first after `p` ms; 0 disables the sensor."""
        period = c_int(p)
        if period < 0:
            complain(
                f"Error: wb_{self._c_name}_enable() called with negative sampling "
                "period."
            )
            return
        self._period = period
        if period == 0:
            connection.values.pop(self.name, None)
        if self._facts:
            connection.command(self.name, "enable", period)

    def disable(self) -> None:
        """Stops sampling."""
        self.enable(0)

    @property
    def sampling_period(self) -> int:
        """Sampling period given to `enable`, ms."""
        return self._period

    @sampling_period.setter
    def sampling_period(self, period: int | None) -> None:
        self.enable(0 if period is None else period)

    def _sample(self, getter: str, default: Any) -> Any:
        """The last sample, or `default` if there is none."""
        if self._period <= 0:
            complain(
                f"Error: wb_{self._c_name}_{getter}() called for a disabled device! "
                f"Please use: wb_{self._c_name}_enable()."
            )
            return default
        sample = connection.values.get(self.name, default)
        return list(sample) if isinstance(sample, list) else sample


@getters("value")
class _Scalar(Sensor):
    @property
    def value(self) -> float:
        """The last sample, or NaN."""
        return float(self._sample("get_value", math.nan))


@getters("lookup_table")
class _Table(_Scalar):
    """A sensor with a lookup table."""

    @property
    def lookup_table(self) -> list[float]:
        """Rows of input, reading and relative noise, as a flat list."""
        return list(self._facts.get("table", ()))


@getters("max_value", "min_value", "aperture", "type")
class DistanceSensor(_Table):
    """Measures the distance along one ray."""

    GENERIC, INFRA_RED, SONAR, LASER = 0, 1, 2, 3
    _c_name = "distance_sensor"

    @property
    def max_value(self) -> float:
        """Highest reading."""
        return max(self.lookup_table[1::3], default=math.nan)

    @property
    def min_value(self) -> float:
        """Lowest reading."""
        return min(self.lookup_table[1::3], default=math.nan)

    @property
    def aperture(self) -> float:
        """Aperture of the sensor's cone, rad."""
        return float(self._facts.get("aperture", math.nan))

    @property
    def type(self) -> int:
        """Type: GENERIC, INFRA_RED, SONAR or LASER."""
        return int(self._facts.get("type", self.INFRA_RED))


class LightSensor(_Table):
    """Measures the irradiance in one direction."""

    _c_name = "light_sensor"


@getters("motor")
@constants(getType=0)
class PositionSensor(_Scalar):
    """Measures the angle by which a wheel has turned, rad."""

    ROTATIONAL, LINEAR = 0, 1
    _c_name = "position_sensor"

    def getBrake(self) -> None:
        """Always None: there is no brake."""

    @property
    def motor(self) -> Any:
        """The wheel's motor."""
        from .motor import Motor

        return Motor(self._facts["motor"]) if self._facts else None


@getters("values")
class _Vector(Sensor):
    @property
    def values(self) -> list[float]:
        """The last sample, or NaNs."""
        return list(self._sample("get_values", [math.nan] * 3))


@getters("speed", "speed_vector")
@constants(getCoordinateSystem=0)
class GPS(_Vector):
    """Measures its position in the file's coordinates, m."""

    LOCAL, WGS84 = 0, 1
    _c_name = "gps"

    @property
    def speed(self) -> float:
        """Speed of the robot, m/s; NaN before the first sample."""
        return math.hypot(*self.speed_vector)

    @property
    def speed_vector(self) -> list[float]:
        """Velocity of the robot, m/s; NaNs before the first sample."""
        sampled = self.name in connection.values and self._period > 0
        return connection.velocity[:3] if sampled else [math.nan] * 3


@getters("lookup_table")
class Accelerometer(_Vector):
    """Measures the proper acceleration, m/s²; at rest 9.81 upwards."""

    _c_name = "accelerometer"

    @property
    def lookup_table(self) -> list[float]:
        """Rows of input, reading and relative noise, as a flat list."""
        return list(self._facts.get("table", ()))


class Gyro(Accelerometer):
    """Measures the turn rate in units of its table: 100000 is 13.3 rad/s."""

    _c_name = "gyro"


class Compass(_Vector):
    """Measures the direction of north in the robot's axes."""

    _c_name = "compass"

    def getLookupTable(self) -> list[float]:
        """Empty: readings are exact."""
        return []


@getters("roll_pitch_yaw", "quaternion")
@constants(getNoise=0.0)
class InertialUnit(Sensor):
    """Measures the orientation of the robot."""

    _c_name = "inertial_unit"

    @property
    def roll_pitch_yaw(self) -> list[float]:
        """Roll, pitch and yaw, rad, or NaNs."""
        return list(self._sample("get_roll_pitch_yaw", [math.nan] * 7))[:3]

    @property
    def quaternion(self) -> list[float]:
        """Quaternion (x, y, z, w), or NaNs."""
        return list(self._sample("get_quaternion", [math.nan] * 7))[3:]
