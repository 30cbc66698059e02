"""Arguments and options in metres of a map's frame, converted to pixels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tdac_envs.core.arguments import (
    finite,
    finite_numbers,
    finite_point,
    non_negative,
    positive,
)
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.grid.metric import Point
from tdac_envs.movers.spec import AnySpec

LENGTHS = (
    *("robot_radius", "axle_length", "max_wheel_speed", "range_max"),
    "goal_tolerance",
)
"""Arguments of `Map2DEnv` that are lengths, or lengths per second."""
LENGTHS_OR_ZERO = (
    *("max_speed", "pose_noise", "range_min", "max_acceleration"),
    "stopping_distance",
)
"""Those that may be 0, lengths per second squared among them."""


def in_pixels(units: MapUnits, **given: Any) -> dict[str, Any]:
    """Arguments of `Map2DEnv` in px; None stays.

    Args:
        units: Units of the arguments.
        **given: Lengths by name, `start`, `goal`, `heading`, `ray_angles` and `movers`
            (specs).

    Raises:
        TaskError: A value is not valid.
    """
    if units.frame is None:
        return given
    own = options_in_pixels(given, units)
    if given["heading"] is not None:
        own["heading"] = units.heading_in_pixels(finite("heading", given["heading"]))
    for name in LENGTHS:
        if given[name] is not None:
            own[name] = units.length_in_pixels(positive(name, given[name]))
    if given["ray_angles"] is not None:
        turns = given["ray_angles"]
        angles = finite_numbers("ray_angles", turns, np.size(turns))
        own["ray_angles"] = tuple(0.0 - angle for angle in angles)
    if given.get("scanner_offset") is not None:
        ahead, left = finite_point("scanner_offset", given["scanner_offset"])
        scale = 1.0 / units.per_pixel
        own["scanner_offset"] = (ahead * scale, 0.0 - left * scale)
    for name in LENGTHS_OR_ZERO:
        if given.get(name):
            own[name] = units.length_in_pixels(non_negative(name, given[name]))
    own["movers"] = movers_in_pixels(given["movers"], units)
    return own


def options_in_pixels(options: dict[str, Any], units: MapUnits) -> dict[str, Any]:
    """The options `start` and `goal` of `reset` in px; others stay.

    Raises:
        TaskError: One of them is not a place.
    """
    if units.frame is None:
        return options
    own = dict(options)
    if own.get("start") is not None:
        own["start"] = _start_in_pixels(own["start"], units)
    if own.get("goal") is not None:
        own["goal"] = units.pixels(finite_point("goal", own["goal"]))
    return own


def _start_in_pixels(start: Sequence[float], units: MapUnits) -> tuple[float, ...]:
    x, y, *turn = finite_numbers("start", start, 3 if np.size(start) == 3 else 2)
    return (*units.pixels((x, y)), *map(units.heading_in_pixels, turn))


def movers_in_pixels(specs: Sequence[AnySpec], units: MapUnits) -> tuple[AnySpec, ...]:
    """Movers whose places, lengths and headings are in these units, in px."""
    convert = units.length_in_pixels, units.pixels, units.heading_in_pixels
    return tuple(_converted(spec, *convert) for spec in specs)


def movers_in(units: MapUnits, specs: Sequence[AnySpec]) -> tuple[AnySpec, ...]:
    """Movers in px, converted for a file; the inverse of the above."""

    def place(point: Point) -> Point:
        return units.written_place(*point)

    convert = units.written_length, place, units.heading
    return tuple(_converted(spec, *convert) for spec in specs)


def _converted(
    spec: AnySpec,
    length: Callable[[float], float],
    place: Callable[[Point], Point],
    heading: Callable[[float], float],
) -> AnySpec:
    changes: dict[str, Any] = {
        name: length(own)
        for name in ("radius", "speed")
        if (own := getattr(spec, name)) is not None
    }
    if spec.kind == "route":
        changes["points"] = tuple(map(place, spec.points))
    elif spec.kind == "bounce":
        if spec.start is not None:
            changes["start"] = place(spec.start)
        if spec.heading is not None:
            changes["heading"] = heading(spec.heading)
    return spec.model_copy(update=changes)
