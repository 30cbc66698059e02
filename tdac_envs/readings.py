"""Readings of a map picture, from the plain one outwards.

A reading says which pixels are occupied. Later readings explain more of the picture
away, and each does so only where the picture itself gives a reason: a strong colour,
pieces too small for walls, lines too thin for this map's walls. None removes a stroke
of the walls' own colour and thickness, so that a closed map stays closed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from tdac_envs.binarize import (
    disc,
    floor_distance,
    local_light,
    otsu,
    outside,
    saturated,
    unevenly_lit,
    unknown_level,
)
from tdac_envs.cleanup import thick_share, without_lines, without_specks
from tdac_envs.grid import BoolGrid
from tdac_envs.image import GreyImage, MapImage, luminance
from tdac_envs.polarity import light_free_evidence
from tdac_envs.score import Point

Polarity = Literal["dark", "light", "mixed", "given"]


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


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A picture with what is asked of it."""

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


def readings(scene: Scene) -> Iterator[Reading]:
    """Readings of the likelier polarity, the plainest first.

    Without start and goal there is only the plain one, marks ignored: nothing could
    tell whether a bolder one is needed.
    """
    given = scene.image.occupied
    if given is not None:
        yield Reading(given, "given", scene.image.method)
        return
    light_free = decide_light_free(scene)
    plain = plain_reading(scene, light_free)
    unmarked = _without_marks(scene.image, plain)
    if not scene.ends:
        yield unmarked or plain
        return
    beyond = _beyond_the_plan(scene, light_free)
    for reading in _outwards(scene, plain, unmarked):
        yield _walled_in(reading, beyond)


def _outwards(
    scene: Scene, plain: Reading, unmarked: Reading | None
) -> Iterator[Reading]:
    mixed = _mixed(scene)
    if mixed is not None:
        yield mixed
        for extent in (4, 8, 16):
            cells = without_specks(mixed.cells, extent)
            yield _note(mixed, cells, f"specks up to {extent} px ignored", extent, 0)
        return
    yield plain
    base = unmarked or plain
    if unmarked is not None:
        yield unmarked
    if _unknown(scene) is not None:
        # A mapping tool's output: every dark pixel was measured, none was drawn.
        return
    yield from _bolder(base)
    if unevenly_lit(scene.luminance, ~plain.cells):
        local = _local(scene, base)
        yield local
        yield from _bolder(local)


def _beyond_the_plan(scene: Scene, light_free: bool) -> BoolGrid:
    """The outside, where start and goal are inside; empty otherwise."""
    region = outside(scene.luminance, light_free)
    if _on(region, scene.ends):
        return np.zeros_like(region)
    return region


def _walled_in(reading: Reading, beyond: BoolGrid) -> Reading:
    """The reading with the paper around the building closed.

    Windows are drawn with thin or grey lines, and no robot leaves through them.
    """
    if reading.polarity == "mixed" or not (beyond & ~reading.cells).any():
        return reading
    note = f"{reading.method}, outside of the plan closed"
    return replace(reading, cells=reading.cells | beyond, method=note)


def plain_reading(scene: Scene, light_free: bool) -> Reading:
    """Otsu's threshold, with two things that it cannot know.

    A map saver's "unknown" grey counts as occupied, and where most walls are drawn in
    strong colours, the light ones among these (green, yellow) are walls as well.
    """
    threshold, method = otsu(scene.luminance), "otsu"
    level = _unknown(scene)
    if level is not None:
        threshold = _beside(level, threshold, light_free)
        method = f"otsu, unknown grey {level} not free"
    reading = _cut(scene.luminance, threshold, light_free, method)
    strong = saturated(scene.image.colour)
    coloured = int((strong & reading.cells).sum()) > 0.5 * int(reading.cells.sum())
    if coloured and strong.mean() < 0.3 and not _on(strong, scene.ends):
        method = f"{method}, coloured walls"
        return replace(reading, cells=reading.cells | strong, method=method)
    return reading


def _unknown(scene: Scene) -> int | None:
    """The "unknown" grey, unless the task stands on it."""
    level = unknown_level(scene.luminance)
    if level is None:
        return None
    known = np.abs(scene.luminance.astype(np.int16) - level) > 3
    return None if _on(~known, scene.ends) else level


def _beside(level: int, threshold: float, light_free: bool) -> float:
    """A threshold that leaves the unknown grey on the occupied side.

    Whatever is more free than a map saver's 205 is free by its own rule.
    """
    safe = level + 0.5 if light_free else level - 0.5
    if level > 190 or level < 65:
        return safe
    return max(threshold, safe) if light_free else min(threshold, safe)


