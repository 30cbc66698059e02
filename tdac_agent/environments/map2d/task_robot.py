"""The robot of a task on a map: as typed, from a robot file, and for a task file."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
from pydantic import ValidationError

from tdac_agent.tasks.task_file import RobotSpec, TaskFile
from tdac_envs.core.errors import MapError, TaskError, first_problem
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.map2d.robot_options import RAYS, options_of
from tdac_envs.map2d.source import metric_units
from tdac_envs.mapping.image import picture_size, read_bytes
from tdac_envs.mapping.params import MapParams, RobotParams
from tdac_envs.robots.bundled import load_robot, placed_robot

ROBOT_IMAGE_BYTES = 16_000_000
ROBOT_IMAGE_PIXELS = 4_000_000
FURTHER = (
    *("ray_angles", "range_min", "below_min", "scanner_offset", "max_speed"),
    *("max_turn_rate", "max_acceleration", "max_turn_acceleration"),
    "stopping_distance",
)
"""Properties of a robot that not every robot has."""
_FURTHER_LENGTHS = "range_min", "max_speed", "max_acceleration", "stopping_distance"
_NAMES = {"robot_radius": "radius", "axle_length": "axle"}


def further(robot: RobotParams) -> dict[str, Any]:
    """Those of `FURTHER` that a robot has."""
    own = {name: getattr(robot, name) for name in FURTHER}
    return {name: value for name, value in own.items() if value is not None}


def robot_text(robot: RobotParams, units: MapUnits) -> str:
    """The robot's size and speed on a map, and how to change them."""
    return (
        f"robot: radius {units.length(robot.radius)}, full speed "
        f"{units.length(robot.max_wheel_speed)}/s (to change them: --radius, "
        "--max-speed)"
    )


def robot_in_pixels(spec: RobotSpec, units: MapUnits) -> RobotSpec:
    """A robot with its lengths converted to px."""
    names = ("radius", "axle", "max_wheel_speed", "range_max", *_FURTHER_LENGTHS)
    lengths = {name: getattr(spec, name) for name in names}
    changes: dict[str, Any] = {
        name: units.length_in_pixels(length)
        for name, length in lengths.items()
        if length is not None
    }
    if spec.ray_angles is not None:
        changes["ray_angles"] = tuple(0.0 - angle for angle in spec.ray_angles)
    if spec.scanner_offset is not None:
        ahead, left = map(units.length_in_pixels, spec.scanner_offset)
        changes["scanner_offset"] = (ahead, 0.0 - left)
    return spec.model_copy(update=changes)


def further_written(robot: RobotParams, units: MapUnits) -> dict[str, Any]:
    """Those of `FURTHER` that a robot has, for a task file in these units."""
    own = further(robot)
    for name in _FURTHER_LENGTHS:
        if name in own:
            own[name] = units.written_length(own[name])
    up = units.frame is not None
    if "ray_angles" in own:
        own["ray_angles"] = [0.0 - a if up else a for a in own["ray_angles"]]
    if "scanner_offset" in own:
        ahead, aside = map(units.written_length, own["scanner_offset"])
        own["scanner_offset"] = [ahead, 0.0 - aside if up else aside]
    return own


def with_robot_file(
    spec: TaskFile, source: str, base: Path, units: MapUnits
) -> tuple[TaskFile, dict[str, Any]]:
    """The task file, in px, with the robot of its robot file; its disturbances.

    What the task file says of the robot overrides its robot file.

    Raises:
        TaskError: There is no such robot, its units are not those of the map, or a
            length of it is too large in px.
    """
    name = spec.robot.file
    if name is None:
        return spec, {}
    file = load_robot(placed_robot(name, base))
    metric = metric_units(source, spec.resolution)
    # The task is in px by now; a robot in px is refused for one in metres.
    in_metres = units.frame is not None and file.units == "pixels"
    own = options_of(file, metric, in_metres, disturbed=False)
    dt = own.pop("dt")
    own = {_NAMES.get(key, key): value for key, value in own.items()}
    own["body"] = file.body
    typed = spec.robot.model_dump(exclude_none=True)
    if typed.keys() & set(RAYS):
        own = {key: value for key, value in own.items() if key not in RAYS}
    with _in_range():
        robot = RobotSpec.model_validate({**own, **typed})
    errors = file.disturbances()
    if file.units == "metres" and units.frame is None and "pose_noise" in errors:
        assert metric is not None
        errors["pose_noise"] = metric.length_in_pixels(errors["pose_noise"])
    changes = {"robot": robot, "dt": dt if spec.dt is None else spec.dt}
    return spec.model_copy(update=changes), errors


def check_robot_image(file: Path) -> None:
    """Checks a picture of a robot.

    Raises:
        TaskError: It cannot be used.
    """
    try:
        width, height = picture_size(read_bytes(file, ROBOT_IMAGE_BYTES), file.name)
    except MapError as error:
        raise TaskError(f"the robot image: {error}") from error
    if not cv2.haveImageReader(str(file)):
        raise TaskError(f"the robot image {str(file)!r} is not a PNG or JPEG")
    if width * height > ROBOT_IMAGE_PIXELS:
        raise TaskError(
            f"the robot image {str(file)!r} has {width} x {height} pixels; the limit "
            f"is {ROBOT_IMAGE_PIXELS / 1e6:g} megapixels: scale it down"
        )


def with_robot(params: MapParams, spec: RobotSpec) -> MapParams:
    """The contents of `params.json` with a robot.

    Raises:
        TaskError: A length of it is too large in px.
    """
    values = spec.model_dump(
        exclude={"radius", "image", "file", "body"}, exclude_none=True
    )
    fields = {"axle": "axle_length", "field_of_view": "field_of_view_deg"}
    changes = {fields.get(key, key): value for key, value in values.items()}
    if "ray_angles" in changes:
        changes["n_rays"] = len(changes["ray_angles"])
    with _in_range():
        return params.model_copy(update={"robot": params.robot.changed(**changes)})


@contextmanager
def _in_range() -> Generator[None]:
    """Reports a length that is in range in metres, but not in px."""
    try:
        yield
    except ValidationError as error:
        raise TaskError(f"robot (lengths in px): {first_problem(error)}") from None
