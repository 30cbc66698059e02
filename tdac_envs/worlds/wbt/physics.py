"""Masses of Solids."""

from __future__ import annotations

from tdac_envs.worlds.wbt.fields import child, number
from tdac_envs.worlds.wbt.tree import WbtNode

_LIGHTEST = 1e-6
_DENSITY = 1000.0


def mass_of(node: WbtNode, volume: float) -> float | None:
    """The mass of a Solid, kg, from its `physics` field; None if it is fixed.

    Args:
        node: The Solid.
        volume: Volume of its boundingObject, m³.

    Raises:
        WorldError: A field of the Physics node is invalid.
    """
    physics = child(node, "physics")
    if physics is None:
        return None
    mass = number(physics, "mass", -1.0)
    if mass <= 0.0:
        density = number(physics, "density", _DENSITY)
        mass = volume * (density if density > 0.0 else _DENSITY)
    return max(mass, _LIGHTEST) if volume or mass > 0.0 else 1.0
