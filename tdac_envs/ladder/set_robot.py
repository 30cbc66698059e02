"""The robot file that a `set.yaml` names, as values of the set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tdac_envs.core.arguments import positive
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.ladder.set_disturbances import LENGTHS, DisturbanceSpec
from tdac_envs.map2d.robot_options import options_of
from tdac_envs.robots.bundled import load_robot

_ERRORS = DisturbanceSpec.model_fields.keys() - {"range_min", "max_acceleration"}
"""Disturbances of a set; the others are properties of its robot."""
_KEYS = {"robot_radius": "radius", "field_of_view": "field_of_view_deg"}


def metres_per_px(resolution: float) -> MapUnits:
    """Metres of worlds that have no place on a map: for lengths and angles."""
    return MapUnits(MapFrame(1, resolution, (0.0, 0.0, 0.0)))


def with_named_robot(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a set, with those of the robot file that `robot` names.

    The robot's control rate and disturbances are defaults, and so is its radius for the
    tolerance; other values of the set override them. A robot in metres needs the set's
    `resolution`; the lengths of the set are then in metres.

    Raises:
        TaskError: There is no such robot, its units are not those of the set, or the
            resolution is not a number above 0.
    """
    file, resolution = load_robot(values["robot"]), values.get("resolution")
    metric = None
    if file.units == "metres":
        metric = metres_per_px(_resolution(file.name, resolution))
        values = _in_pixels(values, metric)
    elif resolution is not None:
        raise TaskError(f"{file.name} is in pixels: leave out `resolution`")
    own = options_of(file, metric, False, disturbed=True)
    dt = own.pop("dt")
    errors = {name: own.pop(name) for name in list(own) if name in _ERRORS}
    own.pop("stopping_distance", None)  # it has no part in a set's hash
    robot = {_KEYS.get(name, name): value for name, value in own.items()}
    if "ray_angles" in robot:
        assert file.scanner is not None
        robot["n_rays"] = file.scanner.rays
        robot["field_of_view_deg"] = file.scanner.field_of_view
    given = values.get("disturbances") or {}
    return {
        "dt": dt,
        "goal_tolerance": robot["radius"],
        **values,
        "robot": robot,
        "disturbances": {**errors, **given} if isinstance(given, dict) else given,
    }


def _resolution(robot: str, given: Any) -> float:
    if given is None:
        raise TaskError(
            f"{robot} is in metres: give `resolution`, the metres per px of the "
            "worlds, or a robot in pixels"
        )
    return positive("resolution", given)


def _in_pixels(values: dict[str, Any], metric: MapUnits) -> dict[str, Any]:
    """The lengths of a set in metres, in px; what is no number stays for the schema."""

    def px(length: Any) -> Any:
        if isinstance(length, list):
            return [px(each) for each in length]
        is_number = isinstance(length, int | float) and not isinstance(length, bool)
        return metric.length_in_pixels(float(length)) if is_number else length

    def changed(part: Any, keys: tuple[str, ...], change: Callable[[Any], Any]) -> Any:
        if isinstance(part, list):
            return [changed(each, keys, change) for each in part]
        if not isinstance(part, dict):
            return part
        own = {key: change(part[key]) for key in keys if key in part}
        return {**part, **own}

    def whole(length: Any) -> Any:
        pixels = px(length)
        return round(pixels) if isinstance(pixels, float) else pixels

    own = dict(values)
    for key, keys, change in (
        ("worlds", ("width", "height"), whole),
        ("movers", ("speed", "radius"), px),
        ("disturbances", LENGTHS, px),
    ):
        if key in own:
            own[key] = changed(own[key], keys, change)
    for key in ("worlds", "files"):
        if isinstance(own.get(key), dict) and "folder" in own[key]:
            own[key] = {**own[key], "metres": metric.per_pixel}
    return changed(own, ("goal_tolerance",), px)  # type: ignore[no-any-return]
