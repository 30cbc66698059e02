"""A map picture with its task, and the type of its readings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from tdac_envs.core.arguments import positive
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import BoolGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.mapping.binarize import disc, otsu, saturated, unknown_level
from tdac_envs.mapping.image import GreyImage, MapImage, luminance
from tdac_envs.mapping.lighting import LEVEL, evened, photographed
from tdac_envs.mapping.params import DEFAULT_OPTIONS, ReadingOptions, Shade
from tdac_envs.mapping.polarity import light_free_evidence
from tdac_envs.mapping.score import NavigationTask, Point

Polarity = Shade | Literal["mixed", "given"]

# Weight of start and goal, where the body's disc must be free. Two clean discs outweigh
# an unclear picture, but not a clear one.
_W_TASK = 2.5
CLOSE = 0.5
"""Log-odds below which the user is asked; public maps with a task are above 5."""


@dataclass(frozen=True, slots=True, eq=False)
class MapReading:
    """One interpretation of a picture: which pixels are obstacles.

    Attributes:
        cells: Shape (height, width), bool, True = occupied.
        polarity: Which pixels are obstacles; "given" if the file defines them.
        method: Description of how the picture was read.
        threshold: Luminance threshold that was applied, 0..255.
        cleanup: Strength of `cleanup.cleanings`, or largest size of dropped specks, px.
        opening: Lines thinner than this were dropped, px.
        lettering: Whether words over start or goal were dropped.
    """

    cells: BoolGrid
    polarity: Polarity
    method: str
    threshold: float | None = None
    cleanup: int = 0
    opening: int = 0
    lettering: bool = False


@dataclass(frozen=True, eq=False)
class MapProblem:
    """A picture with its task, and the data that all its readings need.

    Attributes:
        image: The map; the light of a photograph is evened.
        luminance: Luminance of the map, shape (height, width), uint8.
        start: Pixel (x, y), or None.
        goal: Pixel (x, y), or None.
        radius: Body radius, px.
        options: The user's settings.
        photo: Whether it is a photograph whose light was evened.
        units: Units of messages.
        pointed: Where the user pointed, if words that cover these places are to be
            ignored in any case; else empty.
    """

    image: MapImage
    luminance: GreyImage
    start: Point | None
    goal: Point | None
    radius: float
    options: ReadingOptions = DEFAULT_OPTIONS
    photo: bool = False
    units: MapUnits = PIXELS
    pointed: tuple[Point, ...] = ()

    @classmethod
    def of(
        cls,
        image: MapImage,
        start: Point | None,
        goal: Point | None,
        radius: float,
        options: ReadingOptions = DEFAULT_OPTIONS,
        units: MapUnits = PIXELS,
    ) -> MapProblem:
        """The scene of an image and a task; start and goal may be None.

        Raises:
            TaskError: The radius is out of range.
        """
        if not radius > 0:
            raise TaskError(f"expected a robot radius above 0 px, got {radius:g}")
        positive("robot_radius", radius)  # checks the upper limit
        grey, task = luminance(image.colour), (start, goal, radius, options)
        automatic = image.occupied is None and options.threshold is None
        even = evened(image.colour, grey) if automatic and photographed(grey) else None
        if even is None:
            return cls(image, grey, *task, units=units)
        image = replace(image, colour=even.colour)
        return cls(image, even.luminance, *task, photo=True, units=units)

    @property
    def ends(self) -> list[Point]:
        """Start and goal, without those that are not given."""
        return [point for point in (self.start, self.goal) if point is not None]

    @property
    def polarities(self) -> tuple[Shade, ...]:
        """The possible polarities: both, unless the user has chosen one."""
        polarity = self.options.polarity
        return ("dark", "light") if polarity is None else (polarity,)

    @property
    def trip(self) -> NavigationTask | None:
        """The navigation task; None unless both start and goal are given."""
        if self.start is None or self.goal is None:
            return None
        return NavigationTask(self.start, self.goal, self.radius, self.units)

    @cached_property
    def threshold(self) -> float:
        """Luminance above which a pixel is light: given, `LEVEL` (photo), or Otsu's."""
        if self.options.threshold is not None:
            return self.options.threshold
        return LEVEL if self.photo else otsu(self.luminance)

    def with_ends(
        self, start: Point | None, goal: Point | None, pointed: tuple[Point, ...] = ()
    ) -> MapProblem:
        """This problem with another task; what depends only on the picture is kept."""
        changed = replace(self, start=start, goal=goal, pointed=pointed)
        kept = ("threshold", "picture_evidence", "saturated")
        vars(changed).update({k: v for k, v in vars(self).items() if k in kept})
        return changed

    @cached_property
    def picture_evidence(self) -> float:
        """Log-odds that the light side is free, from the picture alone."""
        light = self.luminance > self.threshold
        return light_free_evidence(self.luminance, light, self.photo)

    @cached_property
    def evidence(self) -> float:
        """Log-odds that the light side is free, from the picture, start and goal."""
        light, found = self.luminance > self.threshold, self.picture_evidence
        # Ignores marks on start or goal, unless the whole paper is coloured.
        neutral = ~self.saturated
        neutral = neutral if neutral.mean() > 0.5 else np.ones_like(neutral)
        for x, y in self.ends:
            judged = disc(light.shape, x, y, self.radius) & neutral
            if not judged.any():
                continue
            found += _W_TASK * (2 * float(light[judged].mean()) - 1)
        return found

    @cached_property
    def saturated(self) -> BoolGrid:
        """Pixels of strong colour."""
        return saturated(self.image.colour)

    @cached_property
    def unknown(self) -> int | None:
        """The "unknown" grey; None if there is none or all given ends are on it."""
        automatic = self.options.threshold is None and not self.photo
        level = unknown_level(self.luminance) if automatic else None
        if level is None:
            return None
        shades = [abs(int(self.luminance[y, x]) - level) for x, y in self.ends]
        return None if shades and max(shades) <= 3 else level


def decide_light_free(scene: MapProblem) -> bool:
    """Whether the light side is free: as given, or by the evidence."""
    if scene.options.polarity is not None:
        return scene.options.polarity == "dark"
    return scene.evidence > 0


def is_polarity_unclear(scene: MapProblem, polarity: Polarity) -> bool:
    """Whether the other polarity is nearly as likely as this one, or likelier."""
    settled = scene.image.occupied is not None or scene.options.polarity is not None
    if settled or polarity not in ("dark", "light"):
        return False
    towards = scene.evidence if polarity == "dark" else -scene.evidence
    return towards < CLOSE


def touches(mask: BoolGrid, points: list[Point]) -> bool:
    """Whether any of the points is in the mask."""
    return any(bool(mask[y, x]) for x, y in points)
