"""`task.yaml`: what is asked for, in the user's words."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tdac_envs.errors import TaskError
from tdac_envs.maps import bundled_maps

Profile = Literal["policy", "paper"]


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
    env: Literal["TDAC-Map2D-v0"] = "TDAC-Map2D-v0"
    map: str = Field("maze", description="Bundled name, or a path beside this file.")
    robot: RobotSpec = RobotSpec()
    start: tuple[float, float] | tuple[float, float, float] | None = None
    goal: tuple[float, float] | None = None
    snap: bool = Field(False, description="Move start and goal to a free place.")
    tolerance: float | None = Field(None, gt=0, description="px")
    dt: float = Field(0.05, gt=0, description="s")
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
        names = ", ".join(bundled_maps())
        close = difflib.get_close_matches(str(asked), bundled_maps(), n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise TaskError(
            f"no task {str(asked)!r}: {error.strerror}{hint}; bundled tasks: {names}"
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
        return TaskFile.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise TaskError(f"{source}: {where}: {first['msg']}") from error