def _on(mask: BoolGrid, points: list[Point]) -> bool:
    return any(bool(mask[y, x]) for x, y in points)


def _cut(grey: GreyImage, threshold: float, light_free: bool, method: str) -> Reading:
    light = grey > threshold
    cells = ~light if light_free else light
    return Reading(cells, "dark" if light_free else "light", method, threshold)


def decide_light_free(scene: Scene) -> bool:
    """Whether the light side is free, from the picture, start and goal."""
    light = scene.luminance > otsu(scene.luminance)
    evidence = light_free_evidence(scene.luminance, light)
    neutral = ~saturated(scene.image.colour)
    for x, y in scene.ends:
        around = disc(light.shape, x, y, scene.radius)
        judged = around & neutral if (around & neutral).any() else around
        evidence += _W_TASK * (2 * float(light[judged].mean()) - 1)
    return evidence > 0


# Start and goal of a real task are free with the body's disc around them, so two
# clean discs outweigh a doubtful picture but not a clear one.
_W_TASK = 2.0


def _without_marks(image: MapImage, reading: Reading) -> Reading | None:
    """Saturated marks and lines dropped, where walls are of another colour."""
    marks = saturated(image.colour) & reading.cells
    few = marks.sum() <= min(0.02 * marks.size, 0.4 * reading.cells.sum())
    if not few or not marks.any():
        return None
    chroma = np.ptp(image.colour.astype(np.int16), axis=2)
    near = cv2.dilate(marks.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    cells = reading.cells & ~(near & (chroma >= 30))
    return replace(reading, cells=cells, method=f"{reading.method}, marks ignored")


def _mixed(scene: Scene) -> Reading | None:
    """What is unlike the floor at start and goal, where that is of a middle tone.

    Only where both darker and lighter pixels border on the floor: then no threshold
    separates it.
    """
    shape, colour = scene.luminance.shape, scene.image.colour
    spots = [disc(shape, x, y, scene.radius / 2) for x, y in scene.ends]
    floors = np.array([np.median(colour[spot], axis=0) for spot in spots])
    if float(np.ptp(floors, axis=0).max()) > 16:
        return None
    floor = floors.mean(axis=0)
    grey = int(luminance(np.rint(floor).astype(np.uint8)[None, None])[0, 0])
    gap = scene.luminance.astype(np.int16) - grey
    like = (np.abs(gap) < 8).astype(np.uint8)
    beside = cv2.dilate(like, np.ones((5, 5), np.uint8)) > 0
    shares = [float((beside & far).mean()) for far in (gap <= -20, gap >= 20)]
    if like.mean() < 0.02 or min(shares) < 0.003 or (gap <= -20).mean() < 0.03:
        return None
    distance = floor_distance(colour, floor)
    cells = np.asarray(distance > otsu(distance))
    return Reading(cells, "mixed", "colour unlike the floor")


def _bolder(base: Reading) -> Iterator[Reading]:
    """Drops specks, then lines that are thin beside this map's walls."""
    shape = base.cells.shape
    for extent in (4, 8, 16, 32):
        if extent <= 0.04 * min(shape):
            cells = without_specks(base.cells, extent)
            yield _note(base, cells, f"specks up to {extent} px ignored", extent, 0)
    for width in (3, 5) if min(shape) >= 1500 else (3,):
        if thick_share(base.cells, 2 * width) < 0.5:
            return
        opened = without_lines(base.cells, width)
        for extent in (8, 16, 32):
            if extent <= 0.04 * min(shape):
                cells = without_specks(opened, extent)
                note = f"lines under {width} px and specks up to {extent} px ignored"
                yield _note(base, cells, note, extent, width)


def _note(
    base: Reading, cells: BoolGrid, note: str, cleanup: int, opening: int
) -> Reading:
    return replace(
        base,
        cells=cells,
        method=f"{base.method}, {note}",
        cleanup=cleanup,
        opening=opening,
    )


def _local(scene: Scene, base: Reading) -> Reading:
    """A threshold that follows the lighting."""
    grey = scene.luminance if base.polarity == "dark" else 255 - scene.luminance
    window = 2 * (min(grey.shape) // 16) + 1
    light = local_light(grey, max(window, 15))
    return replace(base, cells=~light, method="local threshold", threshold=None)
