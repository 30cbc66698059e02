"""Schema and reading of `task.yaml`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.registry import DEFAULT, environment, own_environments
from tdac_envs.core.arguments import MOST_STEPS, in_radians
from tdac_envs.core.errors import TaskError, first_problem, hint
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.mapping.params import MOST_RAYS, FrameName, Length, Place
from tdac_envs.movers.spec import AnySpec, Spec, read_specs
from tdac_envs.robots.robot_file import Body

TASK_FILE = "task.yaml"
"""File name in the folder of a task or a run."""
SET_FILE = "set.yaml"
"""File name in the folder of a run on a task set, which has no single task."""
OWN_SUITE = "suite"
"""Subfolder of a run with the user's own tests."""

MAP_FILES = (
    *(".png", ".jpg", ".jpeg", ".pgm", ".bmp", ".gif", ".tif", ".tiff", ".webp"),
    *(".map", ".npy"),
)
"""Suffixes of maps; a ROS map is a YAML file."""

Profile = Literal["policy", "paper"]
Steps = Annotated[int, Field(gt=0, le=MOST_STEPS)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


def _names_a_file(name: str) -> str:
    if not name.isprintable() or "/" in name:
        raise ValueError("expected printable characters only, and no /")
    return name


def _movers_of(given: Any) -> tuple[AnySpec, ...]:
    try:
        return read_specs(given)
    except TaskError as error:
        # The validation error names the key.
        raise ValueError(str(error).removeprefix("movers: ")) from None


def _named(given: Any) -> Any:
    """A name or path of a robot file is short for the key `file`."""
    return {"file": given} if isinstance(given, str) else given


def _sizes(given: dict[str, int | float]) -> dict[str, int | float]:
    try:
        Disturbance().changed(given)
    except TaskError as error:
        raise ValueError(str(error)) from None
    return given


class RobotSpec(StrictModel):
    """Properties of the robot that differ from the default, or from its file."""

    file: str | None = Field(
        None,
        description="Bundled robot (`tdac robots`), or path of a robot file relative "
        "to this file; `robot: NAME` is short for it.",
    )
    radius: Length | None = Field(None, description="px")
    axle: Length | None = Field(None, description="px; default 2 x radius")
    max_wheel_speed: Length | None = Field(None, description="px/s")
    n_rays: int | None = Field(None, ge=1, le=MOST_RAYS)
    field_of_view: float | None = Field(None, gt=0, le=360, description="degrees")
    range_max: Length | None = Field(None, description="px")
    ray_angles: tuple[float, ...] | None = Field(
        None, max_length=MOST_RAYS, description="rad, instead of n_rays."
    )
    range_min: Length | None = Field(None, description="px")
    below_min: Literal["range_max", "range_min", "zero"] | None = None
    scanner_offset: tuple[Place, Place] | None = Field(
        None, description="Where the rays start, px: ahead, to the right."
    )
    max_speed: Length | None = Field(None, description="Of the body, px/s.")
    max_turn_rate: Length | None = Field(None, description="Of the body, rad/s.")
    max_acceleration: Length | None = Field(None, description="Of a wheel, px/s².")
    max_turn_acceleration: Length | None = Field(None, description="rad/s²")
    stopping_distance: Length | None = Field(
        None, description="From full speed to standstill, px."
    )
    body: Body | None = Field(None, description="For another physics, as in its file.")
    image: Path | None = Field(None, description="Picture of the robot, facing +x.")


class ProgressSpec(StrictModel):
    """The progress test: d_min <= fraction * d0 within `steps` steps."""

    fraction: float = Field(0.7, gt=0, lt=1)
    steps: Steps | None = Field(None, description="Default max(400, 0.16 horizon).")
    distance: Literal["geodesic", "euclidean"] = "geodesic"


def _faces(start: tuple[float, ...] | None) -> tuple[float, ...] | None:
    for heading in (start or ())[2:]:
        in_radians(heading)
    return start


class TaskFile(StrictModel):
    """Contents of `task.yaml`, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    name: Annotated[Name, AfterValidator(_names_a_file)] | None = Field(
        None, description="Display name; also used in file names."
    )
    env: Name = DEFAULT
    map: str = Field("maze", description="Bundled map, or path relative to this file.")
    world: str = Field("arena", description="Bundled Webots world, or path as above.")
    ignore: tuple[Name, ...] = Field(
        (), description="Nodes of the world to ignore, although they may be solid."
    )
    left_out: tuple[Name, ...] = Field(
        (), description="Nodes that were ignored when this world file was written."
    )
    robot: Annotated[RobotSpec, BeforeValidator(_named)] = RobotSpec()
    disturbances: Annotated[dict[str, int | float], AfterValidator(_sizes)] = Field(
        {}, description="Of confirmations, as flags of `--robust`: `wheel_slip: 0.02`."
    )
    start: Annotated[
        tuple[Place, ...] | None,
        Field(min_length=2, max_length=3),
        AfterValidator(_faces),
    ] = Field(None, description="x, y and, if given, the heading in rad.")
    goal: tuple[Place, Place] | None = None
    snap: bool = Field(False, description="Move start and goal to free places.")
    frame: FrameName = Field(
        "pixels",
        description="Units and frame of this file, and of what a controller observes.",
    )
    polarity: Literal["dark", "light"] | None = Field(
        None, description="Which pixels of the map image are obstacles."
    )
    threshold: float | None = Field(
        None, ge=0, lt=255, description="Luminance above which a pixel is light."
    )
    resolution: Length | None = Field(
        None, description="Metres per pixel of a map image that gives none."
    )
    movers: Annotated[tuple[Spec, ...], BeforeValidator(_movers_of)] = Field(
        (), description="Moving obstacles, as the environment's argument `movers`."
    )
    tolerance: Length | None = Field(None, description="px; e-puck: m")
    dt: Length | None = Field(
        None, description="s; default 0.05, or the world's basicTimeStep."
    )
    horizon: Steps | None = Field(None, description="steps")
    progress: ProgressSpec = ProgressSpec()
    variation: Literal["nominal", "jitter", "random"] = "jitter"
    suite: Path | None = Field(None, description="Folder with additional test files.")
    profile: Profile = "paper"
    instructions: str = Field("", description="Additional text for the prompt.")

    model_config = ConfigDict(populate_by_name=True)

    @model_validator(mode="before")
    @classmethod
    def _of_its_profile(cls, given: Any) -> Any:
        """Controllers in metres have the profile `policy`, which need not be said."""
        if isinstance(given, dict) and given.get("frame") == "metres":
            return {"profile": "policy", **given}
        return given


def check_frame(frame: FrameName, profile: Profile) -> None:
    """Refuses the functions of the paper, which use pixels, for a task in metres.

    Raises:
        TaskError: Frame and profile do not fit.
    """
    if frame == "metres" and profile == "paper":
        raise TaskError(
            "profile: the functions of the profile `paper` use pixels; in metres "
            "(`frame`), give the profile `policy`, or the frame `pixels`"
        )


def read_task_file(path: Path, asked: object) -> TaskFile:
    """Reads a task file.

    Args:
        path: The file.
        asked: The user's name for it, for messages.

    Raises:
        TaskError: The file cannot be read, or has an invalid or unknown key.
    """
    if path.suffix.lower() in MAP_FILES and path.is_file():
        raise TaskError(_is_map(asked, "map"))
    if path.suffix.lower() == ".wbt" and path.is_file():
        raise TaskError(_is_map(asked, "world"))
    try:
        data = parse_yaml(read_file(path, TEXT_BYTES))
    except OSError as error:
        if (path.parent / SET_FILE).is_file():
            raise TaskError(
                f"{asked} has a task set and no single task: give --set "
                f"{path.parent / SET_FILE}"
            ) from error
        known = bundled_tasks()
        raise TaskError(
            f"no task {str(asked)!r}: {error.strerror}{hint(str(asked), known)}; "
            f"bundled tasks: {', '.join(known)}"
        ) from error
    except ValueError as error:
        raise TaskError(f"{path} is not a task file: {error}") from error
    if not isinstance(data, dict):
        raise TaskError(f"{path} is not a task file: expected `key: value` lines")
    if {"image", "resolution"} <= data.keys():
        raise TaskError(_is_map(asked, "map"))
    return checked(data, str(path))


def _is_map(asked: object, key: str) -> str:
    """What to do with a map or world that was given as a task file."""
    ends = "--start X Y --goal X Y" if key == "map" else "--goal X Y"
    return (
        f"{asked} is a {key}, not a task: give --{key} {asked} {ends}, or a task.yaml "
        f"with the line `{key}: {asked}`"
    )


def checked(data: dict[str, Any], source: str) -> TaskFile:
    """Validates the parsed contents of a task file.

    Args:
        data: Values by key.
        source: Their source, for messages.

    Raises:
        TaskError: A key is invalid or unknown; the message names it.
    """
    try:
        spec = TaskFile.model_validate(data)
    except ValidationError as error:
        raise TaskError(f"{source}: {first_problem(error, TaskFile)}") from error
    try:
        own = environment(spec.env)
    except TaskError as error:
        raise TaskError(f"{source}: env: {error}") from error
    typed = spec.model_fields_set | {f"robot.{k}" for k in spec.robot.model_fields_set}
    for other in own_environments():
        for key in sorted(typed):
            if other.has_key(key) and not own.has_key(key):
                raise TaskError(f"{source}: {key}: only valid with env: {other.id}")
    return spec


def bundled_tasks() -> tuple[str, ...]:
    """Returns the names of the bundled tasks: the maps, then the e-puck's worlds."""
    return tuple(name for one in own_environments() for name in one.bundled())


def bundled_task(name: str) -> TaskFile | None:
    """Returns the contents of a bundled task, or None if no task has that name.

    A map's task has the map's name; `epuck` is the world `arena`, `epuck-maze` the
    world `maze`.
    """
    for one in own_environments():
        place = one.bundled().get(name)
        if place is not None:
            return TaskFile.model_validate({"env": one.id, one.keys[0]: place})
    return None
