"""`task.yaml`: what is asked for, in the user's words."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tdac_envs.errors import TaskError, first_problem, hint
from tdac_envs.maps import bundled_maps
from tdac_envs.worlds import bundled_worlds

TASK_FILE = "task.yaml"
"""Its name in the folder of a task or a run."""

Profile = Literal["policy", "paper"]
EnvName = Literal["TDAC-Map2D-v0", "TDAC-EPuck-v0"]
MAP2D: EnvName = "TDAC-Map2D-v0"
EPUCK: EnvName = "TDAC-EPuck-v0"
OWN_KEYS: dict[EnvName, tuple[str, ...]] = {
    MAP2D: ("map", "robot", "snap"),
    EPUCK: ("world", "ignore", "left_out"),
}
"""Keys of a task file that mean something in one environment only."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RobotSpec(_Strict):
    """The robot's body, where it differs from the default."""

    radius: float | None = Field(None, gt=0, description="px")
    axle: float | None = Field(None, gt=0, description="px; default 2 x radius")
    max_wheel_speed: float | None = Field(None, gt=0, description="px/s")
    n_rays: int | None = Field(None, ge=1)
    field_of_view: float | None = Field(None, gt=0, le=360, description="degrees")
    range_max: float | None = Field(None, gt=0, description="px")
    image: Path | None = Field(None, description="Picture of the robot, nose to +x.")


class ProgressSpec(_Strict):
    """The progress test: d_min <= fraction * d0 within so many steps."""

    fraction: float = Field(0.7, gt=0, lt=1)
    steps: int | None = Field(None, gt=0, description="Default max(400, 0.16 horizon).")
    distance: Literal["geodesic", "euclidean"] = "geodesic"


class TaskFile(_Strict):
    """Contents of `task.yaml`, schema 1."""

    schema_version: Literal[1] = Field(1, alias="schema")
    name: str | None = Field(None, description="For people.")
    env: EnvName = MAP2D
    map: str = Field("maze", description="Bundled name, or a path beside this file.")
    world: str = Field("arena", description="The same of a Webots world.")
    ignore: tuple[str, ...] = Field(
        (), description="Nodes of the world that may be solid and are left out."
    )
    left_out: tuple[str, ...] = Field(
        (), description="Nodes that were left out when the world was written."
    )
    robot: RobotSpec = RobotSpec()
    start: tuple[float, float] | tuple[float, float, float] | None = None
    goal: tuple[float, float] | None = None
    snap: bool = Field(False, description="Move start and goal to a free place.")
    tolerance: float | None = Field(None, gt=0, description="px; e-puck: m")
    dt: float | None = Field(
        None, gt=0, description="s; default 0.05, e-puck: the world's basicTimeStep."
    )
    horizon: int | None = Field(None, gt=0, description="steps")
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
        data = yaml.safe_load(path.read_text())
    except OSError as error:
        known = bundled_tasks()
        raise TaskError(
            f"no task {str(asked)!r}: {error.strerror}{hint(str(asked), known)}; "
            f"bundled tasks: {', '.join(known)}"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split())
        raise TaskError(f"{path} is not a task file: {reason}") from error
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
    for env, keys in OWN_KEYS.items():
        for key in spec.model_fields_set.intersection(keys):
            if env != spec.env:
                raise TaskError(f"{source}: {key}: only with env: {env}")
    return spec


def bundled_tasks() -> tuple[str, ...]:
    """Names of the bundled tasks: the maps, then the e-puck's worlds."""
    return (*bundled_maps(), *_worlds())


def bundled_task(name: str) -> TaskFile | None:
    """Contents of a bundled task, or None where there is none of that name.

    A map's task is called as the map; `epuck` is the world `arena`, `epuck-maze` the
    world `maze`.
    """
    if name in bundled_maps():
        return TaskFile(map=name)
    world = _worlds().get(name)
    return None if world is None else TaskFile(env=EPUCK, world=world)


def _worlds() -> dict[str, str]:
    default, *others = bundled_worlds()
    return {"epuck": default, **{f"epuck-{name}": name for name in others}}
