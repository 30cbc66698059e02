"""Motors, in position or in velocity control."""

from __future__ import annotations

import math
from typing import Any

from .calls import constants, getters, lacking
from .connection import c_double, connection
from .device import Device
from .messages import complain


@getters(
    "target_position",
    "max_velocity",
    "max_torque",
    "position_sensor",
    getVelocity="target_velocity",
    getAcceleration="target_acceleration",
    getAvailableTorque="_torque",
    getAvailableForce="_torque",
    getMaxForce="max_torque",
)
@constants(getMinPosition=0.0, getMaxPosition=0.0, getMultiplier=1.0, getType=0)
@lacking(
    setTorque=None,
    setForce=None,
    enableTorqueFeedback=None,
    enableForceFeedback=None,
    getTorqueFeedback=math.nan,
    getForceFeedback=math.nan,
)
class Motor(Device):
    """A wheel motor; it holds position 0 until `setPosition` is called.

    Args:
        name: Device name in the world.
    """

    ROTATIONAL, LINEAR = 0, 1

    def __new__(cls, name: str) -> Motor:
        """Returns the only motor of that name, so that all users share its settings."""
        motor = connection.motors.get(name)
        if not isinstance(motor, Motor):
            motor = connection.motors[name] = super().__new__(cls)
        return motor

    def __init__(self, name: str) -> None:
        if "name" in self.__dict__:
            return
        super().__init__(name)
        self._position = 0.0
        self._velocity = self.max_velocity
        self._acceleration = -1.0
        self._torque = self.max_torque

    def setPosition(self, position: float) -> None:
        """Sets the target angle, rad; inf selects velocity control."""
        self.target_position = position

    def setVelocity(self, velocity: float) -> None:
        """Sets the velocity, rad/s; in position control the maximum, at least 0."""
        self.target_velocity = velocity

    def setAcceleration(self, acceleration: float) -> None:
        """Sets the maximum acceleration, rad/s²; -1 is unlimited."""
        self.target_acceleration = acceleration

    def setAvailableTorque(self, torque: float) -> None:
        """Stores the torque, N m; no effect: the motor always reaches its speed."""
        wanted = c_double(torque)
        if wanted >= 0.0:
            self._torque = min(wanted, self.max_torque)
        else:
            _refuse("set_available_torque", "negative 'torque' argument.")

    setAvailableForce = setAvailableTorque

    def setControlPID(self, p: float, i: float, d: float) -> None:
        """Sets the gains of position control; initially 10, 0, 0."""
        gains = [c_double(p), c_double(i), c_double(d)]
        for gain, name, words in zip(
            gains, "pid", ("negative or zero", "negative", "negative"), strict=True
        ):
            if gain < 0.0 or (name == "p" and gain == 0.0):
                _refuse("set_control_pid", f"{words} '{name}' argument.")
                return
        connection.command(self.name, "pid", gains)

    def getBrake(self) -> None:
        """Always None: there is no brake."""

    @property
    def max_velocity(self) -> float:
        """Maximum velocity, rad/s."""
        return float(self._facts.get("max_velocity", math.nan))

    @property
    def max_torque(self) -> float:
        """Maximum torque, N m."""
        return 10.0

    @property
    def position_sensor(self) -> Any:
        """The wheel's position sensor."""
        from .robot import Robot

        name = self._facts.get("sensor", "")
        return getattr(Robot.created, "devices", {}).get(name)

    @property
    def target_position(self) -> float:
        """Angle given to `setPosition`, rad."""
        return self._position

    @target_position.setter
    def target_position(self, position: float) -> None:
        wanted = c_double(position)
        if math.isnan(wanted):
            _refuse("set_position", "an invalid 'position' argument (NaN).")
            return
        self._position = wanted
        self._send("position", wanted)

    @property
    def target_velocity(self) -> float:
        """Velocity given to `setVelocity`, not the actual velocity, rad/s."""
        return self._velocity

    @target_velocity.setter
    def target_velocity(self, velocity: float) -> None:
        wanted = c_double(velocity)
        if math.isnan(wanted):
            _refuse("set_velocity", "an invalid 'velocity' argument (NaN).")
            return
        if wanted < 0.0 and not math.isinf(self._position):
            _refuse(
                "set_velocity",
                "negative 'velocity' argument in position control mode "
                f"({self._position:g}).",
            )
            return
        self._velocity = wanted
        self._send("velocity", wanted)

    @property
    def target_acceleration(self) -> float:
        """Acceleration given to `setAcceleration`, rad/s²."""
        return self._acceleration

    @target_acceleration.setter
    def target_acceleration(self, acceleration: float) -> None:
        wanted = c_double(acceleration)
        if math.isnan(wanted) or (wanted < 0.0 and wanted != -1.0):
            what = "an invalid" if math.isnan(wanted) else "negative"
            _refuse("set_acceleration", f"{what} 'acceleration' argument.")
            return
        self._acceleration = wanted
        self._send("acceleration", wanted)

    def _send(self, what: str, value: float) -> None:
        if self._facts:
            connection.command(self.name, what, value)


def _refuse(call: str, what: str) -> None:
    complain(f"Error: wb_motor_{call}() called with {what}")
