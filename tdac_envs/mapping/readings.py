"""Readings of a map picture, from the plain one to bolder ones.

A reading says which pixels are occupied. Later readings ignore more obstacles, but only
for a reason in the picture: a strong colour, pieces too small for walls, lines too thin
for this map's walls. No reading removes a stroke with the colour and thickness of the
walls, so that a closed map stays closed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from tdac_envs.grid.grid import BoolGrid
from tdac_envs.mapping.binarize import (
    chroma,
    disc,
    floor_distance,
    otsu,
    outside,
)
from tdac_envs.mapping.cleanup import thick_share, without_lines, without_specks
from tdac_envs.mapping.image import GreyImage, luminance
from tdac_envs.mapping.lettering import without_lettering
from tdac_envs.mapping.lighting import LEVEL
from tdac_envs.mapping.params import DEFAULT_OPTIONS
from tdac_envs.mapping.scene import MapProblem, MapReading, decide_light_free, touches
from tdac_envs.mapping.wording import OUTSIDE_CLOSED

SLIVER = 6.0
"""Largest width of a strip that counts as part of the outside, px."""
_FAINT = 0.3
"""Share of the distance to the floor by which a photograph's threshold is shifted."""


def readings(scene: MapProblem, light_free: bool | None = None) -> Iterator[MapReading]:
    """Readings of the likelier polarity, the plainest first.

    Without start and goal there is only one, with marks ignored, because nothing shows
    whether a bolder one is needed.

    Args:
        scene: The picture with its task.
        light_free: The polarity; by default from the picture, start and goal.
    """
    given = scene.image.occupied
    if given is not None:
        yield MapReading(given, "given", scene.image.method)
        return
    if light_free is None:
        light_free = decide_light_free(scene)
    plain = plain_reading(scene, light_free)
    unmarked = _without_marks(scene, plain)
    if not scene.ends:
        yield unmarked or plain
        return
    beyond = _beyond_the_plan(scene, plain)
    for reading in _plain_to_bold(scene, plain, unmarked):
        yield _with_outside_closed(reading, beyond)


def _plain_to_bold(
    scene: MapProblem, plain: MapReading, unmarked: MapReading | None
) -> Iterator[MapReading]:
    mixed = _mixed(scene) if scene.options == DEFAULT_OPTIONS else None
    if mixed is not None:
        yield from _with_words(scene, [mixed])
        for extent in (4, 8, 16):
            yield _without(_wordless(scene, mixed) or mixed, extent)
        return
    base = unmarked or plain
    plainest = [plain] if unmarked is None else [plain, unmarked]
    if scene.unknown is not None:
        # Output of a mapping tool: its dark pixels were measured, not drawn.
        yield from plainest
        yield _without(base, 4)
        return
    yield from _with_words(scene, plainest)
    yield from _bolder(_wordless(scene, base) or base)


def _with_words(scene: MapProblem, plainest: list[MapReading]) -> Iterator[MapReading]:
    """The readings, then the last one without the words over start and goal."""
    wordless = _wordless(scene, plainest[-1])
    if wordless is None or not scene.pointed:
        yield from plainest
    if wordless is not None:
        yield wordless


def _wordless(scene: MapProblem, base: MapReading) -> MapReading | None:
    """The reading without the words over start and goal; None if there are none."""
    cells = without_lettering(base.cells, scene.pointed or scene.ends)
    if cells is None:
        return None
    note = "words over start or goal ignored"
    return replace(base, cells=cells, method=f"{base.method}, {note}", lettering=True)


def _beyond_the_plan(scene: MapProblem, plain: MapReading) -> BoolGrid:
    """The outside of the plan; empty if start or goal is in it."""
    strong = scene.saturated
    ignored = strong if _are_marks(scene, strong, plain) else np.zeros_like(strong)
    region = outside(scene.luminance, plain.polarity == "dark", ignored)
    if touches(region, scene.ends):
        return np.zeros_like(region)
    return region


def _with_outside_closed(reading: MapReading, beyond: BoolGrid) -> MapReading:
    """The reading with the paper around the building marked as occupied.

    Windows are drawn with thin or grey lines, but no robot may leave through them.
    """
    if reading.polarity == "mixed" or not (beyond & ~reading.cells).any():
        return reading
    note = f"{reading.method}, {OUTSIDE_CLOSED}"
    cells = reading.cells | beyond
    return replace(reading, cells=cells | _slivers(cells, beyond), method=note)


def _slivers(cells: BoolGrid, beyond: BoolGrid) -> BoolGrid:
    """Free pieces only near the outside, such as blurred edges or gaps in letters."""
    count, labels = cv2.connectedComponents((~cells).astype(np.uint8), connectivity=4)
    apart = cv2.distanceTransform((~beyond).astype(np.uint8), cv2.DIST_L2, 3) > SLIVER
    deep = np.bincount(labels[apart], minlength=count) > 0
    deep[0] = True
    return np.asarray(~deep[labels])


