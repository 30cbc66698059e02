"""The scenery that cameras see: floors and visible parts, with their colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import read_only
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.prisms import FIXED, Array, Owned, Prisms
from tdac_envs.webots.rendering import N_PAINT, render
from tdac_envs.worlds.bodies import bodies
from tdac_envs.worlds.footprint import THINNEST, Rectangle
from tdac_envs.worlds.looks import Look, look_of_kind
from tdac_envs.worlds.wbt.colours import Sky
from tdac_envs.worlds.world import Arena, Obstacle, Part, World


@dataclass(frozen=True, slots=True, eq=False)
class Scenery:
    """The visible parts of a world.

    Attributes:
        prisms: The parts at their initial positions; floors first.
        paint: Shape (n, 12): colours of the parts; see `rendering`.
        centres: Shape (k, 2): initial centres of the objects that can be pushed, m.
        sky: Shape (3, 3): colours of the sky; see `rendering.render`.
    """

    prisms: Prisms
    paint: Array
    centres: Array
    sky: Array

    @classmethod
    def of(cls, world: World, sky: Sky) -> Scenery:
        """The scenery of a world, including goal markers."""
        owned: list[Owned] = []
        paint: list[Array] = []
        for arena in world.arenas:
            owned.append(Owned(Part(arena.inside, arena.z - THINNEST, arena.z)))
            paint.append(_floor_paint(arena))
        pushable = 0
        for thing in bodies(world):
            owner = FIXED
            if thing.mass is not None and thing.solid:  # as in `Ground`
                owner, pushable = pushable, pushable + 1
            for part, look in zip(thing.visible, _looks(thing), strict=True):
                if not look.is_clear:
                    owned.append(Owned(part, owner))
                    paint.append(_paint(look))
        return cls(
            Prisms.of(owned),
            np.array(paint).reshape(-1, N_PAINT),
            Ground.of(world).centres,
            np.array(sky, np.float64),
        )

    def at(self, things: Array) -> Prisms:
        """The parts while the objects that can be pushed have the given poses.

        Args:
            things: Shape (k, 3): x, y (m) and rotation since the start (rad).
        """
        if not len(things):
            return self.prisms
        prisms = self.prisms.copy()
        prisms.carry(self.prisms, self.centres, things)
        return prisms

    def image(
        self, view: Array, near: float, width: int, height: int, things: Array
    ) -> NDArray[np.uint8]:
        """An image of the scenery: blue, green, red, 255; shape (height, width, 4).

        Args:
            view: The camera; see `rendering.look_through`.
            near: Distance of the near plane, m.
            width: Width of the image, pixels.
            height: Height of the image, pixels.
            things: Poses of the objects that can be pushed; see `at`.
        """
        prisms = self.at(things)
        depth = np.empty((height, width))
        image = np.empty((height, width, 4), np.uint8)
        fixed = read_only(self.paint), read_only(view), read_only(self.sky)
        render(*prisms.arrays(), *fixed, float(near), depth, image)
        return image


def _looks(thing: Obstacle) -> tuple[Look, ...]:
    """The look of each visible part."""
    return thing.looks or (look_of_kind(thing.kind),) * len(thing.visible)


def _paint(look: Look, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Array:
    """A row of `paint`; a square begins at (x, y), with a side in direction `yaw`."""
    other = look.colour if look.other is None else look.other
    sides = (np.cos(yaw), np.sin(yaw), *look.square)
    return np.array((*look.colour, *other, x, y, *sides), np.float64)


def _floor_paint(arena: Arena) -> Array:
    """A row of `paint`: a square begins at a corner or at the centre of the floor."""
    shape, look = arena.inside, arena.floor_look
    if isinstance(shape, Rectangle):
        x, y = shape.vertices[0].tolist()
        return _paint(look, x, y, shape.yaw)
    return _paint(look, shape.x, shape.y)
