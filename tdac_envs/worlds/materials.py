"""Friction between the materials of a world's objects, as in Webots."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.footprint import keep_digits

MATERIAL = "default"
"""Material of e-pucks, and of objects whose `contactMaterial` the file does not set."""
FRICTION = 1.0
"""Coulomb friction coefficient of a pair that the file does not list.

Source: Webots' reference, ContactProperties.
"""
INFINITE_FRICTION = 1e3
"""Coefficient for Webots' infinite friction, and the largest."""


@dataclass(frozen=True, slots=True)
class Contact:
    """The friction between two materials: a ContactProperties node.

    Attributes:
        one: A material.
        other: Another one, or the same.
        friction: Coulomb friction coefficient.
    """

    one: str = MATERIAL
    other: str = MATERIAL
    friction: float = FRICTION

    def __post_init__(self) -> None:
        if not 0.0 <= self.friction <= INFINITE_FRICTION:
            wanted = f"expected a friction from 0 to {INFINITE_FRICTION:g}"
            raise WorldError(f"{wanted}, got {self.friction}")
        keep_digits(self, "friction")


def friction_between(contacts: Iterable[Contact], one: str, other: str) -> float:
    """The friction of the first contact of two materials, in either order."""
    pair = {one, other}
    found = (c.friction for c in contacts if {c.one, c.other} == pair)
    return next(found, FRICTION)
