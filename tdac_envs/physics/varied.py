"""A robot that differs a little from its description, drawn anew at each reset."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.physics import mjcf
from tdac_envs.physics.moved import Pose

MASS = FRICTION = 0.2
AXLE, WHEELS = 0.02, 0.01
"""Largest relative errors; of WHEELS, that of each wheel's radius."""


@dataclass(frozen=True, slots=True)
class Variation:
    """Factors of what a robot is described as; 1 for no difference.

    Attributes:
        mass: Of the robot with its wheels.
        grip: Of the friction of the tyres.
        friction: Of the friction of the body on what it touches.
        axle: Of the effective axle.
        wheels: Of the radii of the left and of the right wheel.
    """

    mass: float = 1.0
    grip: float = 1.0
    friction: float = 1.0
    axle: float = 1.0
    wheels: tuple[float, float] = (1.0, 1.0)


AS_DESCRIBED = Variation()


def variation_at(pose: Pose, seed: int | None) -> Variation:
    """The robot of an episode that begins at a pose.

    It follows from the pose and the seed: equal starts have equal robots.

    Args:
        pose: Where the episode begins.
        seed: Seed of all robots; None for the one that is described.
    """
    if seed is None:
        return AS_DESCRIBED
    begin = np.round(np.array(pose, np.float64), 9) + 0.0  # no negative zero
    drawn = hashlib.sha256(begin.tobytes() + seed.to_bytes(16, "little")).digest()
    random = np.random.default_rng(np.frombuffer(drawn, np.uint32))

    def factor(most: float) -> float:
        return float(random.uniform(1.0 - most, 1.0 + most))

    return Variation(
        mass=factor(MASS),
        grip=factor(FRICTION),
        friction=factor(FRICTION),
        axle=factor(AXLE),
        wheels=(factor(WHEELS), factor(WHEELS)),
    )


class Described:
    """The figures of a robot in a model of MuJoCo, and how they are changed.

    The radius of a wheel stays: its motor turns faster or more slowly instead.

    Args:
        engine: The package `mujoco`.
        model: Its model of a scene with a robot.
    """

    def __init__(self, engine: Any, model: Any) -> None:
        self._engine, self._model = engine, model
        wheels = [model.body(name).id for name in (mjcf.LEFT, mjcf.RIGHT)]
        self._parts = [model.body(mjcf.ROBOT).id, *wheels]
        self._wheels, self._hull = wheels, model.geom(mjcf.HULL).id
        self._tyres = [model.body(name).geomadr[0] for name in (mjcf.LEFT, mjcf.RIGHT)]
        own: list[NDArray[np.float64]] = [
            model.body_mass, model.body_inertia, model.geom_friction, model.body_pos,
        ]  # fmt: skip
        self._plain = [array.copy() for array in own]

    def apply(self, found: Variation, data: Any) -> None:
        """Changes the model; `data` must be reset afterwards."""
        model = self._model
        mass, inertia, friction, place = self._plain
        model.body_mass[self._parts] = mass[self._parts] * found.mass
        model.body_inertia[self._parts] = inertia[self._parts] * found.mass
        model.geom_friction[self._tyres, 0] = friction[self._tyres, 0] * found.grip
        model.geom_friction[self._hull, 0] = friction[self._hull, 0] * found.friction
        model.body_pos[self._wheels, 1] = place[self._wheels, 1] * found.axle
        self._engine.mj_setConst(model, data)
