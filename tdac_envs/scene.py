"""A picture with what is asked of it, and what a reading of it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from tdac_envs.binarize import (
    disc,
    local_light,
    otsu,
    saturated,
    unevenly_lit,
    unknown_level,
)
from tdac_envs.grid import BoolGrid
from tdac_envs.image import GreyImage, MapImage, luminance
from tdac_envs.polarity import light_free_evidence
from tdac_envs.score import Point, Trip

Polarity = Literal["dark", "light", "mixed", "given"]

# Start and goal of a real task are free with the body's disc around them, so two
# clean discs outweigh a doubtful picture but not a clear one.
_W_TASK = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """One way to tell obstacles from free space.

    Attributes:
        cells: Shape (height, width), bool, True = occupied.
        polarity: Which pixels are obstacles.
        method: What was done, in words.
        threshold: Luminance at which the picture was cut, 0..255.
        cleanup: Strength of `cleanup.clean` or largest speck dropped, px.
        opening: Lines thinner than this were dropped, px.
    """

    cells: BoolGrid
    polarity: Polarity
    method: str
    threshold: float | None = None
    cleanup: int = 0
    opening: int = 0


@dataclass(frozen=True, eq=False)
class Scene:
    """A picture with what is asked of it, and what all its readings need."""

    image: MapImage
    luminance: GreyImage
    start: Point | None
    goal: Point | None
    radius: float

    @classmethod
    def of(
        cls, image: MapImage, start: Point | None, goal: Point | None, radius: float
    ) -> Scene:
        """The scene of an image and a task; start and goal may be missing."""
        return cls(image, luminance(image.colour), start, goal, radius)

    @property
    def ends(self) -> list[Point]:
        """Start and goal, as far as given."""
        return [point for point in (self.start, self.goal) if point is not None]

    @property
    def trip(self) -> Trip | None:
        """What the body has to do; None unless both start and goal are given."""
        if self.start is None or self.goal is None:
            return None
        return Trip(self.start, self.goal, self.radius)

    @cached_property
    def threshold(self) -> float:
        """Otsu's threshold of the luminance."""
        return otsu(self.luminance)

    @cached_property
    def saturated(self) -> BoolGrid:
        """Pixels of strong colour."""
        return saturated(self.image.colour)

    @cached_property
    def unknown(self) -> int | None:
        """The "unknown" grey, unless start and goal both stand on it."""
        level = unknown_level(self.luminance)
        if level is None:
            return None
        shades = [abs(int(self.luminance[y, x]) - level) for x, y in self.ends]
        return None if shades and max(shades) <= 3 else level


def decide_light_free(scene: Scene) -> bool:
    """Whether the light side is free, from the picture, start and goal."""
    grey = scene.luminance
    if unevenly_lit(grey):
        negative = np.asarray(255 - grey, np.uint8)
        on_light, on_dark = local_light(grey), local_light(negative)
        return _evidence(scene, grey, on_light) >= _evidence(scene, negative, on_dark)
    return _evidence(scene, grey, grey > scene.threshold) > 0


def _evidence(scene: Scene, grey: GreyImage, light: BoolGrid) -> float:
    """Log-odds that `light` is free, start and goal considered."""
    evidence = light_free_evidence(grey, light)
    neutral = ~scene.saturated
    for x, y in scene.ends:
        around = disc(light.shape, x, y, scene.radius)
        judged = around & neutral if (around & neutral).any() else around
        evidence += _W_TASK * (2 * float(light[judged].mean()) - 1)
    return evidence


def touches(mask: BoolGrid, points: list[Point]) -> bool:
    """Whether any of the points lies on the mask."""
    return any(bool(mask[y, x]) for x, y in points)
