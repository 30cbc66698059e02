"""A world as a file describes it, and whether its task is feasible."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from tdac_envs.core.hashing import sha256_of
from tdac_envs.grid.grid import BoolGrid, body_free, clearance

Pixel = tuple[int, int]


@dataclass(frozen=True, eq=False)
class FileWorld:
    """A map with a task, as read from a file.

    Attributes:
        name: What it is called.
        file: Where it stands, for messages.
        kind: What results are grouped by.
        origin: Where the map comes from, if that is known.
        shape: Height and width, px.
        packed: The map's bits, row by row, from `numpy.packbits`; 1 = occupied.
        start: Pixel (x, y).
        heading: Heading at the start, rad.
        goal: Pixel (x, y).
        barn_seconds: OT of the BARN challenge, s, where its file states one.
    """

    name: str
    file: str
    kind: str
    origin: str | None
    shape: tuple[int, int]
    packed: bytes
    start: Pixel
    heading: float
    goal: Pixel
    barn_seconds: float | None = None

    @property
    def cells(self) -> BoolGrid:
        """The map, shape (height, width), bool, True = occupied."""
        height, width = self.shape
        bits = np.unpackbits(np.frombuffer(self.packed, np.uint8), count=height * width)
        return bits.astype(np.bool_).reshape(self.shape)

    @cached_property
    def content(self) -> str:
        """SHA-256 of the map."""
        return sha256_of(repr(self.shape), self.packed)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of everything that an episode or a result depends on."""
        task = (self.start, self.heading, self.goal, self.barn_seconds)
        return sha256_of(repr((self.name, self.kind, self.origin, self.content, task)))

    def problem(self, radius: float, tolerance: float) -> str | None:
        """Why the task is not feasible, or None.

        Args:
            radius: Radius of the body, px.
            tolerance: Distance at which the goal is reached, px.
        """
        height, width = self.shape
        for name, (x, y) in (("start", self.start), ("goal", self.goal)):
            if not (0 <= x < width and 0 <= y < height):
                return f"{name} ({x}, {y}) lies outside the map of {width} x {height}"
        clear = clearance(self.cells)
        body = f"for a body of {radius:g} px radius"
        for name, (x, y) in (("start", self.start), ("goal", self.goal)):
            if not clear[y, x] >= radius:
                room = f"{clear[y, x]:.1f} px from a wall"
                return f"{name} ({x}, {y}) is {room}, too near {body}"
        if math.dist(self.start, self.goal) <= tolerance:
            return f"the start is within the tolerance of {tolerance:g} px of the goal"
        free = body_free(clear, radius).astype(np.uint8)
        _, labels = cv2.connectedComponents(free, connectivity=4)
        (x, y), (goal_x, goal_y) = self.start, self.goal
        if labels[y, x] == 0 or labels[y, x] != labels[goal_y, goal_x]:
            return f"there is no way {body} from start ({x}, {y}) to the goal"
        return None
