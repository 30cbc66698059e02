"""The body of a two-wheeled robot in three dimensions."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from tdac_envs.core.arguments import non_negative, positive, whole_number
from tdac_envs.core.errors import TaskError

GRAVITY = 9.81
"""m/s²"""
_MOST_SEED = 2**63 - 1
_MAY_BE_ZERO = "bottom", "grip", "caster_friction", "friction"


@dataclass(frozen=True, slots=True)
class BodySpec:
    """A cylinder on two driven wheels and two low casters, in m, kg and rad.

    The wheels are ellipsoids, so that each touches the ground in one point: at the
    effective axle. Flat cylinders chatter between their rims.

    Attributes:
        radius: Radius of the cylinder.
        bottom: Height of its lowest point above the ground.
        top: Height of its highest point.
        mass: Mass of the robot with its wheels.
        centre: Height of the centre of mass.
        wheel_radius: Radius of a wheel.
        wheel_mass: Mass of a wheel.
        axle_length: Effective axle: the distance of the points where wheels touch.
        torque: Largest torque of a motor, N·m; None for as much as the tyres hold.
        grip: Coulomb friction coefficient of the tyres on the ground.
        caster_friction: Coulomb friction coefficient of the casters on the ground.
        friction: Coulomb friction coefficient of the cylinder on what it touches.
        varied: Seed with which mass, frictions, axle and wheels are varied at each
            reset; None for the robot as it is described.

    Raises:
        TaskError: A value is not valid.
    """

    radius: float
    bottom: float
    top: float
    mass: float
    centre: float
    wheel_radius: float
    wheel_mass: float
    axle_length: float
    torque: float | None = None
    grip: float = 1.0
    caster_friction: float = 0.02
    friction: float = 1.0
    varied: int | None = None

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if value is None and one.name in {"torque", "varied"}:
                continue
            if one.name == "varied":
                whole_number("physics: varied", value, 0, _MOST_SEED)
                continue
            check = non_negative if one.name in _MAY_BE_ZERO else positive
            object.__setattr__(self, one.name, check(f"body: {one.name}", value))
        if self.top <= self.bottom:
            raise TaskError(
                f"body: expected top above bottom ({self.bottom:g} m), got {self.top:g}"
            )
        if self.mass <= 2 * self.wheel_mass:
            raise TaskError(
                "body: expected mass above that of two wheels "
                f"({2 * self.wheel_mass:g} kg), got {self.mass:g}"
            )

    @property
    def most_torque(self) -> float:
        """Largest torque of a motor, N·m.

        By default the one at which the tyres begin to slip: half of the weight times
        the radius of a wheel, for a friction of 1.
        """
        if self.torque is not None:
            return self.torque
        return 0.5 * self.mass * GRAVITY * self.wheel_radius

    def changed(self, **changes: Any) -> BodySpec:
        """This body with the values that are not None.

        Raises:
            TaskError: A value is not valid.
        """
        return replace(self, **{k: v for k, v in changes.items() if v is not None})


def e_puck_body(mass: float, axle_length: float, grip: float = 1.0) -> BodySpec:
    """The body of an e-puck.

    The sizes are those of Webots' E-puck.proto: cylinder, centre of mass, wheels.

    Args:
        mass: Mass with wheels, kg.
        axle_length: Effective axle, m.
        grip: Coulomb friction coefficient of the tyres on the ground.
    """
    return BodySpec(
        radius=0.037,
        bottom=0.0025,
        top=0.0475,
        mass=mass,
        centre=0.015,
        wheel_radius=0.02,
        wheel_mass=0.005,
        axle_length=axle_length,
        grip=grip,
    )


def disc_body(radius: float, axle_length: float) -> BodySpec:
    """The body of a disc-shaped robot of which only these two lengths are known, m.

    It is an e-puck scaled to this radius; its mass grows with the cube of the radius.
    """
    scale = radius / 0.037
    mass = 0.16 * scale**3
    return BodySpec(
        radius=radius,
        bottom=0.0025 * scale,
        top=0.0475 * scale,
        mass=mass,
        centre=0.015 * scale,
        wheel_radius=0.02 * scale,
        wheel_mass=mass / 32,
        axle_length=axle_length,
    )
