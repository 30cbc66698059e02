"""A PROTO converted to prisms."""

from __future__ import annotations

from dataclasses import dataclass

from tdac_envs.worlds.wbt.frames import Frame
from tdac_envs.worlds.world import Part


@dataclass(frozen=True, slots=True)
class Body:
    """A PROTO converted to prisms.

    Attributes:
        frame: Frame of the PROTO.
        solid: Parts for collisions.
        visible: Parts that sensors see.
        mass: Mass, kg; None if the body is fixed.
        reflectance: Reflectance of all parts.
    """

    frame: Frame
    solid: tuple[Part, ...]
    visible: tuple[Part, ...]
    mass: float | None = None
    reflectance: float = 1.0
