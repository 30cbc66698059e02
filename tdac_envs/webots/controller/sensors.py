"""Sensors: they read NaN before their first sample, then the last sample."""

from __future__ import annotations

import math
from typing import Any

from .connection import c_int, connection
from .device import Device
from .messages import complain


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

    def getSamplingPeriod(self) -> int:
        """Sampling period given to `enable`, ms."""
        return self._period

    @property
    def sampling_period(self) -> int:
        """See `getSamplingPeriod` and `enable`."""
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


class _Scalar(Sensor):
    def getValue(self) -> float:
        """The last sample, or NaN."""
        return self.value

    @property
    def value(self) -> float:
        """See `getValue`."""
        return float(self._sample("get_value", math.nan))


class _Table(_Scalar):
    """A sensor with a lookup table."""

    def getLookupTable(self) -> list[float]:
        """Rows of input, reading and relative noise, as a flat list."""
        return self.lookup_table

    @property
    def lookup_table(self) -> list[float]:
        """See `getLookupTable`."""
        return list(self._facts.get("table", ()))


class DistanceSensor(_Table):
    """Measures the distance along one ray."""

    GENERIC, INFRA_RED, SONAR, LASER = 0, 1, 2, 3
    _c_name = "distance_sensor"

    def getMaxValue(self) -> float:
        """Highest reading."""
        return self.max_value

    def getMinValue(self) -> float:
        """Lowest reading."""
        return self.min_value

    def getAperture(self) -> float:
        """Aperture of the sensor's cone, rad."""
        return self.aperture

    def getType(self) -> int:
        """Type: GENERIC, INFRA_RED, SONAR or LASER."""
        return self.type

    @property
    def max_value(self) -> float:
        """See `getMaxValue`."""
        return max(self.lookup_table[1::3], default=math.nan)

    @property
    def min_value(self) -> float:
        """See `getMinValue`."""
        return min(self.lookup_table[1::3], default=math.nan)

    @property
    def aperture(self) -> float:
        """See `getAperture`."""
        return float(self._facts.get("aperture", math.nan))

    @property
    def type(self) -> int:
        """See `getType`."""
        return int(self._facts.get("type", self.INFRA_RED))


class LightSensor(_Table):
    """Measures the irradiance in one direction."""

    _c_name = "light_sensor"


class PositionSensor(_Scalar):
    """Measures the angle by which a wheel has turned, rad."""

    ROTATIONAL, LINEAR = 0, 1
    _c_name = "position_sensor"

    def getType(self) -> int:
        """Always ROTATIONAL."""
        return self.ROTATIONAL

    def getMotor(self) -> Any:
        """The wheel's motor."""
        from .motor import Motor

        return Motor(self._facts["motor"]) if self._facts else None

    def getBrake(self) -> None:
        """Always None: there is no brake."""

    @property
    def motor(self) -> Any:
        """See `getMotor`."""
        return self.getMotor()


class _Vector(Sensor):
    def getValues(self) -> list[float]:
        """The last sample, or NaNs."""
        return self.values

    @property
    def values(self) -> list[float]:
        """See `getValues`."""
        return list(self._sample("get_values", [math.nan] * 3))


class GPS(_Vector):
    """Measures its position in the file's coordinates, m."""

    LOCAL, WGS84 = 0, 1
    _c_name = "gps"

    def getSpeed(self) -> float:
        """Speed of the robot, m/s; NaN before the first sample."""
        return self.speed

    def getSpeedVector(self) -> list[float]:
        """Velocity of the robot, m/s; NaNs before the first sample."""
        return self.speed_vector

    def getCoordinateSystem(self) -> int:
        """Always LOCAL."""
        return self.LOCAL

    @property
    def speed(self) -> float:
        """See `getSpeed`."""
        return math.hypot(*self.speed_vector)

    @property
    def speed_vector(self) -> list[float]:
        """See `getSpeedVector`."""
        sampled = self.name in connection.values and self._period > 0
        return connection.velocity[:3] if sampled else [math.nan] * 3


class Accelerometer(_Vector):
    """Measures the proper acceleration, m/s²; at rest 9.81 upwards."""

    _c_name = "accelerometer"

    def getLookupTable(self) -> list[float]:
        """See `lookup_table`."""
        return self.lookup_table

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


class InertialUnit(Sensor):
    """Measures the orientation of the robot."""

    _c_name = "inertial_unit"

    def getRollPitchYaw(self) -> list[float]:
        """Roll, pitch and yaw, rad, or NaNs."""
        return self.roll_pitch_yaw

    def getQuaternion(self) -> list[float]:
        """Quaternion (x, y, z, w), or NaNs."""
        return self.quaternion

    def getNoise(self) -> float:
        """Always 0."""
        return 0.0

    @property
    def roll_pitch_yaw(self) -> list[float]:
        """See `getRollPitchYaw`."""
        return list(self._sample("get_roll_pitch_yaw", [math.nan] * 7))[:3]

    @property
    def quaternion(self) -> list[float]:
        """See `getQuaternion`."""
        return list(self._sample("get_quaternion", [math.nan] * 7))[3:]
