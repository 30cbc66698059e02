"""The robot file that a `set.yaml` names, as values of the set."""

from __future__ import annotations

from typing import Any

from tdac_envs.core.errors import TaskError
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.ladder.set_disturbances import DisturbanceSpec
from tdac_envs.map2d.robot_options import options_of
from tdac_envs.robots.bundled import load_robot

_ERRORS = DisturbanceSpec.model_fields.keys() - {"range_min", "max_acceleration"}
"""Disturbances of a set; the others are properties of its robot."""
_KEYS = {"robot_radius": "radius", "field_of_view": "field_of_view_deg"}


def with_named_robot(values: dict[str, Any]) -> dict[str, Any]:
    """The values of a set, with those of the robot file that `robot` names.

    The robot's control rate and disturbances are defaults; other values of the set
    override them. A robot in metres needs the set's `resolution`.

    Raises:
        TaskError: There is no such robot, or its units are not those of the set.
    """
    file, resolution = load_robot(values["robot"]), values.get("resolution")
    metric = None
    if resolution is not None:
        metric = MapUnits(MapFrame(1, float(resolution), (0.0, 0.0, 0.0)))
    elif file.units == "metres":
        raise TaskError(
            f"{file.name} is in metres: give `resolution`, the metres per px of the "
            "worlds, or a robot in pixels"
        )
    own = options_of(file, metric, False, disturbed=True)
    dt = own.pop("dt")
    errors = {name: own.pop(name) for name in list(own) if name in _ERRORS}
    own.pop("stopping_distance", None)  # it has no part in a set's hash
    robot = {_KEYS.get(name, name): value for name, value in own.items()}
    if "ray_angles" in robot:
        robot["n_rays"] = len(robot["ray_angles"])
    given = values.get("disturbances") or {}
    return {
        "dt": dt,
        **values,
        "robot": robot,
        "disturbances": {**errors, **given} if isinstance(given, dict) else given,
    }
