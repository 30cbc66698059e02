"""Describes in words how a map was read."""

from __future__ import annotations

import re
from typing import Protocol

from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.mapping.params import MapParams

OUTSIDE_CLOSED = "outside of the plan closed"
"""Note of a reading in which the area around the plan is not free."""
_FOUND = {"otsu": "by Otsu's method", "threshold as given": "as given"}
_FILES = {"given": "those of the grid", "movingai": "those of the MovingAI file"}
_ALSO = {
    "coloured walls": "coloured walls",
    OUTSIDE_CLOSED: "the area outside of the plan",
}


class Read(Protocol):
    """How a map was read: a `MapReading` or `MapParams`."""

    @property
    def polarity(self) -> str:
        """Which pixels are obstacles; `given` if the file defines it."""

    @property
    def method(self) -> str:
        """The notes on the reading, separated by commas."""

    @property
    def threshold(self) -> float | None:
        """Luminance above which a pixel is light, 0..255; None if it does not apply."""


def obstacles_text(read: Read) -> str:
    """Says which pixels count as obstacles, and what was ignored.

    For example: `obstacles are dark pixels (brightness up to 127 of 255, a threshold by
    Otsu's method) and coloured walls; ignored: marks`.
    """
    if read.polarity == "given":
        return f"obstacles are {_of_file(read.method)}"
    notes = read.method.split(", ")
    kinds = [_pixels(read, notes)]
    for note in notes:
        grey = re.fullmatch(r"unknown grey (\d+) not free", note)
        kinds += [f"unknown areas (grey {grey[1]})"] if grey else []
        kinds += [_ALSO[note]] if note in _ALSO else []
    ignored = [
        note.removesuffix(" ignored") for note in notes if note.endswith(" ignored")
    ]
    text = f"obstacles are {_listed(kinds)}"
    return f"{text}; ignored: {_listed(ignored)}" if ignored else text


def scale_text(resolution: float | None) -> str:
    """Says how long a pixel is, as far as the map file says it."""
    if resolution is None:
        return "the file gives no resolution"
    return f"{resolution:g} m per px"


def with_hints(
    reason: str, grid: OccupancyGrid, params: MapParams, units: MapUnits
) -> str:
    """The reason of a refusal, with questions on what may have been meant.

    Args:
        reason: Why the task is infeasible on the map.
        grid: The map.
        params: Start, goal, robot, and how the picture was read.
        units: Units in which start and goal were given.
    """
    hints = (
        _metres_hint(grid, params) if units == PIXELS else "",
        _light_hint(params),
        scale_hint(params.robot.radius, grid.resolution),
    )
    return "; ".join(filter(None, (reason, *hints)))


def _metres_hint(grid: OccupancyGrid, params: MapParams) -> str:
    """Asks whether places that were given in px are in metres; else empty.

    They may be if the map has a resolution, and both are free places of it in metres.
    """
    if grid.resolution is None or params.start is None or params.goal is None:
        return ""
    units = MapUnits.metres(grid)
    places = params.start, params.goal
    if any(grid.is_occupied(*units.pixels(place)) for place in places):
        return ""
    return "did you mean --metres? As metres, start and goal are free places"


def scale_hint(radius: float, resolution: float | None) -> str:
    """Asks whether a scale is right if the body is smaller than a pixel; else empty.

    Args:
        radius: Of the body, px.
        resolution: Length of a pixel, m; None if it is not known.
    """
    if radius >= 1.0:
        return ""
    if resolution is None:
        return (
            f"the body's radius is {radius:g} px; if it is in metres, give the metres "
            "per px (--resolution, resolution=)"
        )
    return (
        f"the body's radius is {radius:.2g} px: is a resolution of {resolution:g} m "
        "per px right?"
    )


def _light_hint(read: Read) -> str:
    """Says that light pixels were found to be the obstacles, as they may not be."""
    if read.polarity != "light" or "polarity as given" in read.method.split(", "):
        return ""
    return (
        "light pixels were taken for the obstacles; if they are the dark ones, give "
        "polarity='dark' (--polarity dark)"
    )


def _of_file(method: str) -> str:
    """The rule of a file that itself defines the obstacles."""
    kind, _, mode = method.partition(" ")
    if kind == "ros":
        return f"all pixels that the ROS file does not define as free (mode {mode})"
    return _FILES.get(method, f"those of the file ({method})")


def _pixels(read: Read, notes: list[str]) -> str:
    """Names the pixels on the obstacles' side of the threshold."""
    if read.polarity == "mixed":
        return "pixels whose colour differs from the floor"
    chosen = " as chosen" if "polarity as given" in notes else ""
    if "light evened" in notes:
        how = "after uneven light was corrected"
    elif read.threshold is None:
        how = notes[0]
    else:
        side = "up to" if read.polarity == "dark" else "above"
        found = _FOUND.get(notes[0], notes[0])
        how = f"brightness {side} {read.threshold:g} of 255, a threshold {found}"
    return f"{read.polarity} pixels{chosen} ({how})"


def _listed(things: list[str]) -> str:
    """Joins words: `a`, `a and b`, `a, b and c`."""
    return " and ".join(filter(None, (", ".join(things[:-1]), things[-1])))
