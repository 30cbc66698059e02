"""Tasks with the parts that flags give, in addition to the others or instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.option_fields import flag_name, typed_fields
from tdac_agent.runs.ownership import load_task
from tdac_agent.tasks.environment import Environment
from tdac_agent.tasks.registry import own_environments
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import TaskFile, checked
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import TEXT_BYTES, read_file
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.robots.bundled import bundled_robots, load_robot

KEYS = {
    "tolerance": "tolerance",
    "dt": "dt",
    "goal": "goal",
    "movers": "movers",
    "snap": "snap",
    "resolution": "resolution",
    "polarity": "polarity",
    "threshold": "threshold",
    "instructions": "instructions",
    "ignore": "ignore",
    "robot": "robot.file",
    "robot_radius": "robot.radius",
    "max_speed": "robot.max_wheel_speed",
    "rays": "robot.n_rays",
    "fov": "robot.field_of_view",
    "range_max": "robot.range_max",
    "robot_image": "robot.image",
}
"""Fields, and the keys of a task file that they give."""
LENGTHS = ("tolerance", "robot_radius", "max_speed", "range_max")


def changed_task(task: Task, flags: TaskFlags) -> Task:
    """A task with the parts that the flags give, shown in metres for `--metres`.

    Places and lengths are in the frame of the task, or in metres with `--metres`.
    What follows from start and goal, such as the horizon, follows from the new ones.

    Raises:
        TaskError: The changed task cannot be used, or has no metres.
    """
    if typed_fields(flags.changes):
        task = _changed(task, flags)
    return shown(task, flags)


def shown(task: Task, flags: TaskFlags) -> Task:
    """The task, shown in metres of the map's frame for `--metres`."""
    if not flags.in_metres:
        return task
    return replace(task, setting=task.setting.in_metres())


def refuse_foreign(flags: TaskFlags, own: Environment) -> None:
    """Refuses flags for keys that only another environment's tasks have.

    Raises:
        TaskError: There is such a flag.
    """
    for field in typed_fields(flags.changes):
        key = KEYS.get(field.name, field.name)
        for other in own_environments():
            if other.has_key(key) and not own.has_key(key):
                why = f"this task is of {own.id}, not of {other.id}"
                raise TaskError(f"{why}: leave out {flag_name(field)}")


def _changed(task: Task, flags: TaskFlags) -> Task:
    from tdac_agent.environments.map2d.setting import map_setting

    refuse_foreign(flags, task.environment)
    base, spec = task.folder or Path(), task.spec
    start = task.setting.ends()["start"]
    if flags.in_metres and spec.frame == "pixels":
        flags = in_pixels(flags, MapUnits.metres(map_setting(task.setting).params))
    keys = keys_of(flags, base, start)
    robot = keys.pop("robot", {})
    old = spec.model_dump(
        exclude_unset=True, by_alias=True, exclude=_following(spec, base)
    )
    own = old.pop("robot", {})
    if "radius" in robot and own.get("axle") == 2 * own.get("radius", 0):
        del own["axle"]  # it follows from the radius
    if "file" in robot:  # another robot: nothing of the old one stays
        own = {}
        old.pop("dt", None)
        old.pop("disturbances", None)
    robot = {**own, **robot}
    made = load_task(
        file_of({**old, **keys, **({"robot": robot} if robot else {})}), base=base
    )
    return replace(task, spec=made.spec, setting=made.setting)


def _following(spec: TaskFile, base: Path) -> set[str]:
    """Keys whose values are those that follow from the rest of the task file.

    The task file of a run has all of them.
    """
    fixed = {"horizon", "tolerance"} & spec.model_fields_set
    if not fixed:
        return set()
    free = load_task(spec.model_copy(update=dict.fromkeys(fixed)), base=base)
    nominal, ends = free.nominal, free.setting.ends()
    following = {"horizon": nominal.horizon, "tolerance": ends["tolerance"]}
    return {key for key in fixed if getattr(spec, key) == following[key]}


def in_pixels(flags: TaskFlags, units: MapUnits) -> TaskFlags:
    """The flags with their places and lengths converted to pixels."""
    values = {name: getattr(flags, name) for name in LENGTHS}
    lengths: dict[str, Any] = {
        n: units.length_in_pixels(v) for n, v in values.items() if v is not None
    }
    return replace(
        flags,
        start=None if flags.start is None else units.pixels(flags.start),
        goal=None if flags.goal is None else units.pixels(flags.goal),
        heading=None
        if flags.heading is None
        else units.heading_in_pixels(flags.heading),
        **lengths,
    )


def keys_of(
    flags: TaskFlags, base: Path = Path(), start: Sequence[float] | None = None
) -> dict[str, Any]:
    """The keys of a task file that the flags give.

    Args:
        flags: The flags.
        base: Folder that relative paths in the task file refer to.
        start: Where a heading alone is turned to.

    Raises:
        TaskError: There is a heading, but no start.
    """
    keys: dict[str, Any] = {}
    if flags.heading is not None:
        place = flags.start or start
        if place is None:
            raise TaskError("--heading needs --start X Y")
        keys["start"] = (*place[:2], flags.heading)
    elif flags.start is not None:
        keys["start"] = flags.start
    for field in typed_fields(flags.changes):
        if field.name not in KEYS:
            continue
        value = getattr(flags, field.name)
        if field.name == "instructions":
            value = _text(value)
        if field.name == "robot_image" and base != Path():
            value = value.absolute()
        if field.name == "robot" and value not in bundled_robots():
            load_robot(value)
            value = str(Path(value).absolute())
        part, _, key = KEYS[field.name].rpartition(".")
        (keys.setdefault(part, {}) if part else keys)[key] = value
    return keys


def file_of(data: dict[str, Any]) -> TaskFile:
    """The task file with these keys; an error names the flag of a key."""
    try:
        return checked(data, "flags")
    except TaskError as error:
        key, _, reason = str(error).removeprefix("flags: ").partition(": ")
        raise TaskError(f"{_flag_of_key(key)}: {reason}") from error


def _flag_of_key(key: str) -> str:
    """The flag that gives a key, also one below it, as in `start.0`."""
    flags = {field.name: flag_name(field) for field in fields(TaskFlags)}
    known = {path: flags[name] for name, path in KEYS.items()}
    known |= {"start": "--start", "map": "--map", "world": "--world"}
    return known.get(key) or known.get(key.partition(".")[0], key)


def _text(typed: str) -> str:
    """The user's instructions: the text, or the contents of the file that it names."""
    path = Path(typed)
    if len(typed) < 250 and "\n" not in typed and path.is_file():
        try:
            return read_file(path, TEXT_BYTES).decode("utf-8", "replace")
        except OSError as error:
            raise TaskError(f"cannot read {typed}: {error.strerror}") from error
    return typed
