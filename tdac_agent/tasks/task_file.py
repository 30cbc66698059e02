"""`task.yaml`: what is asked for, in the user's words."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from tdac_agent.tasks.registry import DEFAULT, environment, own_environments
from tdac_envs.core.arguments import MOST_STEPS
from tdac_envs.core.errors import TaskError, first_problem, hint
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file
from tdac_envs.mapping.params import MOST_RAYS, Length, Place

TASK_FILE = "task.yaml"
"""Its name in the folder of a task or a run."""

Profile = Literal["policy", "paper"]
Steps = Annotated[int, Field(gt=0, le=MOST_STEPS)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


def _names_a_file(name: str) -> str:
    if not name.isprintable() or "/" in name:
        raise ValueError("expected characters that can be shown, and no /")
    return name


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RobotSpec(_Strict):
    """The robot's body, where it differs from the default."""

    radius: Length | None = Field(None, description="px")
    axle: Length | None = Field(None, description="px; default 2 x radius")
    max_wheel_speed: Length | None = Field(None, description="px/s")
    n_rays: int | None = Field(None, ge=1, le=MOST_RAYS)
    field_of_view: float | None = Field(None, gt=0, le=360, description="degrees")
    range_max: Length | None = Field(None, description="px")
    image: Path | None = Field(None, description="Picture of the robot, nose to +x.")


class ProgressSpec(_Strict):
    """The progress test: d_min <= fraction * d0 within so many steps."""

    fraction: float = Field(0.7, gt=0, lt=1)
    steps: Steps | None = Field(None, description="Default max(400, 0.16 horizon).")
    distance: Literal["geodesic", "euclidean"] = "geodesic"


class TaskFile(_Strict):
    """Contents of `task.yaml`, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    name: Annotated[Name, AfterValidator(_names_a_file)] | None = Field(
        None, description="For people; names files, too."
    )
    env: Name = DEFAULT
    map: str = Field("maze", description="Bundled name, or a path beside this file.")
    world: str = Field("arena", description="The same of a Webots world.")
    ignore: tuple[Name, ...] = Field(
        (), description="Nodes of the world that may be solid and are left out."
    )
    left_out: tuple[Name, ...] = Field(
        (), description="Nodes that were left out when the world was written."
    )
    robot: RobotSpec = RobotSpec()
    start: Annotated[tuple[Place, ...] | None, Field(min_length=2, max_length=3)] = None
    goal: tuple[Place, Place] | None = None
    snap: bool = Field(False, description="Move start and goal to a free place.")
    polarity: Literal["dark", "light"] | None = Field(
        None, description="Which pixels of the map image are obstacles."
    )
    threshold: float | None = Field(
        None, ge=0, lt=255, description="Luminance above which a pixel is light."
    )
    tolerance: Length | None = Field(None, description="px; e-puck: m")
    dt: Length | None = Field(
        None, description="s; default 0.05, e-puck: the world's basicTimeStep."
    )
    horizon: Steps | None = Field(None, description="steps")
    progress: ProgressSpec = ProgressSpec()
    variation: Literal["nominal", "jitter", "random"] = "jitter"
    suite: Path | None = Field(None, description="Folder with further test files.")
    profile: Profile = "paper"
    instructions: str = Field("", description="The user's own text to the model.")

    model_config = ConfigDict(populate_by_name=True)


def read_task_file(path: Path, asked: object) -> TaskFile:
    """Contents of a task file.

    Args:
        path: The file.
        asked: What the user called it, for messages.

    Raises:
        TaskError: It cannot be read, or has a wrong or unknown key.
    """
    try:
        data = parse_yaml(read_file(path, TEXT_BYTES))
    except OSError as error:
        known = bundled_tasks()
        raise TaskError(
            f"no task {str(asked)!r}: {error.strerror}{hint(str(asked), known)}; "
            f"bundled tasks: {', '.join(known)}"
        ) from error
    except ValueError as error:
        raise TaskError(f"{path} is not a task file: {error}") from error
    if not isinstance(data, dict):
        raise TaskError(f"{path} is not a task file: expected `key: value` lines")
    return checked(data, str(path))


def checked(data: dict[str, Any], source: str) -> TaskFile:
    """Contents of a task file.

    Args:
        data: By key.
        source: Where they come from, for messages.

    Raises:
        TaskError: A key is wrong or unknown; the message names it.
    """
    try:
        spec = TaskFile.model_validate(data)
    except ValidationError as error:
        raise TaskError(f"{source}: {first_problem(error)}") from error
    try:
        own = environment(spec.env).keys
    except TaskError as error:
        raise TaskError(f"{source}: env: {error}") from error
    for other in own_environments():
        for key in spec.model_fields_set.intersection(other.keys).difference(own):
            raise TaskError(f"{source}: {key}: only with env: {other.id}")
    return spec


def bundled_tasks() -> tuple[str, ...]:
    """Names of the bundled tasks: the maps, then the e-puck's worlds."""
    return tuple(name for one in own_environments() for name in one.bundled())


def bundled_task(name: str) -> TaskFile | None:
    """Contents of a bundled task, or None if there is none of that name.

    A map's task is called as the map; `epuck` is the world `arena`, `epuck-maze` the
    world `maze`.
    """
    for one in own_environments():
        about = one.bundled().get(name)
        if about is not None:
            return TaskFile.model_validate({"env": one.id, one.keys[0]: about})
    return None
