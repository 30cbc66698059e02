"""Parts of a world as arrays for compiled code, with the objects that own them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.compiled import read_only
from tdac_envs.worlds.footprint import Disc
from tdac_envs.worlds.world import Part

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Columns of `Prisms.extent`.
MID_X, MID_Y, REACH, ROUND, LOW, HIGH, FACTOR = range(7)
FIXED = -1


class Owned(NamedTuple):
    """A part and the object that it belongs to.

    Attributes:
        part: A prism.
        owner: Index of an object that can be pushed, or `FIXED`.
        factor: Reflectance of the object.
    """

    part: Part
    owner: int = FIXED
    factor: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Prisms:
    """Discs and convex polygons between two heights, m.

    Attributes:
        points: Shape (m, 2): vertices of all parts, counter-clockwise; the centre of a
            disc.
        first: Shape (n + 1,): index in `points` at which each of the n parts begins.
        extent: Shape (n, 7): x, y and radius of a circle around the part, radius of a
            disc (0 for a polygon), bottom, top, reflectance.
        owner: Shape (n,): index of an object that can be pushed, or `FIXED`.
    """

    points: Array
    first: Index
    extent: Array
    owner: Index

    @classmethod
    def of(cls, owned: Iterable[Owned]) -> Prisms:
        """The arrays of some parts, in the given order."""
        outlines: list[Array] = []
        extent: list[tuple[float, ...]] = []
        owners: list[int] = []
        for part, owner, factor in owned:
            shape = part.shape
            if isinstance(shape, Disc):
                outline, reach = np.array([[shape.x, shape.y]]), shape.radius
            else:
                outline, reach = shape.vertices, 0.0
            middle = (outline.min(axis=0) + outline.max(axis=0)) / 2
            far = float(np.hypot(*(outline - middle).T).max())
            x, y = middle.tolist()
            extent.append((x, y, far + reach, reach, part.bottom, part.top, factor))
            outlines.append(outline)
            owners.append(owner)
        ends = np.cumsum([0, *map(len, outlines)], dtype=np.int64)
        return cls(
            np.concatenate([np.empty((0, 2)), *outlines]),
            ends,
            np.array(extent).reshape(-1, 7),
            np.array(owners, np.int64),
        )

    def arrays(self) -> tuple[Array, Index, Array]:
        """`points`, `first` and `extent` as read-only arguments of kernels."""
        return read_only(self.points), read_only(self.first), read_only(self.extent)

    def copy(self) -> Prisms:
        """A copy with its own `points` and `extent`, which may be changed."""
        return Prisms(self.points.copy(), self.first, self.extent.copy(), self.owner)

    def outline(self, part: int) -> Array:
        """Vertices of a part, shape (n, 2)."""
        return self.points[self.first[part] : self.first[part + 1]]

    def carry(self, origin: Prisms, centres: Array, poses: Array) -> None:
        """Moves the parts that can be pushed to the poses of their objects.

        Args:
            origin: The parts at their initial positions.
            centres: Shape (k, 2): initial centres of the objects.
            poses: Shape (k, 3 or more): current x, y and rotation of the objects.
        """
        for part in np.flatnonzero(self.owner != FIXED).tolist():
            thing = int(self.owner[part])
            x, y, angle = poses[thing, :3].tolist()
            cos, sin = np.cos(angle), np.sin(angle)
            turn = np.array([[cos, sin], [-sin, cos]])
            place = np.array([x, y])
            own = origin.outline(part) - centres[thing]
            self.outline(part)[:] = own @ turn + place
            middle = origin.extent[part, :2] - centres[thing]
            self.extent[part, :2] = middle @ turn + place