def plain_reading(scene: MapProblem, light_free: bool) -> MapReading:
    """The reading by one threshold, with two corrections.

    A map saver's "unknown" grey is occupied. If most walls are drawn in strong colours,
    light strong colours such as yellow are walls, too.
    """
    threshold, method = scene.threshold, "otsu"
    if scene.options.threshold is not None:
        method = "threshold as given"
    elif scene.photo:
        method = "light evened"
    if scene.options.polarity is not None:
        method += ", polarity as given"
    level = scene.unknown
    if level is not None:
        threshold = _threshold_beyond(level, threshold, light_free)
        method = f"otsu, unknown grey {level} not free"
    reading = _cut(scene.luminance, threshold, light_free, method)
    if scene.photo:
        reading = _of_photo(scene, light_free, method)
    strong = scene.saturated
    coloured = int((strong & reading.cells).sum()) > 0.5 * int(reading.cells.sum())
    if coloured and strong.mean() < 0.3 and not touches(strong, scene.ends):
        method = f"{method}, coloured walls"
        return replace(reading, cells=reading.cells | strong, method=method)
    return reading


def _of_photo(scene: MapProblem, light_free: bool, method: str) -> MapReading:
    """A photograph's reading; a threshold nearer the floor keeps blurred thin walls."""
    grey = scene.luminance
    floor = float(np.median(grey[(grey > scene.threshold) == light_free]))
    cut = scene.threshold + _FAINT * (floor - scene.threshold)
    # This threshold does not apply to the original picture.
    return replace(_cut(grey, cut, light_free, method), threshold=None)


def unknown_grey(method: str) -> int | None:
    """The unknown grey that a reading's `method` names, or None."""
    found = re.search(r"unknown grey (\d+) not free", method)
    return int(found[1]) if found else None


def _threshold_beyond(level: int, threshold: float, light_free: bool) -> float:
    """A threshold with the unknown grey on the occupied side.

    By the rule of ROS `map_saver`, every level beyond its unknown grey (205) is free.
    """
    safe = level + 0.5 if light_free else level - 0.5
    if level > 190 or level < 65:
        return safe
    return max(threshold, safe) if light_free else min(threshold, safe)


def _cut(
    grey: GreyImage, threshold: float, light_free: bool, method: str
) -> MapReading:
    light = grey > threshold
    cells = ~light if light_free else light
    return MapReading(cells, "dark" if light_free else "light", method, threshold)


def _are_marks(scene: MapProblem, strong: BoolGrid, plain: MapReading) -> bool:
    """Whether strong colours are marks: few pixels, covering few wall pixels."""
    on_walls = int((strong & plain.cells).sum())
    allowed = 0.05 if touches(strong, scene.ends) else 0.02
    few = float(strong.mean()) <= allowed
    return few and on_walls <= 0.4 * float(plain.cells.sum())


def _without_marks(scene: MapProblem, plain: MapReading) -> MapReading | None:
    """The reading without saturated marks and lines; None if there are none."""
    colour = scene.image.colour
    strong = scene.saturated
    marks = strong & plain.cells
    if not marks.any() or not _are_marks(scene, strong, plain):
        return None
    near = cv2.dilate(marks.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    cells = plain.cells & ~(near & (chroma(colour) >= 30))
    return replace(plain, cells=cells, method=f"{plain.method}, marks ignored")


def _mixed(scene: MapProblem) -> MapReading | None:
    """The reading by colour distance from the floor, for a floor of a middle tone.

    None unless much of the floor's rim is darker and much of it is lighter, so that no
    threshold separates the floor. The floor has the colour of start and goal.
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
    # Noise makes a photographed floor darker and lighter, too, but by less.
    far = max(20.0, abs(grey - LEVEL)) if scene.photo else 20.0
    rim = (cv2.dilate(like, np.ones((5, 5), np.uint8)) > 0) & (np.abs(gap) >= far)
    darker = float((gap[rim] < 0).mean()) if rim.any() else 0.0
    if like.mean() < 0.02 or not 0.2 <= darker <= 0.8:
        return None
    distance = floor_distance(colour, floor)
    cells = np.asarray(distance > otsu(distance))
    return MapReading(cells, "mixed", "colour unlike the floor")


def _bolder(base: MapReading) -> Iterator[MapReading]:
    """Drops specks, then lines that are thin compared with this map's walls."""
    shape = base.cells.shape
    for extent in (4, 8, 16, 32):
        if extent <= 0.04 * min(shape):
            yield _without(base, extent)
    for width in (3, 5) if min(shape) >= 1500 else (3,):
        if thick_share(base.cells, 2 * width) < 0.5:
            return
        opened = without_lines(base.cells, width)
        for extent in (8, 16, 32):
            if extent <= 0.04 * min(shape):
                cells = without_specks(opened, extent)
                note = f"lines under {width} px and specks up to {extent} px ignored"
                yield _note(base, cells, note, extent, width)


def _without(base: MapReading, extent: int) -> MapReading:
    cells = without_specks(base.cells, extent)
    return _note(base, cells, f"specks up to {extent} px ignored", extent, 0)


def _note(
    base: MapReading, cells: BoolGrid, note: str, cleanup: int, opening: int
) -> MapReading:
    return replace(
        base,
        cells=cells,
        method=f"{base.method}, {note}",
        cleanup=cleanup,
        opening=opening,
    )
